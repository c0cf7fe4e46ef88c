"""Embeddings as fields of messages: float32 arrays in Python, little-endian bytes in msgpack, lists in JSON.

Knows nothing of what an embedding means, nor of the encoder that made it.
"""

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainSerializer, PlainValidator, SerializationInfo, ValidationInfo

EMBEDDING_DIMENSION = 512

_WIRE_DTYPE = np.dtype("<f4")


def _read(value: object, info: ValidationInfo) -> NDArray[np.float32]:
    """A read-only float32 array from an array, from wire bytes, or in JSON from lists. Raises ValueError."""
    if isinstance(value, bytes):
        if len(value) % (EMBEDDING_DIMENSION * _WIRE_DTYPE.itemsize):
            raise ValueError(f"{len(value)} bytes are not a whole number of {EMBEDDING_DIMENSION} float32 values")
        array = np.frombuffer(value, dtype=_WIRE_DTYPE).astype(np.float32, copy=False)
    elif isinstance(value, np.ndarray):
        if value.dtype != np.float32:
            raise ValueError(f"an embedding must be float32, not {value.dtype}")
        array = value.copy()  # the message must not change when its maker goes on using the array
    elif isinstance(value, list) and info.mode == "json":
        try:
            array = np.array(value, dtype=np.float32)
        except (TypeError, ValueError, OverflowError):
            raise ValueError("an embedding must be a list of numbers") from None
    else:
        raise ValueError(f"an embedding must be a float32 array, not {type(value).__name__}")
    if not np.isfinite(array).all():
        raise ValueError("an embedding must be finite, but it holds NaN or infinity")
    array.setflags(write=False)
    return array


def _read_one(value: object, info: ValidationInfo) -> NDArray[np.float32]:
    array = _read(value, info)
    if array.shape != (EMBEDDING_DIMENSION,):
        raise ValueError(f"an embedding must have the shape ({EMBEDDING_DIMENSION},), not {array.shape}")
    return array


def _read_many(value: object, info: ValidationInfo) -> NDArray[np.float32]:
    array = _read(value, info)
    if isinstance(value, bytes):
        array = array.reshape(-1, EMBEDDING_DIMENSION)
    if array.ndim != 2 or array.shape[1] != EMBEDDING_DIMENSION:
        raise ValueError(f"embeddings must have the shape (N, {EMBEDDING_DIMENSION}), not {array.shape}")
    return array


def _write(array: NDArray[np.float32], info: SerializationInfo) -> bytes | list[object]:
    if info.mode_is_json():
        values: list[object] = array.tolist()
        return values
    return array.astype(_WIRE_DTYPE, copy=False).tobytes()


# (512,) float32, finite.
Embedding = Annotated[NDArray[np.float32], PlainValidator(_read_one), PlainSerializer(_write)]
# (N, 512) float32, finite.
Embeddings = Annotated[NDArray[np.float32], PlainValidator(_read_many), PlainSerializer(_write)]
