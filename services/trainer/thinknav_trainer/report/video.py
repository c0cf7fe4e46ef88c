"""A video of one episode: what the agent saw, beside where it was. Knows pictures; nothing of runs."""

import io
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import av
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from thinknav_sim.render import Camera, Renderer
from thinknav_sim.scene import Scene
from thinknav_trainer.report.floor_map import FloorMap, draw_path

VIEW_PIXELS = 384
CAPTION_PIXELS = 56
FRAMES_PER_SECOND = 12
LAST_FRAME_SECONDS = 2


@dataclass(frozen=True)
class Played:
    """An episode to show: scene, goal category, (x, y, z, heading) at each moment, subgoal by step, how it ended."""

    scene: Scene
    category: str
    path: Sequence[Sequence[float]]
    subgoals: dict[int, str]
    ending: str


def write_video(path: Path, played: Played, renderer: Renderer, floor_map: FloorMap) -> None:
    """Encode as H.264 in MP4, which browsers play."""
    with av.open(str(path), "w", options={"movflags": "faststart"}) as container:
        stream: av.VideoStream | None = None
        for image in _frames(played, renderer, floor_map):
            if stream is None:
                stream = container.add_stream("libx264", rate=FRAMES_PER_SECOND, options={"crf": "24"})
                stream.width, stream.height, stream.pix_fmt = image.width, image.height, "yuv420p"
            container.mux(stream.encode(av.VideoFrame.from_ndarray(np.asarray(image), format="rgb24")))
        if stream is not None:
            container.mux(stream.encode(None))


def _frames(played: Played, renderer: Renderer, floor_map: FloorMap) -> Iterator[Image.Image]:
    camera = Camera(VIEW_PIXELS, VIEW_PIXELS)
    scene_id = renderer.add_scene(played.scene)
    subgoal = ""
    image = Image.new("RGB", (2, 2))
    for step, pose in enumerate(played.path):
        rgb, _ = renderer.render(np.array([scene_id]), np.array([pose], np.float64), camera)
        subgoal = played.subgoals.get(step, subgoal)
        so_far = [thought for thought in played.subgoals if thought <= step]
        above = draw_path(floor_map, played.scene, played.category, played.path[: step + 1], so_far)
        caption = f"find a {played.category.replace('_', ' ')}    step {step}"
        if step == len(played.path) - 1:
            caption += f"    {played.ending}"
        image = _compose(Image.fromarray(rgb[0]), above, caption, f"last thought: {subgoal}" if subgoal else "")
        yield image
    renderer.remove_scene(scene_id)
    for _ in range(FRAMES_PER_SECOND * LAST_FRAME_SECONDS):
        yield image


def _compose(view: Image.Image, above: Image.Image, caption: str, thought: str) -> Image.Image:
    scale = min(VIEW_PIXELS / above.height, 1.4 * VIEW_PIXELS / above.width)
    small = above.resize((round(above.width * scale), round(above.height * scale)), Image.Resampling.LANCZOS)
    width = VIEW_PIXELS + small.width
    sheet = Image.new("RGB", (width + width % 2, VIEW_PIXELS + CAPTION_PIXELS), (255, 255, 255))
    sheet.paste(view, (0, 0))
    sheet.paste(small, (VIEW_PIXELS, (VIEW_PIXELS - small.height) // 2))
    draw = ImageDraw.Draw(sheet)
    font = ImageFont.load_default(16)
    draw.text((10, VIEW_PIXELS + 8), caption, fill=(30, 30, 30), font=font)
    draw.text((10, VIEW_PIXELS + 30), thought, fill=(160, 110, 0), font=font)
    return sheet


def to_png(image: Image.Image) -> bytes:
    """The image as PNG bytes."""
    buffer = io.BytesIO()
    image.save(buffer, "PNG", optimize=True)
    return buffer.getvalue()
