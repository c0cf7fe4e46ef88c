"""What every renderer checks of its arguments before it draws. Knows nothing of how scenes are drawn."""

from collections.abc import Iterator
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

Built = TypeVar("Built")


class SceneTable(Generic[Built]):
    """A renderer's scenes by id. Ids are never used twice, so that a stale one is noticed."""

    def __init__(self) -> None:
        self._scenes: dict[int, Built] = {}
        self._next_id = 0

    def __iter__(self) -> Iterator[Built]:
        return iter(self._scenes.values())

    def add(self, scene: Built) -> int:
        scene_id = self._next_id
        self._next_id += 1
        self._scenes[scene_id] = scene
        return scene_id

    def __getitem__(self, scene_id: int) -> Built:
        """Raises KeyError that names the scenes there are."""
        try:
            return self._scenes[scene_id]
        except KeyError:
            known = ", ".join(map(str, self._scenes)) or "none"
            raise KeyError(f"the renderer has no scene {scene_id}; it has: {known}") from None

    def remove(self, scene_id: int) -> Built:
        """Raises KeyError that names the scenes there are."""
        scene = self[scene_id]
        del self._scenes[scene_id]
        return scene

    def clear(self) -> None:
        self._scenes.clear()


def check_views(
    scene_ids: NDArray[np.int64], poses: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Fresh, contiguous copies of the ids (N,) and poses (N, 4) of N views.

    Raises ValueError that says what is wrong with which view.
    """
    ids, places = np.asarray(scene_ids), np.asarray(poses)
    if ids.ndim != 1 or not np.issubdtype(ids.dtype, np.integer):
        raise ValueError(f"scene_ids must be integers of shape (N,), not {ids.dtype} of shape {ids.shape}")
    if places.shape != (len(ids), 4) or not np.issubdtype(places.dtype, np.floating):
        raise ValueError(
            f"poses must be floats of shape ({len(ids)}, 4), one for each scene id, "
            f"not {places.dtype} of shape {places.shape}"
        )
    finite = np.isfinite(places).all(axis=1)
    if not finite.all():
        view = int(np.argmin(finite))
        raise ValueError(f"the pose of view {view} is not finite: {places[view].tolist()}")
    return np.array(ids, np.int64, order="C"), np.array(places, np.float64, order="C")


def check_rays(
    origins: NDArray[np.float32], directions: NDArray[np.float32]
) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Fresh, contiguous copies of the origins (R, 3) and directions (R, 3) of R rays.

    Raises ValueError that says what is wrong with which ray.
    """
    starts, ways = _check_vectors("origins", origins), _check_vectors("directions", directions)
    if starts.shape != ways.shape:
        raise ValueError(f"{len(starts)} origins do not go with {len(ways)} directions")
    still = ~ways.any(axis=1)
    if still.any():
        raise ValueError(f"ray {int(np.argmax(still))} has a direction of zero length")
    return starts, ways


def _check_vectors(name: str, vectors: NDArray[np.float32]) -> NDArray[np.float32]:
    given = np.asarray(vectors)
    if given.ndim != 2 or given.shape[1] != 3 or not np.issubdtype(given.dtype, np.floating):
        raise ValueError(f"{name} must be floats of shape (R, 3), not {given.dtype} of shape {given.shape}")
    with np.errstate(over="ignore"):  # what is too large for float32 is reported below
        fresh = np.array(given, np.float32, order="C")
    finite = np.isfinite(fresh).all(axis=1)
    if not finite.all():
        ray = int(np.argmin(finite))
        raise ValueError(f"{name} of ray {ray} are not finite: {given[ray].tolist()}")
    return fresh
