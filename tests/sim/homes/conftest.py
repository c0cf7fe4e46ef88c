"""Homes that several tests look at, generated once."""

import pytest

from thinknav_sim.homes import MAX_ROOMS, generate_home
from thinknav_sim.scene import Scene


@pytest.fixture(scope="session")
def homes() -> list[Scene]:
    """Seeds 0 to 20 with rooms by the seed, and every possible number of rooms."""
    usual = [generate_home(seed) for seed in range(21)]
    return usual + [generate_home(100 + rooms, rooms) for rooms in range(1, MAX_ROOMS + 1)]
