"""What an experiment is: a question, and the arms that answer it.

Knows configurations; nothing of how they are run. `named` has those that there are.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

from thinknav_trainer.config import ConfigError, TrainConfig, change_config, load_config

# As small as it goes, whatever an arm wants.
_SMOKE = ("total_steps=128", "checkpoint_every=128", "scenes.homes=1", "scenes.chosen=[]", "scenes.episodes=30")
_SMOKE_WARM_START = "warm_start.steps=64"


@dataclass(frozen=True)
class Arm:
    """One way of doing it. overrides: over the experiment's, as `--set` takes them. seeds: none: the experiment's.

    over: an arm, beside the baseline, that it is compared with.
    """

    name: str
    overrides: tuple[str, ...] = ()
    seeds: int | None = None
    over: str | None = None


@dataclass(frozen=True)
class AgentRow:
    """An agent without training, on the episodes that the arms are evaluated on. overrides: as of an arm."""

    name: str
    agent: str
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class EvaluatedIn:
    """Other episodes than a run's held-out ones. homes: such as "val:0-32"; episodes: in all of them together."""

    homes: str
    episodes: int


@dataclass(frozen=True)
class Form:
    """A shorter form of an experiment: some of its arms, fewer seeds, overrides over those of all arms.

    warm_start: steps of a warm start, in arms that have one. evaluated_in: in the place of the experiment's, if any.
    """

    arms: tuple[str, ...]
    seeds: int
    overrides: tuple[str, ...] = ()
    warm_start: int = 0
    evaluated_in: EvaluatedIn | None = None


@dataclass(frozen=True)
class Experiment:
    """All arms share homes, episodes and steps unless they say otherwise.

    overrides: over the preset, in every arm. seeds: how many, unless an arm or the user wants another number.
    rows: agents without training, to compare with. evaluated_in: none: each run's held-out episodes.
    baseline, best: arms; ratios of `best` and of `agent-paper` over the baseline are told where there are any.
    drawn: arms whose learning curves are drawn, the first eight of all unless said. quick: the form of minutes.
    smoke: arms of the form of seconds, all unless said. reproduces: the paper, by a command of its own.
    changed: what the user sets over the overrides of every arm.
    """

    name: str
    question: str
    preset: str
    arms: tuple[Arm, ...]
    overrides: tuple[str, ...] = ()
    seeds: int = 3
    rows: tuple[AgentRow, ...] = ()
    evaluated_in: EvaluatedIn | None = None
    baseline: str | None = None
    best: str | None = None
    drawn: tuple[str, ...] = ()
    quick: Form | None = None
    smoke: tuple[str, ...] = ()
    reproduces: bool = False
    form: str = ""
    changed: tuple[str, ...] = ()

    @property
    def full_name(self) -> str:
        """With its form: "single-quick"."""
        return f"{self.name}-{self.form}" if self.form else self.name

    def config(self, arm: Arm | AgentRow, seed: int) -> TrainConfig:
        """The configuration of a run. Raises ConfigError."""
        layers = (*self.overrides, *arm.overrides)
        if self.form != "smoke":
            return load_config(self.preset, None, (*layers, *self.changed, f"seed={seed}"))
        config = load_config("smoke", None, (*layers, *_SMOKE))
        shorter = (_SMOKE_WARM_START,) if config.warm_start.steps else ()
        return change_config(config, overrides=(*shorter, *self.changed, f"seed={seed}"))

    def seeds_of(self, arm: Arm, seeds: int | None = None) -> int:
        """How many seeds an arm has. seeds: what the user wants."""
        return seeds or arm.seeds or self.seeds

    def with_arms(self, names: Sequence[str]) -> "Experiment":
        """With some of its arms alone, in its own order. Raises ConfigError for a name that it does not have."""
        known = [arm.name for arm in self.arms]
        for name in names:
            if name not in known:
                raise ConfigError(f"experiment {self.name} has no arm {name!r}; it has {', '.join(known)}")
        return replace(self, arms=tuple(arm for arm in self.arms if arm.name in names))

    def quickened(self) -> "Experiment":
        """The form of minutes. Raises ConfigError where there is none."""
        if self.quick is None:
            raise ConfigError(f"experiment {self.name} has no quick form")
        quick, short = self.quick, self.with_arms(self.quick.arms)

        def shorter(arm: Arm) -> Arm:
            warm = self.config(arm, 0).warm_start.steps > 0
            start = (f"warm_start.steps={quick.warm_start}",) if warm else ()
            return replace(arm, overrides=(*arm.overrides, *quick.overrides, *start), seeds=None)

        return replace(
            short,
            arms=tuple(shorter(arm) for arm in short.arms),
            rows=tuple(replace(row, overrides=(*row.overrides, *quick.overrides)) for row in self.rows),
            seeds=quick.seeds,
            evaluated_in=quick.evaluated_in or self.evaluated_in,
            form="quick",
        )

    def smoked(self) -> "Experiment":
        """The form of seconds: everything runs, nothing is learnt."""
        short = self.with_arms(self.smoke) if self.smoke else self
        arms = tuple(replace(arm, seeds=None) for arm in short.arms)
        evaluated_in = None if self.evaluated_in is None else EvaluatedIn("val:0-1", 4)
        return replace(short, arms=arms, seeds=1, evaluated_in=evaluated_in, form="smoke")
