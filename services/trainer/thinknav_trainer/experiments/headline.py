"""The table on README's first page, out of the result files.

`python -m thinknav_trainer.experiments.headline README.md` puts it between `<!-- headline: begin -->` and
`<!-- headline: end -->`: success and SPL of what tells the story, in each experiment, none of it written by hand.
"""

import json
import re
import sys
from pathlib import Path
from typing import Any

from thinknav_trainer.experiments.markdown import number, table

EXPERIMENTS = {"single": "one home", "five": "five homes", "unseen": "homes never seen"}
ROWS = {
    "never": "PPO, the baseline",
    "agent-paper": "the paper's reward",
    "agent-cloned": "taught to listen, then PPO",
    "never-taught": "taught the same, but never thinks",
    "agent-cloned-kl-memory": "taught, held to it, a sensor that remembers obstacles",
    "planner-only": "the planner by itself, no training",
}
_PART = re.compile(r"(<!-- headline: begin -->\n).*?(<!-- headline: end -->)", re.DOTALL)


def with_headline(page: str, folder: Path) -> str:
    """A page with the table of today. folder: of the result files. Raises OSError for one that is not there."""
    results = [json.loads((folder / f"{name}.json").read_text()) for name in EXPERIMENTS]
    steps = [result["protocol"]["total_steps"]["never"] for result in results]
    titles = [f"{title}, {count:,} steps" for title, count in zip(EXPERIMENTS.values(), steps, strict=True)]
    rows = [[f"{words} (`{name}`)", *(_cell(result, name) for result in results)] for name, words in ROWS.items()]
    words = table(["success, SPL (seeds)", *titles], rows)
    return _PART.sub(lambda match: f"{match[1]}\n{words}\n\n{match[2]}", page)


def _cell(result: dict[str, Any], name: str) -> str:
    """An arm's mean over its seeds, or what an agent does that learns nothing."""
    if name in result["agents"]:
        values, seeds = result["agents"][name], ""
    elif name in result["arms"]:
        values = {measure: stats["mean"] for measure, stats in result["arms"][name].items()}
        seeds = f" ({len(result['protocol']['seeds'][name])})"
    else:
        return "–"
    return f"{number(values['success'])}, {number(values['spl'])}{seeds}"


if __name__ == "__main__":
    path = Path(sys.argv[1])
    path.write_text(with_headline(path.read_text(), path.parent / "docs" / "results"))
