"""Every configuration key with its default and meaning, as docs/training.md shows them.

python -m thinknav_trainer.config_table docs/training.md    # write it there anew
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from thinknav_trainer.config import TrainConfig

BEGIN, END = "<!-- configuration: begin -->\n", "<!-- configuration: end -->\n"


def config_table() -> str:
    """A table in Markdown, a row for each key."""
    rows = [f"| `{key}` | {default} | {meaning} |" for key, default, meaning in _keys(TrainConfig())]
    return "\n".join(["| key | default | |", "|---|---|---|", *rows, ""])


def with_table(page: str) -> str:
    """The page with the table of today between its marks. Raises ValueError for a page without them."""
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError(f"the page has no lines {BEGIN.strip()} and {END.strip()}")
    return before + begin + "\n" + config_table() + "\n" + end + after


def _keys(section: BaseModel, prefix: str = "") -> Iterator[tuple[str, str, str]]:
    for name, info in type(section).model_fields.items():
        value: Any = getattr(section, name)
        if isinstance(value, BaseModel):
            yield from _keys(value, f"{prefix}{name}.")
        else:
            shown = "none" if value is None else f"`{json.dumps(value)}`"
            yield prefix + name, shown, (info.description or "").replace("|", "\\|")


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(with_table(path.read_text()))
