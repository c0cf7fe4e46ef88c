"""Takes the tables of experiments into docs/results.md: `python -m thinknav_trainer.experiments.results_page PAGE`.

Between `<!-- NAME: begin -->` and `<!-- NAME: end -->` goes what `results/NAME.md` beside the page says before its
protocol, so that no number there is written by hand.
"""

import re
import sys
from pathlib import Path

_PART = re.compile(r"(<!-- (?P<name>[\w-]+): begin -->\n).*?(<!-- (?P=name): end -->)", re.DOTALL)
_NOT_YET = "Nothing has been run yet."


def with_tables(page: str, folder: Path) -> str:
    """A page with the tables of the experiments that it has room for. folder: of `NAME.md`."""

    def filled(match: re.Match[str]) -> str:
        table = folder / f"{match['name']}.md"
        words = _taken(table.read_text(), folder.name) if table.exists() else _NOT_YET
        return f"{match[1]}\n{words}\n\n{match[3]}"

    return _PART.sub(filled, page)


def _taken(table: str, folder: str) -> str:
    """All of a table's page but its title and its protocol, its links as seen from a folder above."""
    text = table.partition("\n## Protocol")[0].partition("\n")[2].strip()
    text = re.sub(r"^## ", "### ", text, flags=re.MULTILINE)
    text = re.sub(r"\]\((?!\.\./|https?:)", f"]({folder}/", text)
    return text.replace("](../", "](")


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(with_tables(path.read_text(), path.parent / "results"))
