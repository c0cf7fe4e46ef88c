"""Points spread over triangles, close enough together that nothing larger than their spacing is missed."""

import numpy as np
from numpy.typing import NDArray


def points_on(
    triangles: NDArray[np.floating], spacing: float, most: int = 200
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Points (P, D) on triangles (T, 3, D), their corners among them, and the triangle (P,) of each.

    Along an edge they lie at most `spacing` apart, or longer / `most` on longer ones than that allows.
    """
    longest = np.linalg.norm(triangles - np.roll(triangles, 1, axis=1), axis=-1).max(axis=1, initial=0.0)
    counts = np.clip(np.ceil(longest / spacing).astype(np.int64), 1, most)
    points = [np.empty((0, triangles.shape[2]))]
    owners = [np.empty(0, np.int64)]
    for count in np.unique(counts):
        chosen = np.flatnonzero(counts == count)
        u, v = np.indices((count + 1, count + 1)) / count
        inside = u + v <= 1 + 1e-9
        weights = np.stack([1 - u[inside] - v[inside], u[inside], v[inside]], axis=1)
        points.append((weights @ triangles[chosen].astype(np.float64)).reshape(-1, triangles.shape[2]))
        owners.append(np.repeat(chosen, len(weights)))
    return np.concatenate(points), np.concatenate(owners)
