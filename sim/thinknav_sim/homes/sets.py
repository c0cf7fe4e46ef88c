"""Pieces that belong together: a sofa across from its television, chairs at a table, lamps beside a bed.

Each function either returns an `Arrangement` or finds a place for one in a room.
"""

import numpy as np

from thinknav_sim.homes.draw import between, chance, pick
from thinknav_sim.homes.furniture import beds, decor, electronics, kitchen, plants, seats, storage, tables
from thinknav_sim.homes.materials import Style
from thinknav_sim.homes.mesh import Mesh, join
from thinknav_sim.homes.placement import WALL_GAP_M, Arrangement, Piece, RoomSpace, single


def _things(rng: np.random.Generator, style: Style, x: float, y: float, z: float) -> Piece:
    """Small things on a surface."""
    return Piece(None, join(decor.tabletop_things(rng, style)).moved(x, y, z))


def sideboard_with_things(rng: np.random.Generator, style: Style) -> Arrangement:
    width, height = between(rng, 1.1, 1.6), between(rng, 0.72, 0.85)
    pieces = [Piece("cabinet", storage.sideboard(rng, style, width, height))]
    pieces.append(_things(rng, style, -width / 4, height, 0.2))
    if chance(rng, 0.5):
        pieces.append(Piece("plant", plants.table_plant(rng, style).moved(width / 4, height, 0.02)))
    else:
        pieces.append(Piece("lamp", decor.table_lamp(rng, style).moved(width / 4, height, 0.1)))
    return Arrangement(tuple(pieces), 0.4)


