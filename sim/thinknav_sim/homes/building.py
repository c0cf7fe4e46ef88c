"""The building itself: floors, ceilings, walls with their openings, windows, and an outer shell that closes it."""

import itertools

import numpy as np

from thinknav_sim.homes import materials as mat
from thinknav_sim.homes.doors import CASING_M, DOOR_HEIGHT_M, WALL_M, Doorway, Rect, Window
from thinknav_sim.homes.draw import pick
from thinknav_sim.homes.layout import FloorPlan
from thinknav_sim.homes.materials import Style
from thinknav_sim.homes.mesh import Color, Floats, Mesh, Point, grid, quads
from thinknav_sim.homes.walls import ROOM_HEIGHT_M, Wall, walls_of

PLANK_WIDTH_M = 0.24
PLANK_LENGTH_M = 1.4
TILE_M = 0.32
CORNER_M = 0.4  # walls and ceilings are cut this far from corners, so that the darkening there shows
LONG_M = 3.6  # longer faces are cut in the middle as well, so that the light of windows shows

_CASING_DEPTH_M = 0.016
_BASEBOARD_M = 0.08


def room_shell(rng: np.random.Generator, plan: FloorPlan, index: int, style: Style) -> list[Mesh]:
    """Floor, ceiling, walls, door casings and windows of one room."""
    room = plan.rooms[index]
    tiled = room.function == "bathroom"
    tint = pick(rng, mat.BATH_TINTS) if tiled else style.wall_tints[index % len(style.wall_tints)]
    middle = _middle(room.interior)
    meshes = [
        _tiles(rng, room.interior, style.tiles) if tiled else _planks(rng, room.interior, style.floor_wood),
        _ceiling(room.interior, middle),
    ]
    for wall in walls_of(room.interior):
        doors = [door for door in plan.doorways if index in door.rooms and door.side_of(index) == wall.side]
        windows = [window for window in plan.windows if (window.room, window.side) == (index, wall.side)]
        meshes.append(_wall_face(wall, doors, windows, tint, middle))
        meshes += _baseboards(wall, doors, style.trim)
        for door in doors:
            meshes += _casing(wall, (door.start, door.end), (0.0, DOOR_HEIGHT_M), style.trim)
        for window in windows:
            meshes += _window(wall, window, style.trim)
    meshes += [_passage(walls_of(room.interior), door, style) for door in plan.doorways if door.rooms[0] == index]
    return meshes


def outer_shell(outline: Rect) -> Mesh:
    """The outside walls, roof and ground slab: whatever gap there may be inside, no ray leaves the home."""
    half = WALL_M / 2
    x0, z0, x1, z1 = (outline[0] - half, outline[1] - half, outline[2] + half, outline[3] + half)
    low, high = -0.02, ROOM_HEIGHT_M + 0.02
    ring = [(x0, z0), (x1, z0), (x1, z1), (x0, z1)]
    faces = [
        [(ax, low, az), (bx, low, bz), (bx, high, bz), (ax, high, az)]
        for (ax, az), (bx, bz) in zip(ring, ring[1:] + ring[:1], strict=True)
    ]
    faces += [[(x, y, z) for x, z in ring] for y in (low, high)]
    return quads(faces, mat.OUTSIDE)


def _middle(rect: Rect) -> Point:
    return ((rect[0] + rect[2]) / 2, ROOM_HEIGHT_M / 2, (rect[1] + rect[3]) / 2)


def _cuts(low: float, high: float, inner: float) -> list[float]:
    """Where a face is cut: at its ends, `inner` from them, and in the middle of a long one."""
    if high - low < 2.5 * inner:
        return [low, (low + high) / 2, high]
    if high - low < LONG_M:
        return [low, low + inner, high - inner, high]
    return [low, low + inner, (low + high) / 2, high - inner, high]


def _level(corners: Floats, height: float) -> Floats:
    """(Q, 4, 2) corners in x and z as (Q, 4, 3) points at a height."""
    heights = np.full((*corners.shape[:2], 1), height)
    return np.concatenate((corners[..., :1], heights, corners[..., 1:]), axis=-1)


def _ceiling(rect: Rect, middle: Point) -> Mesh:
    x0, z0, x1, z1 = rect
    cells = grid(_cuts(x0, x1, CORNER_M), _cuts(z0, z1, CORNER_M))
    return quads(_level(cells, ROOM_HEIGHT_M), mat.CEILING, toward=middle)


