"""Sentences about a frame: descriptions and subgoals, true ones and false ones, in many words.

A sentence says a few facts of a `Scenery`. A false one says the same kind of facts, one of them changed so that the
frame does not bear it out. Knows nothing of networks.
"""

import re
from dataclasses import dataclass, replace
from random import Random
from typing import Literal, get_args

from thinknav_trainer.model_training.scenery import MIRRORED, Reach, Scenery, Side, Sight, Way

Direction = Literal["left", "right", "forward", "stop"]
DIRECTIONS: tuple[Direction, ...] = get_args(Direction)

NAMES: dict[str, tuple[str, ...]] = {
    "chair": ("chair", "chair", "seat"),
    "bed": ("bed",),
    "plant": ("plant", "potted plant"),
    "toilet": ("toilet",),
    "tv_monitor": ("tv", "television", "screen", "tv monitor"),
    "sofa": ("sofa", "couch"),
    "bathtub": ("bathtub", "bath"),
    "cabinet": ("cabinet", "sideboard"),
    "counter": ("counter", "worktop"),
    "desk": ("desk",),
    "dresser": ("dresser", "chest of drawers"),
    "fridge": ("fridge", "refrigerator"),
    "lamp": ("lamp", "light"),
    "mirror": ("mirror",),
    "nightstand": ("nightstand", "bedside table"),
    "picture": ("picture", "painting"),
    "rug": ("rug", "carpet"),
    "shelf": ("shelf", "bookshelf"),
    "shower": ("shower",),
    "sink": ("sink", "basin"),
    "stove": ("stove", "cooker"),
    "table": ("table", "table"),
    "wardrobe": ("wardrobe", "closet"),
}
ROOMS: dict[str, tuple[str, ...]] = {
    "living room": ("living room", "lounge"),
    "hallway": ("hallway", "corridor", "hall"),
    "study": ("study", "office"),
    "bedroom": ("bedroom",),
    "bathroom": ("bathroom",),
    "kitchen": ("kitchen",),
    "dining room": ("dining room",),
    "studio": ("studio",),
}
SIDES: dict[Side, tuple[str, ...]] = {
    "left": ("on the left", "on the left", "to the left", "at the left", "on the left side", "left"),
    "ahead": ("ahead", "straight ahead", "in front", "in the middle", "in the centre", "directly ahead"),
    "right": ("on the right", "on the right", "to the right", "at the right", "on the right side", "right"),
}
REACHES: dict[Reach, tuple[str, ...]] = {
    "near": ("near", "close", "close by", "very close", "nearby"),
    "middle": ("", "", "", "a few metres away", "some way off"),
    "far": ("far", "far away", "in the distance", "far off"),
}
DOORWAYS = ("doorway", "doorway", "door", "opening", "exit", "open door", "passage", "way out")
MANY = ("two", "several", "some", "a few")
OPENINGS = ("", "", "", "there is", "i see", "a view of", "you can see", "in view:", "this is", "a picture of")
CLEAR = ("the way ahead is clear", "free way ahead", "nothing in the way", "open space ahead", "room to move forward")
BLOCKED = ("the way ahead is blocked", "something right in front", "blocked ahead", "no way forward", "obstacle ahead")
NOTHING = ("nothing but walls", "an empty view", "no furniture in view", "bare walls", "just a wall")

SUBGOALS: dict[Direction, tuple[str, ...]] = {
    "left": (
        "turn left toward the {}",
        "turn left to the {}",
        "turn left to face the {}",
        "go left toward the {}",
        "go left to the {}",
        "head left for the {}",
        "rotate left until the {} is ahead",
        "turn to your left, the {} is there",
        "the {} is on your left, turn left",
        "face left toward the {}",
        "look left, there is the {}",
        "veer left toward the {}",
        "turn left",
    ),
    "right": (
        "turn right toward the {}",
        "turn right to the {}",
        "turn right to face the {}",
        "go right toward the {}",
        "go right to the {}",
        "head right for the {}",
        "rotate right until the {} is ahead",
        "turn to your right, the {} is there",
        "the {} is on your right, turn right",
        "face right toward the {}",
        "look right, there is the {}",
        "veer right toward the {}",
        "turn right",
    ),
    "forward": (
        "move forward to the {}",
        "move forward toward the {}",
        "go forward to the {}",
        "go straight to the {}",
        "go straight ahead to the {}",
        "walk forward to the {}",
        "walk toward the {} ahead",
        "continue straight toward the {}",
        "keep going forward to the {}",
        "advance to the {}",
        "head straight for the {}",
        "step forward, the {} is in front",
        "move forward",
    ),
    "stop": (
        "stop, the {} is right ahead",
        "stop, the {} is right here",
        "stop here, the {} is in front of you",
        "stop at the {}",
        "stop, you have reached the {}",
        "you have arrived at the {}, stop",
        "halt, the {} is within reach",
        "stop, the {} is right in front",
        "stop in front of the {}",
        "you are at the {}, stop now",
        "stop beside the {}",
        "stay here, the {} is close enough",
        "stop",
    ),
}
THROUGH: dict[Direction, tuple[str, ...]] = {
    "left": ("turn left through the {}", "leave by the {} on the left", "take the {} on your left"),
    "right": ("turn right through the {}", "leave by the {} on the right", "take the {} on your right"),
    "forward": ("go through the {}", "move forward through the {}", "go straight through the {} ahead"),
    "stop": (),
}