def place_sofa_and_tv(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    """A sofa that faces a television across a coffee table on a rug, as far apart as the room lets them."""
    places = 3 if space.area > 16 and chance(rng, 0.7) else 2
    sofa = seats.sofa(rng, style, places)
    cabinet_width, cabinet_height = between(rng, 1.3, 1.7), between(rng, 0.42, 0.55)
    screen_width = between(rng, 1.0, min(1.35, cabinet_width))
    if chance(rng, 0.6):
        cabinet = storage.sideboard(rng, style, cabinet_width, cabinet_height, depth=0.4)
        screen = electronics.television(rng, style, screen_width).moved(y=cabinet_height)
    else:
        cabinet = storage.sideboard(rng, style, cabinet_width, cabinet_height, depth=0.3)
        screen = electronics.wall_television(rng, screen_width)
    table = tables.coffee_table(rng, style, between(rng, 0.9, 1.1))
    rug = decor.rug(rng, style, between(rng, 1.8, 2.3), 1.5)
    things = _things(rng, style, 0.0, tables.COFFEE_HEIGHT_M, 0.28)
    spans = {wall.span for wall in space.walls}
    across = [span - 2 * WALL_GAP_M for span in sorted(spans) if span < 4.8]  # the sofa stands at the opposite wall
    distances = [*across, between(rng, 2.9, 3.4), 2.8]
    for with_table in (True, True, False, False):
        for distance in distances:
            pieces = [Piece("cabinet", cabinet), Piece("tv_monitor", screen)]
            pieces.append(Piece("sofa", sofa.quarter_turned(2).moved(z=distance)))
            back = distance - float(sofa.high[2]) - 0.38 - float(table.high[2])
            if with_table:
                pieces.append(Piece("table", table.moved(z=back)))
                pieces.append(Piece(None, things.mesh.moved(z=back)))
                pieces.append(Piece("rug", rug.moved(z=back + 0.2)))
            if space.stand(Arrangement(tuple(pieces)), rng, "middle", tries=20):
                return
    # The room is too cut up for that: each where it fits.
    space.stand(single("sofa", sofa, 0.4), rng)
    space.stand(Arrangement((Piece("cabinet", cabinet), Piece("tv_monitor", screen)), 0.5), rng)


def place_tv_on_dresser(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    height = 0.78
    dresser = Piece("dresser", storage.dresser(rng, style, 1.2, height))
    screen = Piece("tv_monitor", electronics.television(rng, style, 0.9).moved(y=height))
    space.stand(Arrangement((dresser, screen), 0.4), rng)


def _seat(rng: np.random.Generator, chair: Mesh, x: float, z: float, quarters: int) -> Piece:
    """A chair whose front edge is at (x, z); nobody pushes it back quite straight."""
    skew = 0.2 * (2 * float(rng.random()) - 1) if chance(rng, 0.5) else 0.0
    depth = float(chair.high[2])
    centered = chair.moved(z=-depth / 2).turned(skew)
    return Piece("chair", centered.moved(z=-float(centered.high[2])).quarter_turned(quarters).moved(x, 0.0, z))


def dining_set(rng: np.random.Generator, style: Style, chairs: int) -> Arrangement:
    """A table with chairs on its long sides, and at its ends when there are six."""
    chair = seats.dining_chair(rng, style)
    if chairs <= 4 and chance(rng, 0.3):
        radius = between(rng, 0.45, 0.55)
        table, width, depth = tables.round_table(rng, style, radius), 2 * radius, 2 * radius
    else:
        width, depth = (between(rng, 1.5, 1.7), 0.88) if chairs > 2 else (0.85, 0.75)
        table = tables.dining_table(rng, style, width, depth)
    gap = 0.03
    offsets = (-width / 4, width / 4) if width > 1.3 else (0.0,)
    pieces = [Piece("table", table), _things(rng, style, 0.0, tables.DINING_HEIGHT_M, depth / 2)]
    for x in offsets:
        pieces.append(_seat(rng, chair, x, -gap, 0))
        pieces.append(_seat(rng, chair, x, depth + gap, 2))
    if chairs > 4 or (chairs == 4 and len(offsets) == 1):
        pieces.append(_seat(rng, chair, -width / 2 - gap, depth / 2, 1))
        pieces.append(_seat(rng, chair, width / 2 + gap, depth / 2, 3))
    return Arrangement(tuple(pieces))


def place_dining(space: RoomSpace, rng: np.random.Generator, style: Style, chairs: int) -> None:
    """A table with chairs in the open, or a small one against a wall."""
    if chairs > 2 and space.float_freely(dining_set(rng, style, chairs), rng):
        return
    table = tables.dining_table(rng, style, 0.8, 0.7)
    chair = seats.dining_chair(rng, style)
    seated = [_seat(rng, chair, 0.0, 0.73, 2)]
    if chance(rng, 0.6):
        side = pick(rng, (-1, 1))
        seated.append(_seat(rng, chair, side * 0.43, 0.35, 1 if side < 0 else 3))
    things = _things(rng, style, 0.0, tables.DINING_HEIGHT_M, 0.3)
    if not space.stand(Arrangement((Piece("table", table), things, *seated)), rng, tries=20):
        space.stand(Arrangement((Piece("table", table), things, seated[0])), rng, tries=20)


def place_bed(space: RoomSpace, rng: np.random.Generator, style: Style, width: float) -> None:
    """A bed with its head at a wall; a nightstand with a lamp on each side that has room."""
    mesh = beds.bed(rng, style, width)
    stand = beds.nightstand(rng, style)
    lamp = decor.table_lamp(rng, style).moved(0.0, float(stand.high[1]), 0.08)
    reach = float(mesh.high[0]) + 0.05 - float(stand.low[0])
    rug = Piece("rug", decor.rug(rng, style, width + 1.2, 1.4).moved(z=1.6))
    bare = [Piece("bed", mesh)]
    beside = {
        side: [Piece("nightstand", stand.moved(side * reach)), Piece("lamp", lamp.moved(side * reach))]
        for side in (-1, 1)
    }
    rug_or_not = [rug] if chance(rng, 0.5) else []
    one = beside[pick(rng, (-1, 1))]
    for extras in ([*beside[-1], *beside[1], *rug_or_not], one, []):
        if space.stand(Arrangement((*bare, *extras)), rng, "middle", tries=20):
            return
    space.stand(Arrangement(tuple(bare)), rng, "corner", tries=28)


def reading_corner(rng: np.random.Generator, style: Style) -> Arrangement:
    """An armchair with a lamp on one side and a little table on the other."""
    chair = seats.armchair(rng, style)
    lamp, table = decor.floor_lamp(rng, style), tables.side_table(rng, style)
    side, reach = pick(rng, (-1, 1)), float(chair.high[0]) + 0.05
    pieces = [Piece("chair", chair), Piece("lamp", lamp.moved(side * (reach - float(lamp.low[0]))))]
    if chance(rng, 0.6):
        pieces.append(Piece("table", table.moved(-side * (reach - float(table.low[0])), 0.0, 0.1)))
    return Arrangement(tuple(pieces), 0.35)


def desk_set(rng: np.random.Generator, style: Style, screen: bool) -> Arrangement:
    """A desk with its chair, a lamp, and a monitor or books."""
    width = between(rng, 1.1, 1.5)
    top = tables.DINING_HEIGHT_M
    pieces = [Piece("desk", tables.desk(rng, style, width))]
    chair = seats.office_chair(rng, style) if chance(rng, 0.7) else seats.dining_chair(rng, style)
    pieces.append(_seat(rng, chair, 0.0, tables.DESK_DEPTH_M + 0.04, 2))
    pieces.append(Piece("lamp", decor.table_lamp(rng, style).moved(width / 2 - 0.14, top, 0.08)))
    if screen:
        pieces.append(Piece("tv_monitor", electronics.monitor(style).moved(0.0, top, 0.12)))
        pieces.append(Piece(None, electronics.keyboard().moved(0.0, top, 0.44)))
    else:
        pieces.append(_things(rng, style, -width / 4, top, 0.3))
    return Arrangement(tuple(pieces))


def place_kitchen(space: RoomSpace, rng: np.random.Generator, style: Style, units: int) -> None:
    """A worktop with sink and stove, cabinets above it where the wall allows, and a fridge."""
    for count in range(units, 2, -1):
        sink_at, stove_at = (0, count - 2) if chance(rng, 0.5) else (count - 1, 1)
        middle = [(slot + 0.5 - count / 2) * kitchen.UNIT_M for slot in (sink_at, stove_at)]
        base = [
            Piece("counter", kitchen.counter(style, count)),
            Piece("sink", kitchen.sink(style).moved(middle[0])),
            Piece("stove", kitchen.stove().moved(middle[1])),
            _things(rng, style, (middle[0] + middle[1]) / 2, kitchen.COUNTER_HEIGHT_M, 0.25),
        ]
        upper = Piece("cabinet", kitchen.wall_cabinets(style, count))
        if any(space.stand(Arrangement(pieces, 0.6), rng, "corner", 20) for pieces in ((*base, upper), tuple(base))):
            break
    space.stand(single("fridge", kitchen.fridge(rng, style), 0.5), rng, "corner", tries=20)
