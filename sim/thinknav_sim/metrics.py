"""How well an episode went: SPL and SoftSPL as Habitat computes them (Anderson et al., arXiv 1807.06757), and SOT.

Pure functions of arrays; they know nothing of environments.
"""

import numpy as np
from numpy.typing import ArrayLike, NDArray


def path_efficiency(shortest: ArrayLike, travelled: ArrayLike) -> NDArray[np.float64]:
    """L / max(L, P): 1 for an agent that went no farther than it had to.

    shortest: L, the distance to the goal at the start, metres. travelled: P, the summed lengths of its steps.
    An episode that starts at its goal (L = 0) scores 1 when the agent stays there and 0 when it moves.
    """
    length, path = np.asarray(shortest, np.float64), np.asarray(travelled, np.float64)
    longer = np.maximum(length, path)
    return np.where(longer > 0, length / np.where(longer > 0, longer, 1.0), 1.0)


def spl(success: ArrayLike, shortest: ArrayLike, travelled: ArrayLike) -> NDArray[np.float64]:
    """Success weighted by path length: S * L / max(L, P)."""
    return np.asarray(success, np.float64) * path_efficiency(shortest, travelled)


def soft_spl(distance: ArrayLike, shortest: ArrayLike, travelled: ArrayLike) -> NDArray[np.float64]:
    """SPL with the share of the way that was covered in the place of success: max(0, 1 - d/L) * L / max(L, P).

    distance: d, the distance to the goal at the end, metres. With L = 0 the share is 1 at the goal and 0 off it.
    """
    left, length = np.asarray(distance, np.float64), np.asarray(shortest, np.float64)
    # An agent that ends farther off than it began has covered nothing, as if it had stayed.
    share_left = np.where(length > 0, np.minimum(left, length) / np.where(length > 0, length, 1.0), left > 0)
    return (1.0 - share_left) * path_efficiency(shortest, travelled)


def success_weighted_by_time(success: ArrayLike, shortest: ArrayLike, taken: ArrayLike) -> NDArray[np.float64]:
    """SOT, success weighted by operation time: S * T* / max(T, T*), as SPL with seconds in the place of metres.

    shortest: T*, the time of an agent that knows the way, seconds, above 0. taken: T, that of the agent, thinking
    included. (The name is from Wang et al., arXiv 2602.09972.)
    """
    return spl(success, shortest, taken)
