"""What labels are called: the words of scanners and data sets, as ThinkNav's categories.

Goals have one name each (`GOAL_CATEGORIES`); everything else keeps its own name in lower case.
"""

_GOALS = {
    "sofa": ("couch", "sofa", "sofa set", "l-shaped sofa", "loveseat", "sectional sofa"),
    "tv_monitor": ("screen", "tv", "television", "tv screen", "monitor", "tv_monitor", "computer monitor"),
    "plant": ("plant", "potted plant", "plant pot", "flower pot", "indoor plant", "houseplant", "flowerpot"),
    "bed": ("bed", "bunk bed", "crib", "double bed", "single bed"),
    "chair": ("chair", "armchair", "office chair", "dining chair", "desk chair", "sofa chair", "rocking chair"),
    "toilet": ("toilet", "toilet seat"),
}
_NAMES = {word: category for category, words in _GOALS.items() for word in words}

# The building itself: no objects.
_STRUCTURE = {
    "wall",
    "wall face",
    "invisible wall face",
    "inner wall face",
    "floor",
    "ceiling",
    "global mesh",
    "unknown",
    "other",
    "other room face",
    "stairs",
    "staircase",
    "",
}


def category_of(label: str) -> str | None:
    """The category of a label in any case, with underscores or spaces; None for a part of the building."""
    words = " ".join(label.replace("_", " ").lower().split())
    if words in _STRUCTURE:
        return None
    return _NAMES.get(words, words.replace(" ", "_"))