def _planks(rng: np.random.Generator, rect: Rect, color: Color) -> Mesh:
    """Rows of boards with staggered joints, no two of one tone; each is cut in two to carry shadows."""
    x0, z0, x1, z1 = rect
    along_x = x1 - x0 >= z1 - z0
    u0, u1, v0, v1 = (x0, x1, z0, z1) if along_x else (z0, z1, x0, x1)
    rows = np.linspace(v0, v1, max(2, round((v1 - v0) / PLANK_WIDTH_M)) + 1)
    cells, tones = [], []
    for row, (low, high) in enumerate(itertools.pairwise(rows)):
        first = u0 - PLANK_LENGTH_M * ((row * 0.37) % 1.0)
        joints = np.arange(first, u1 + PLANK_LENGTH_M, PLANK_LENGTH_M / 2)
        tone = 1 + 0.16 * (rng.random(len(joints) // 2 + 1) - 0.5)
        ends = np.clip(joints, u0, u1)
        board = np.flatnonzero(np.diff(ends) > 1e-3)
        cells.append(
            np.array(
                [[(a, low), (b, low), (b, high), (a, high)] for a, b in zip(ends[board], ends[board + 1], strict=True)]
            )
        )
        tones.append(tone[board // 2])
    corners = np.concatenate(cells)
    shades = np.concatenate(tones)[:, None] * np.array(color)
    return quads(_level(corners if along_x else corners[..., ::-1], 0.0), shades, toward=_middle(rect))


def _tiles(rng: np.random.Generator, rect: Rect, colors: tuple[Color, Color]) -> Mesh:
    """A chequered floor, its tiles slightly uneven in tone."""
    x0, z0, x1, z1 = rect
    columns, rows = round((x1 - x0) / TILE_M), round((z1 - z0) / TILE_M)
    cells = grid(np.linspace(x0, x1, columns + 1), np.linspace(z0, z1, rows + 1))
    odd = (np.arange(len(cells)) // columns + np.arange(len(cells)) % columns) % 2
    shades = np.array(colors)[odd] * (1 + 0.06 * (rng.random((len(cells), 1)) - 0.5))
    return quads(_level(cells, 0.0), shades, toward=_middle(rect))


def _wall_face(wall: Wall, doors: list[Doorway], windows: list[Window], tint: Color, middle: Point) -> Mesh:
    holes = [(door.start, door.end, 0.0, DOOR_HEIGHT_M) for door in doors]
    holes += [(window.start, window.end, window.sill, window.top) for window in windows]
    columns = {*_cuts(wall.start, wall.end, CORNER_M), *(edge for hole in holes for edge in hole[:2])}
    levels = {0.0, 0.35, 2.25, ROOM_HEIGHT_M, *(edge for hole in holes for edge in hole[2:])}
    cells = grid(sorted(columns), sorted(levels))
    center = cells.mean(axis=1)
    solid = np.ones(len(cells), dtype=bool)
    for t0, t1, y0, y1 in holes:
        solid &= (center[:, 0] < t0) | (center[:, 0] > t1) | (center[:, 1] < y0) | (center[:, 1] > y1)
    places = np.concatenate((cells[solid], np.zeros((int(solid.sum()), 4, 1))), axis=-1)
    return wall.quads(places, tint, toward=middle)


def _baseboards(wall: Wall, doors: list[Doorway], color: Color) -> list[Mesh]:
    edges = [wall.start]
    for door in sorted(doors, key=lambda door: door.start):
        edges += [door.start - CASING_M, door.end + CASING_M]
    edges.append(wall.end)
    stretches = zip(edges[::2], edges[1::2], strict=True)
    return [wall.panel((low, high), (0.0, _BASEBOARD_M), 0.012, color) for low, high in stretches if high - low > 0.02]


def _casing(wall: Wall, along: tuple[float, float], height: tuple[float, float], color: Color) -> list[Mesh]:
    """A flat frame on the wall around an opening; a door has none at the floor."""
    (t0, t1), (y0, y1) = along, height
    bars = [
        wall.panel((t0 - CASING_M, t0), (y0, y1), _CASING_DEPTH_M, color),
        wall.panel((t1, t1 + CASING_M), (y0, y1), _CASING_DEPTH_M, color),
        wall.panel((t0 - CASING_M, t1 + CASING_M), (y1, y1 + CASING_M), _CASING_DEPTH_M, color),
    ]
    if y0 > 0:
        bars.append(wall.panel((t0 - CASING_M, t1 + CASING_M), (y0 - 0.04, y0), 0.05, color))
    return bars


def _hole_sides(along: tuple[float, float], height: tuple[float, float], depth: tuple[float, float]) -> Floats:
    """The four sides of an opening through a wall: left, right, top, bottom."""
    (t0, t1), (y0, y1), (d0, d1) = along, height, depth
    upright = [[(t, y0, d0), (t, y1, d0), (t, y1, d1), (t, y0, d1)] for t in (t0, t1)]
    level = [[(t0, y, d0), (t1, y, d0), (t1, y, d1), (t0, y, d1)] for y in (y1, y0)]
    return np.array(upright + level, dtype=np.float64)


def _passage(walls: tuple[Wall, ...], door: Doorway, style: Style) -> Mesh:
    """Jambs, lintel and threshold between two rooms."""
    wall = walls[door.side]
    sides = _hole_sides((door.start, door.end), (0.0, DOOR_HEIGHT_M), (-WALL_M, 0.0))
    x, z = wall.position((door.start + door.end) / 2, -WALL_M / 2)
    colors = np.array([style.trim, style.trim, style.trim, mat.shade(style.floor_wood, 0.85)])
    return wall.quads(sides, colors, toward=(x, 1.0, z))


def _window(wall: Wall, window: Window, color: Color) -> list[Mesh]:
    """A pane of sky set into the wall, its reveal, a casing with a sill, and glazing bars."""
    along, height = (window.start, window.end), (window.sill, window.top)
    x, z = wall.position((window.start + window.end) / 2, 0.0)
    inside = (x, (window.sill + window.top) / 2, z)
    pane = [
        (window.start, window.sill),
        (window.end, window.sill),
        (window.end, window.top),
        (window.start, window.top),
    ]
    sky = np.array([[mat.SKY_LOW, mat.SKY_LOW, mat.SKY_TOP, mat.SKY_TOP]])
    meshes = [
        wall.quads([[(t, y, -0.08) for t, y in pane]], sky, toward=inside),
        wall.quads(_hole_sides(along, height, (-0.08, 0.0)), color, toward=inside),
        *_casing(wall, along, height, color),
    ]
    middle = (window.start + window.end) / 2
    frame = (-0.075, -0.045)
    if window.end - window.start > 0.8:
        meshes.append(wall.box((middle - 0.025, middle + 0.025), height, frame, color))
    meshes.append(wall.box(along, (window.top - 0.05, window.top), frame, color))
    meshes.append(wall.box(along, (window.sill, window.sill + 0.05), frame, color))
    return meshes
