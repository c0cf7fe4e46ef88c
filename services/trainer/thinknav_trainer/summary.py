"""What is told of an update, over all workers: episodes' means, thoughts. Knows nothing of where it is written."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from thinknav_trainer.collector import Collector
from thinknav_trainer.thinking import EpisodeEnd, ThinkingEnv


@dataclass(frozen=True)
class Share:
    """What one worker has to tell.

    transitions: of the update. episodes, thoughts: how many ended, and what became of them, since the run began.
    recent: the number of episodes that ended last, and `sums` of each measure over them.
    """

    transitions: int
    episodes: int
    thoughts: dict[str, int]
    recent: int
    sums: dict[str, float]


def share_of(collector: Collector, env: ThinkingEnv, transitions: int) -> Share:
    """A worker's own."""
    ends = collector.recent
    return Share(transitions, collector.episodes_ended, dict(vars(env.counts)), len(ends), episode_sums(ends))


def summarize(shares: Sequence[Share]) -> dict[str, float]:
    """Means over all workers' recent episodes, and the sums of their counts."""
    told = [share for share in shares if share.recent]
    recent = sum(share.recent for share in told)
    metrics = {name: sum(share.sums[name] for share in told) / recent for name in (told[0].sums if told else ())}
    for name in shares[0].thoughts:
        metrics[f"thoughts/{name}"] = float(sum(share.thoughts[name] for share in shares))
    metrics["episodes"] = sum(share.episodes for share in shares)
    return metrics


def episode_sums(episodes: Iterable[EpisodeEnd]) -> dict[str, float]:
    """Over episodes: measures by name, think_rate, reward terms as reward/<term>. Empty for none."""
    rows = [
        end.measures
        | {"think_rate": end.measures["thinks"] / end.measures["steps"]}
        | {f"reward/{name}": value for name, value in end.terms.items()}
        for end in episodes
    ]
    names = rows[0] if rows else {}
    return {
        ("episode_steps" if name == "steps" else name): float(np.sum([row[name] for row in rows])) for name in names
    }
