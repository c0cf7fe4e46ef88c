"""A home from a seed: plan, build, furnish, light, and hand over as a `Scene`."""

import numpy as np

from thinknav_sim.homes.building import outer_shell, room_shell
from thinknav_sim.homes.doors import Window
from thinknav_sim.homes.draw import between, stream
from thinknav_sim.homes.furnish import furnish
from thinknav_sim.homes.layout import MAX_ROOMS, FloorPlan, draw_plan
from thinknav_sim.homes.lighting import RoomLight
from thinknav_sim.homes.materials import Style
from thinknav_sim.homes.mesh import Floats, Mesh, join
from thinknav_sim.homes.placement import Piece, RoomSpace
from thinknav_sim.scene import Box, ObjectInstance, Room, Scene

USUAL_ROOMS = (3, 6)
_GOOD_TRIES = 8  # furnishings of a room that may be thrown away for lacking something
_MAX_TRIES = 60

# One random stream for each purpose, so that a change in one leaves the others as they were.
_ROOMS, _PLAN, _STYLE, _BUILDING, _FURNITURE = range(5)

# What a room must have to be what it is called, and what it should have besides. What these rooms must have gives every
# home of three rooms or more a bed, a toilet, a sofa and a television: at least four of the goal categories.
_NEEDED: dict[str, tuple[str, ...]] = {
    "bedroom": ("bed",),
    "bathroom": ("toilet",),
    "living room": ("sofa", "tv_monitor"),
    "studio": ("bed",),
    "study": ("desk",),
    "kitchen": ("counter",),
    "dining room": ("table",),
}
_WANTED: dict[str, tuple[str, ...]] = {
    "bedroom": ("wardrobe",),
    "bathroom": ("sink",),
    "living room": ("table",),
    "studio": ("sofa", "tv_monitor", "table"),
    "study": ("shelf",),
    "kitchen": ("fridge", "chair"),
    "dining room": ("chair",),
}


class HomeError(RuntimeError):
    """A home that could not be furnished; the message names its seed."""


def generate_home(seed: int, rooms: int | None = None) -> Scene:
    """A furnished home, the same for the same arguments on every machine.

    seed: 0 or more; see `splits.home_seed` for which seeds are whose.
    rooms: how many, 1 to 8; None draws 3 to 6 by the seed, and is the same home as asking for that number.
    Raises ValueError for a seed or a number of rooms out of range; LayoutError or HomeError, which no seed is known to
    cause, when a home cannot be planned or furnished.
    """
    if seed < 0:
        raise ValueError(f"a home's seed must be 0 or more, not {seed}")
    if rooms is not None and not 1 <= rooms <= MAX_ROOMS:
        raise ValueError(f"a home has 1 to {MAX_ROOMS} rooms, not {rooms}")
    low, high = USUAL_ROOMS
    count = rooms or low + int(stream(seed, _ROOMS).integers(high - low + 1))
    plan = draw_plan(stream(seed, _PLAN, count), count)
    style = Style.draw(stream(seed, _STYLE, count))
    spaces = [_furnished(seed, plan, index, style) for index in range(count)]
    return _assemble(f"home-{seed}" if rooms is None else f"home-{seed}-{rooms}", seed, plan, style, spaces)


def _furnished(seed: int, plan: FloorPlan, index: int, style: Style) -> RoomSpace:
    """One room furnished, again from the start while it lacks something that such rooms have."""
    function = plan.rooms[index].function
    needed, wanted = _NEEDED.get(function, ()), _WANTED.get(function, ())
    best: tuple[int, RoomSpace] | None = None
    for attempt in range(_MAX_TRIES):
        space = RoomSpace(plan, index)
        furnish(space, stream(seed, _FURNITURE, len(plan.rooms), index, attempt), style)
        if all(space.count(category) for category in needed):
            found = sum(space.count(category) > 0 for category in wanted)
            if best is None or found > best[0]:
                best = (found, space)
        if best is not None and (best[0] == len(wanted) or attempt + 1 >= _GOOD_TRIES):
            return best[1]
    raise HomeError(f"home of seed {seed}: its {function} has no place for {' and '.join(needed)}")


def _assemble(name: str, seed: int, plan: FloorPlan, style: Style, spaces: list[RoomSpace]) -> Scene:
    rng = stream(seed, _BUILDING, len(plan.rooms))
    meshes: list[Mesh] = [outer_shell(plan.outline)]
    colors = [RoomLight(plan.outline, (), (1.0, 1.0, 1.0), ()).bake(meshes[0])]
    owners = [np.full(len(meshes[0].triangles), -1, dtype=np.int32)]
    objects: list[ObjectInstance] = []
    for index, space in enumerate(spaces):
        shell = join(room_shell(rng, plan, index, style))
        parts, part_owners = [shell], [np.full(len(shell.triangles), -1, dtype=np.int32)]
        for piece in space.pieces:
            owner = -1 if piece.category is None else _add_object(objects, piece)
            parts.append(piece.mesh)
            part_owners.append(np.full(len(piece.mesh.triangles), owner, dtype=np.int32))
        room = join(parts)
        meshes.append(room)
        owners.append(np.concatenate(part_owners))
        colors.append(_light(rng, plan, index, space).bake(room))
    building = join(meshes)
    return Scene(
        name=name,
        vertices=_rounded(building.vertices).astype(np.float32),
        triangles=building.triangles,
        colors=np.concatenate(colors),
        triangle_objects=np.concatenate(owners),
        objects=tuple(objects),
        rooms=tuple(Room(room.function, room.interior) for room in plan.rooms),
    )


def _add_object(objects: list[ObjectInstance], piece: Piece) -> int:
    """Record the piece as the next object; its box is that of the vertices as the scene stores them."""
    corners = _rounded(np.stack((piece.mesh.low, piece.mesh.high))).astype(np.float32).astype(np.float64)
    objects.append(ObjectInstance(len(objects), piece.category or "", Box(corners[0], corners[1])))
    return len(objects) - 1


def _rounded(vertices: Floats) -> Floats:
    """To a tenth of a millimetre: what differs between machines' mathematics libraries is far smaller."""
    rounded: Floats = np.round(vertices, 4) + 0.0  # no negative zeros
    return rounded


def _light(rng: np.random.Generator, plan: FloorPlan, index: int, space: RoomSpace) -> RoomLight:
    windows: tuple[Window, ...] = tuple(window for window in plan.windows if window.room == index)
    warmth = between(rng, -0.03, 0.03)
    return RoomLight(space.interior, windows, (1.0 + warmth, 1.0, 1.0 - warmth), space.footprints)