@dataclass(frozen=True)
class Said:
    """A sentence, and the direction that it gives where it is a subgoal."""

    text: str
    direction: Direction | None = None


def words() -> list[str]:
    """Every word that sentences are made of, in alphabetical order."""
    tables = (NAMES, ROOMS, SIDES, REACHES, SUBGOALS, THROUGH)
    phrases: list[str] = [phrase for table in tables for choices in table.values() for phrase in choices]
    phrases += [*DOORWAYS, *MANY, *OPENINGS, *CLEAR, *BLOCKED, *NOTHING, "a an the and with to in find"]
    phrases += [plural(name) for names in NAMES.values() for name in names]
    return sorted({word for phrase in phrases for word in re.findall(r"[a-z]+", phrase)})


def describe(seen: Scenery, random: Random, most: int = 3) -> str:
    """A true sentence that says much: the room, up to `most` things and where they are, a way out."""
    return _description(_facts(seen, random, most), seen, random)


def describe_briefly(seen: Scenery, random: Random) -> str:
    """A true sentence that says little: a thing or two, the room, a way out, or whether one can go on."""
    choice = random.random()
    if choice < 0.15 and seen.room is not None:
        return _join(random.choice(OPENINGS), article(random.choice(ROOMS.get(seen.room, (seen.room,)))))
    if choice < 0.35 and seen.blocked is not None:
        return random.choice(BLOCKED if seen.blocked else CLEAR)
    if choice < 0.5 and seen.ways:
        return _join(random.choice(OPENINGS), _way(random.choice(seen.ways), random))
    if choice < 0.55 and seen.sights:
        return f"find {_name(random.choice(seen.sights[:4]), random)}"
    if choice < 0.65 and seen.sights:
        names = [_name(sight, random) for sight in seen.sights[:5]]
        random.shuffle(names)
        return _join(random.choice(OPENINGS), ", ".join(names))
    facts = _facts(seen, random, random.choice((1, 1, 2)), ways=False)
    if not facts:
        return random.choice(NOTHING)
    return _join(random.choice(OPENINGS), " and ".join(_fact(fact, random) for fact in facts))


def describe_falsely(seen: Scenery, random: Random) -> str:
    """What `describe` would say in short, but for one fact or for left and right, which the frame does not bear out.

    A frame without anything to be wrong about is said to hold what it does not.
    """
    facts = _facts(seen, random, 2)
    places = {*map(_place, seen.sights), *map(_place, seen.ways)}
    flipped = [_flipped(fact) for fact in facts]
    if random.random() < 0.6 and any(_place(fact) not in places for fact in flipped):
        return _description(flipped, seen, random)
    absent = [name for name in NAMES if all(sight.category != name for sight in seen.sights)]
    candidates: list[tuple[int, Sight | Way]] = []
    for index, fact in enumerate(facts):
        moved: list[Sight | Way] = [replace(fact, side=side) for side in get_args(Side)]
        candidates += [(index, other) for other in moved if _place(other) not in places]
        if isinstance(fact, Sight):
            candidates.append((index, replace(fact, category=random.choice(absent))))
    if not candidates:
        wrong = Sight(random.choice(absent), random.choice(get_args(Side)), "near")
        return _description([wrong], seen, random)
    index, wrong_fact = random.choice(candidates)
    return _description([*facts[:index], wrong_fact, *facts[index + 1 :]], seen, random)


def subgoal(seen: Scenery, random: Random) -> Said:
    """A subgoal that the frame bears out: toward a thing or a way in view, or to turn where nothing is."""
    targets: list[Sight | Way] = [*seen.sights[:5], *seen.ways]
    if not targets:
        direction: Direction = random.choice(("left", "right"))
        return Said(f"turn {direction}", direction)
    target = random.choice(targets)
    return _subgoal(target, direction_to(target), random)


