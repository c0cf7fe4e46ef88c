"""Procedural homes: furnished flats drawn from a seed, deterministic, with the goals of ObjectNav in them.

`home` tells the story; `layout` and `doors` plan, `building` builds, `furnish` and `placement` furnish, `lighting`
bakes the light; `splits` says which seeds are for training, for validation, and for training planners.
"""

from thinknav_sim.homes.home import HomeError, generate_home
from thinknav_sim.homes.layout import MAX_ROOMS, LayoutError
from thinknav_sim.homes.splits import SEEDS, Split, home_seed

__all__ = ["MAX_ROOMS", "SEEDS", "HomeError", "LayoutError", "Split", "generate_home", "home_seed"]
