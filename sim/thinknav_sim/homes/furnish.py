"""What stands in each room: the recipes by room function.

Recipes only ask `RoomSpace` for places; what does not fit is left out.
"""

from collections.abc import Callable

import numpy as np

from thinknav_sim.homes import sets
from thinknav_sim.homes.draw import between, chance, pick
from thinknav_sim.homes.furniture import bathroom, decor, plants, seats, storage
from thinknav_sim.homes.materials import Style
from thinknav_sim.homes.placement import Arrangement, Piece, RoomSpace, single
from thinknav_sim.homes.walls import ROOM_HEIGHT_M

Recipe = Callable[[RoomSpace, np.random.Generator, Style], None]


def furnish(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    """Fill one room by its function."""
    RECIPES[space.function](space, rng, style)
    x0, z0, x1, z1 = space.interior
    lamp = decor.ceiling_lamp(rng, style, ROOM_HEIGHT_M)
    space.lay(Piece("lamp", lamp), (x0 + x1) / 2, (z0 + z1) / 2)


def living_room(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    sets.place_sofa_and_tv(space, rng, style)
    _stand_plant(space, rng, style)
    space.stand(single("shelf", storage.bookshelf(rng, style, between(rng, 0.7, 1.1)), 0.4), rng)
    if space.area > 19 and chance(rng, 0.6):
        space.float_freely(sets.dining_set(rng, style, 4), rng)
    space.stand(sets.reading_corner(rng, style), rng, "corner")
    if space.area > 17 and chance(rng, 0.35):
        space.stand(sets.desk_set(rng, style, screen=chance(rng, 0.3)), rng)
    if chance(rng, 0.6):
        space.stand(sets.sideboard_with_things(rng, style), rng)
    if chance(rng, 0.6):
        _stand_plant(space, rng, style)
    _pictures(space, rng, style, 3)
    _floor_clutter(space, rng, style, 1)


def studio(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    sets.place_sofa_and_tv(space, rng, style)
    sets.place_bed(space, rng, style, 1.4)
    sets.place_kitchen(space, rng, style, 3)
    space.stand(single("wardrobe", storage.wardrobe(rng, style, 1.2), 0.5), rng, "corner")
    sets.place_dining(space, rng, style, 2)
    _stand_plant(space, rng, style)
    space.stand(single("lamp", decor.floor_lamp(rng, style)), rng, "corner")
    _pictures(space, rng, style, 3)


def kitchen_room(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    sets.place_kitchen(space, rng, style, 5)
    sets.place_dining(space, rng, style, 4 if space.area > 10.5 else 2)
    if chance(rng, 0.4):
        _stand_plant(space, rng, style)
    _pictures(space, rng, style, 1)
    _floor_clutter(space, rng, style, 1)


def dining_room(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    if not space.float_freely(sets.dining_set(rng, style, 6 if space.area > 12.5 else 4), rng):
        sets.place_dining(space, rng, style, 4)
    space.stand(sets.sideboard_with_things(rng, style), rng, "middle")
    _stand_plant(space, rng, style)
    if chance(rng, 0.5):
        space.stand(single("shelf", storage.bookshelf(rng, style, 0.8), 0.4), rng)
    _pictures(space, rng, style, 3)


def bedroom(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    width = pick(rng, (1.4, 1.6, 1.6)) if space.area > 10.5 else pick(rng, (0.9, 1.2))
    sets.place_bed(space, rng, style, width)
    space.stand(single("wardrobe", storage.wardrobe(rng, style, pick(rng, (1.2, 1.6))), 0.5), rng, "corner")
    if chance(rng, 0.35):
        sets.place_tv_on_dresser(space, rng, style)
    elif chance(rng, 0.6):
        space.stand(single("dresser", storage.dresser(rng, style, between(rng, 0.9, 1.2), 0.85), 0.4), rng)
    if space.area > 12 and chance(rng, 0.5):
        space.stand(sets.desk_set(rng, style, screen=chance(rng, 0.4)), rng)
    elif chance(rng, 0.6):
        chair = seats.dining_chair(rng, style) if chance(rng, 0.5) else seats.armchair(rng, style)
        space.stand(single("chair", chair, 0.3), rng, "corner")
    if chance(rng, 0.6):
        _stand_plant(space, rng, style)
    _pictures(space, rng, style, 2)
    _floor_clutter(space, rng, style, 1)


def bathroom_room(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    tub = single("bathtub", bathroom.bathtub(rng, between(rng, 1.5, 1.65)))
    if not (chance(rng, 0.6) and space.stand(tub, rng, "corner")):
        space.stand(single("shower", bathroom.shower(rng, style, 0.85)), rng, "corner")
    space.stand(single("toilet", bathroom.toilet(rng, style), 0.45), rng, tries=24)
    width = between(rng, 0.6, 0.9)
    basin = Piece("sink", bathroom.washstand(rng, style, width))
    glass = Piece("mirror", bathroom.mirror(width - 0.1))
    if not space.stand(Arrangement((basin, glass), 0.5), rng, tries=20):
        space.stand(Arrangement((basin,), 0.4), rng, tries=20)
    space.hang(Piece(None, bathroom.towel_rail(rng, style)), rng)
    space.stand(single(None, decor.floor_things(rng, style)), rng, "corner")
    if chance(rng, 0.3):
        _stand_plant(space, rng, style)
    x0, z0, x1, z1 = space.interior
    space.lay(Piece("rug", decor.rug(rng, style, 0.8, 0.55)), (x0 + x1) / 2, (z0 + z1) / 2, int(rng.integers(2)))


def study(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    space.stand(sets.desk_set(rng, style, screen=True), rng)
    for _ in range(2):
        space.stand(single("shelf", storage.bookshelf(rng, style, between(rng, 0.8, 1.1)), 0.4), rng)
    _stand_plant(space, rng, style)
    seat = seats.sofa(rng, style, 2) if chance(rng, 0.4) else seats.armchair(rng, style)
    wide = float(seat.high[0] - seat.low[0]) > 1.0
    space.stand(single("sofa" if wide else "chair", seat, 0.35), rng)
    space.stand(single("lamp", decor.floor_lamp(rng, style)), rng, "corner")
    if chance(rng, 0.6):
        _rug(space, rng, style, 1.6, 1.1)
    _pictures(space, rng, style, 2)
    space.hang(Piece("shelf", decor.wall_shelf(rng, style, 0.9)), rng)


def hallway(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    space.stand(single("cabinet", storage.coat_rack(rng, style)), rng, tries=24)
    if chance(rng, 0.6):
        _stand_plant(space, rng, style)
    if chance(rng, 0.5):
        cabinet = storage.sideboard(rng, style, 0.8, 0.8, depth=0.3)
        space.stand(single("cabinet", cabinet), rng)
    _pictures(space, rng, style, 4)
    x0, z0, x1, z1 = space.interior
    along = 0 if x1 - x0 > z1 - z0 else 1
    length = min(max(x1 - x0, z1 - z0) * 0.6, 2.6)
    space.lay(Piece("rug", decor.rug(rng, style, length, 0.7)), (x0 + x1) / 2, (z0 + z1) / 2, along)


RECIPES: dict[str, Recipe] = {
    "living room": living_room,
    "studio": studio,
    "kitchen": kitchen_room,
    "dining room": dining_room,
    "bedroom": bedroom,
    "bathroom": bathroom_room,
    "study": study,
    "hallway": hallway,
}


def _stand_plant(space: RoomSpace, rng: np.random.Generator, style: Style) -> None:
    space.stand(single("plant", plants.floor_plant(rng, style)), rng, "corner")


def _pictures(space: RoomSpace, rng: np.random.Generator, style: Style, count: int) -> None:
    for _ in range(count):
        size = between(rng, 0.4, 0.9), between(rng, 0.4, 0.65)
        space.hang(Piece("picture", decor.picture(rng, style, *size)), rng)


def _floor_clutter(space: RoomSpace, rng: np.random.Generator, style: Style, count: int) -> None:
    for _ in range(count):
        if chance(rng, 0.7):
            space.stand(single(None, decor.floor_things(rng, style)), rng, "corner")


def _rug(space: RoomSpace, rng: np.random.Generator, style: Style, width: float, depth: float) -> None:
    x0, z0, x1, z1 = space.interior
    space.lay(Piece("rug", decor.rug(rng, style, width, depth)), (x0 + x1) / 2, (z0 + z1) / 2, int(rng.integers(2)))
