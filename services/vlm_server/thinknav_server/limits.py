"""Admission: what a request may ask for, checked before anything in it is decoded.

The length of a body is checked while it arrives, in `intake`; this module sees whole requests.
"""

from collections.abc import Sequence

from thinknav_proto import EmbedRequest, InvalidRequest, Limits, SubgoalRequest
from thinknav_server.images import frame_size


def admit(request: SubgoalRequest, limits: Limits) -> None:
    """Raises InvalidRequest for a goal that is too long or a frame that is too large."""
    _check_text("the goal", request.goal, limits)
    for frame in request.frames:
        width, height = frame_size(frame)
        if width * height > limits.max_pixels:
            raise InvalidRequest(f"the frame has {width} x {height} pixels, the limit is {limits.max_pixels} in all")


def check_frame_count(frames: int, limits: Limits) -> None:
    """Raises InvalidRequest when one body carries too many frames."""
    if frames > limits.max_frames:
        raise InvalidRequest(f"the body carries {frames} frames, the limit is {limits.max_frames}; send it in parts")


def admit_texts(request: EmbedRequest, limits: Limits) -> Sequence[str]:
    """The texts to embed. Raises InvalidRequest for too many or too long ones."""
    if len(request.texts) > limits.max_texts:
        raise InvalidRequest(
            f"the body carries {len(request.texts)} texts, the limit is {limits.max_texts}; send it in parts"
        )
    for index, text in enumerate(request.texts):
        _check_text(f"text {index}", text, limits)
    return request.texts


def _check_text(name: str, text: str, limits: Limits) -> None:
    if len(text) > limits.max_text_length:
        raise InvalidRequest(f"{name} has {len(text)} characters, the limit is {limits.max_text_length}")
