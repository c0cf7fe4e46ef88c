"""In which units a mesh is measured and which of its axes points up: given, or guessed and said.

Knows nothing of files.
"""

from dataclasses import dataclass, replace
from typing import Literal, get_args

import numpy as np
from numpy.typing import NDArray

from thinknav_sim.scans.mesh import Mesh
from thinknav_sim.scene import MAX_EXTENT_M, SceneError

Units = Literal["m", "cm", "mm", "inch"]
UpAxis = Literal["y", "z"]

METRES: dict[Units, float] = {"m": 1.0, "cm": 0.01, "mm": 0.001, "inch": 0.0254}

# What a home measures, metres: tried in the order of METRES, the first unit that fits is taken.
_HOME_HEIGHT = (1.6, 15.0)
_HOME_WIDTH = (1.5, 80.0)
_STOREY_HEIGHT = (1.6, 3.5)
# Habitat's rotation of a z-up scene (up 0, 0, 1, front 0, 1, 0): x, y, z becomes x, z, -y.
_UPRIGHT: dict[UpAxis, NDArray[np.float64]] = {
    "y": np.eye(3),
    "z": np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]),
}
# Scenes are kept as float32, whose steps are a millimetre here.
_FARTHEST_M = 10_000.0
# Surfaces within 15 degrees of level count as level; z must beat y by this much to be taken for up.
_LEVEL = np.cos(np.radians(15.0))
_MARGIN = 1.3


@dataclass(frozen=True)
class Frame:
    """How a file's coordinates become metres with y up. reasons: what was given or guessed, for people."""

    units: Units
    up_axis: UpAxis
    reasons: tuple[str, str]

    def upright(self, vertices: NDArray[np.float64]) -> NDArray[np.float64]:
        """(V, 3) of the file as metres, y up."""
        turned: NDArray[np.float64] = vertices @ _UPRIGHT[self.up_axis].T * METRES[self.units]
        return turned

    def applied(self, mesh: Mesh) -> Mesh:
        return replace(mesh, vertices=self.upright(mesh.vertices))


def find_frame(
    mesh: Mesh, source: object, units: Units | None, up_axis: UpAxis | None, *, is_gltf: bool = False
) -> Frame:
    """The frame of a mesh; what is None is guessed. is_gltf: its format says y, which scanners do not always heed.

    Raises SceneError for a mesh of no home's size in any unit.
    """
    if units is not None and units not in get_args(Units):
        raise SceneError(f"units must be one of {', '.join(get_args(Units))}, not {units!r}")
    if up_axis is not None and up_axis not in get_args(UpAxis):
        raise SceneError(f"the up-axis must be one of {', '.join(get_args(UpAxis))}, not {up_axis!r}")
    axis, why_axis = (up_axis, "given") if up_axis is not None else _guess_axis(mesh, is_gltf)
    size = np.ptp(mesh.vertices @ _UPRIGHT[axis].T, axis=0)
    unit, why_unit = (units, "given") if units is not None else _guess_units(size)
    extent = float(size.max()) * METRES[unit]
    if not 0 < extent <= MAX_EXTENT_M:
        fitting = "" if units is None else f" in units of {units}"
        raise SceneError(
            f"{source} is {extent:.3g} m wide{fitting}, which no home is; "
            f"say its units with --units ({', '.join(METRES)}) or repair it"
        )
    away = float(np.abs(mesh.vertices).max()) * METRES[unit]
    if away > _FARTHEST_M:
        raise SceneError(
            f"{source} lies {away:.3g} m from the origin of its coordinates, where they are too coarse to be kept; "
            "move it to the origin and export it again"
        )
    return Frame(unit, axis, (f"units: {unit} ({why_unit})", f"up-axis: {axis} ({why_axis})"))


def _guess_axis(mesh: Mesh, is_gltf: bool) -> tuple[UpAxis, str]:
    """Homes have more level surface (floor, ceiling, tables) than surface that faces along one horizontal axis.

    But for narrow ones, such as corridors: there a format's word counts.
    """
    normals, areas = mesh.normals()
    total = float(areas.sum())
    level = {axis: float(areas[np.abs(normals[:, i]) > _LEVEL].sum()) / total for axis, i in (("y", 1), ("z", 2))}
    axis: UpAxis = "z" if level["z"] > _MARGIN * level["y"] else "y"
    if is_gltf and axis == "z":
        width, height, depth = np.ptp(mesh.vertices, axis=0)
        if _fitting_unit(np.array([width, height, depth]), _STOREY_HEIGHT) is not None:
            return "y", "guessed: as glTF has it; then it is one storey high"
        if _fitting_unit(np.array([width, depth, height])) is None:
            return "y", "guessed: as glTF has it; with z up it has no home's size"
    other = "y" if axis == "z" else "z"
    return (
        axis,
        f"guessed: {level[axis]:.0%} of the surface is level with {axis} up, {level[other]:.0%} with {other} up",
    )


def _guess_units(size: NDArray[np.float64]) -> tuple[Units, str]:
    unit = _fitting_unit(size)
    if unit is None:
        return "m", "guessed: it has no home's size in any unit, so it is taken as it is"
    width, height = float(max(size[0], size[2])) * METRES[unit], float(size[1]) * METRES[unit]
    return unit, f"guessed: then it is {width:.1f} m wide and {height:.1f} m high"


def _fitting_unit(size: NDArray[np.float64], heights: tuple[float, float] = _HOME_HEIGHT) -> Units | None:
    """The first unit in which a size (3,), y up, is a home's; None where it is in none."""
    for unit, scale in METRES.items():
        width, height = float(max(size[0], size[2])) * scale, float(size[1]) * scale
        if heights[0] <= height <= heights[1] and _HOME_WIDTH[0] <= width <= _HOME_WIDTH[1]:
            return unit
    return None