def subgoal_falsely(seen: Scenery, random: Random) -> Said:
    """A subgoal toward something in view, in a direction where the frame shows none of it."""
    targets: list[Sight | Way] = [*seen.sights[:5], *seen.ways]
    if not targets:
        return Said(random.choice(SUBGOALS["stop"]).format(random.choice(NAMES[random.choice(list(NAMES))])), "stop")
    target = random.choice(targets)
    kind = target.category if isinstance(target, Sight) else None
    true = {direction_to(other) for other in targets if (other.category if isinstance(other, Sight) else None) == kind}
    false = [direction for direction in DIRECTIONS if direction not in true] or list(DIRECTIONS)
    return _subgoal(target, random.choice(false), random)


def direction_to(target: Sight | Way) -> Direction:
    """Where to go to come to what is seen; `stop` when it is right there."""
    if target.side != "ahead":
        return target.side
    return "stop" if isinstance(target, Sight) and target.reach == "near" else "forward"


def article(noun: str) -> str:
    """A noun with its indefinite article."""
    return f"an {noun}" if noun[0] in "aeiou" else f"a {noun}"


def plural(noun: str) -> str:
    """More than one of a noun."""
    if noun == "chest of drawers":
        return "chests of drawers"
    if noun.endswith("shelf"):
        return noun[:-1] + "ves"
    return noun + ("es" if noun.endswith(("s", "ch", "sh")) else "s")


def _facts(seen: Scenery, random: Random, most: int, ways: bool = True) -> list[Sight | Way]:
    """The most striking sights, now and then without one of them, and the first way out."""
    sights = list(seen.sights[: most + 1])
    if len(sights) > most or (len(sights) > 2 and random.random() < 0.3):
        sights.pop(random.randrange(len(sights)))
    if most == 1 and len(seen.sights) > 1:
        sights = [random.choice(seen.sights[:4])]
    facts: list[Sight | Way] = list(sights)
    if random.random() < 0.3:
        random.shuffle(facts)
    if ways and seen.ways and random.random() < 0.8:
        facts.append(seen.ways[0])
    return facts


def _flipped(fact: Sight | Way) -> Sight | Way:
    return replace(fact, side=MIRRORED[fact.side])


def _place(fact: Sight | Way) -> tuple[str, Side]:
    return (fact.category if isinstance(fact, Sight) else "a way", fact.side)


def _description(facts: list[Sight | Way], seen: Scenery, random: Random) -> str:
    said = [_fact(fact, random) for fact in facts] or [random.choice(NOTHING)]
    last = random.choice((", ", " and ", ", and ", "; "))
    listed = said[0] if len(said) == 1 else ", ".join(said[:-1]) + last + said[-1]
    if seen.blocked is not None and random.random() < 0.25:
        listed += ", " + random.choice(BLOCKED if seen.blocked else CLEAR)
    if seen.room is None or random.random() < 0.25:
        return _join(random.choice(OPENINGS), listed)
    room = random.choice(ROOMS.get(seen.room, (seen.room,)))
    form = random.choice(("{room} with {things}", "{room}: {things}", "{things}, in {room}", "in {room}, {things}"))
    return form.format(room=article(room), things=listed)


def _fact(fact: Sight | Way, random: Random) -> str:
    return _way(fact, random) if isinstance(fact, Way) else _sight(fact, random)


def _sight(sight: Sight, random: Random) -> str:
    reach = random.choice(REACHES[sight.reach]) if random.random() < 0.7 else ""
    side = random.choice(SIDES[sight.side])
    name = _name(sight, random)
    return _join(*random.choice(((name, side, reach), (name, reach, side), (side, name, reach))))


def _way(way: Way, random: Random) -> str:
    to = f"to the {random.choice(ROOMS.get(way.room, (way.room,)))}" if random.random() < 0.4 else ""
    return _join(article(random.choice(DOORWAYS)), to, random.choice(SIDES[way.side]))


def _name(sight: Sight, random: Random) -> str:
    noun = random.choice(NAMES.get(sight.category, (sight.category.replace("_", " "),)))
    if sight.many:
        return f"{random.choice(MANY)} {plural(noun)}"
    return article(noun)


def _subgoal(target: Sight | Way, direction: Direction, random: Random) -> Said:
    if isinstance(target, Sight):
        noun = random.choice(NAMES.get(target.category, (target.category.replace("_", " "),)))
        return Said(random.choice(SUBGOALS[direction]).format(noun), direction)
    return Said(random.choice(SUBGOALS[direction] + THROUGH[direction]).format(random.choice(DOORWAYS)), direction)


def _join(*parts: str) -> str:
    return " ".join(part for part in parts if part)
