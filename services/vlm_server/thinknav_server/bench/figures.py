"""A measured figure as one line of JSON, with the fields that `thinknav bench sim` has."""

import json
from dataclasses import asdict, dataclass


@dataclass(frozen=True)
class Figure:
    """One number, and what it is held to.

    figure: its name ("service.c64.vs_litserve"). peer: what it is compared with, and where that could not be
    measured, how to make it so. peer_value: in the same unit. ratio: above 1 where ours is better.
    """

    figure: str
    value: float
    unit: str
    peer: str | None = None
    peer_value: float | None = None
    ratio: float | None = None

    @property
    def line(self) -> str:
        """The figure as one line of JSON, of three digits."""
        values = {k: float(f"{v:.3g}") if isinstance(v, float) else v for k, v in asdict(self).items()}
        return json.dumps(values)
