"""Which seeds are whose: training, validation and planner-training homes never share a seed, hence never a home."""

from typing import Literal

Split = Literal["train", "planner", "val"]

SEEDS: dict[Split, range] = {
    "train": range(0, 1_000_000),
    "planner": range(1_000_000, 2_000_000),
    "val": range(2_000_000, 3_000_000),
}


def home_seed(split: Split, index: int) -> int:
    """The seed of a split's home number `index` (from 0), for `generate_home`.

    Raises ValueError for an unknown split or an index that the split does not have.
    """
    if split not in SEEDS:
        raise ValueError(f"unknown split {split!r}; choose one of {', '.join(SEEDS)}")
    seeds = SEEDS[split]
    if not 0 <= index < len(seeds):
        raise ValueError(f"split {split!r} has homes 0 to {len(seeds) - 1}, not {index}")
    return seeds[index]
