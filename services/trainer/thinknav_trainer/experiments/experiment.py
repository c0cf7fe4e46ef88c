"""What an experiment is: a question, and the arms that answer it. A new one is an entry in EXPERIMENTS.

Knows configurations; nothing of how they are run.
"""

from collections.abc import Sequence
from dataclasses import dataclass

from thinknav_trainer.config import ConfigError, TrainConfig, load_config


@dataclass(frozen=True)
class Arm:
    """One way of doing it. overrides: over the experiment's, as `--set` takes them."""

    name: str
    overrides: tuple[str, ...] = ()


@dataclass(frozen=True)
class Experiment:
    """All arms share homes, episodes and steps unless they say otherwise.

    overrides: over the preset, in every arm. seeds: how many, unless the user wants another number.
    """

    name: str
    question: str
    preset: str
    arms: tuple[Arm, ...]
    overrides: tuple[str, ...] = ()
    seeds: int = 3

    def config(self, arm: Arm, seed: int, overrides: Sequence[str] = (), smoke: bool = False) -> TrainConfig:
        """The configuration of a run. smoke: everything as small as it goes. Raises ConfigError."""
        layers = (*self.overrides, *arm.overrides, *overrides, f"seed={seed}")
        return load_config("smoke" if smoke else self.preset, None, layers)


FIRST_LIGHT = Experiment(
    name="first-light",
    question="Does the learner learn to use what it is told? The planner is privileged: it says where the shortest "
    "path leads. In the control each agent is told what another one should do.",
    preset="first-light",
    overrides=("planner.url=privileged",),
    arms=(Arm("privileged"), Arm("shuffled", ("planner.privileged.shuffled=true",))),
)

_CLONED = ("warm_start.steps=40000", "ppo.entropy_coef=0.003")  # what was imitated is not to be forgotten at once
WARM_START = Experiment(
    name="warm-start",
    question="How does a policy come to use a planner that errs? All steps count, those of demonstrations among them.",
    preset="cpu",
    overrides=("scenes.episodes=1000",),
    arms=(
        Arm("never", ("think.strategy=never",)),
        Arm("never-cloned", ("think.strategy=never", "warm_start.demonstrator=bump-walker", *_CLONED)),
        Arm("scratch"),
        Arm("prior", ("policy.think_bias=1",)),
        Arm("forced", ("think.forced=0.3", "think.forced_until=0.5")),
        Arm("cloned", _CLONED),
        Arm("cloned-forced", (*_CLONED, "think.forced=0.3", "think.forced_until=0.5")),
    ),
)

EXPERIMENTS: dict[str, Experiment] = {experiment.name: experiment for experiment in (FIRST_LIGHT, WARM_START)}


def named_experiment(name: str) -> Experiment:
    """The experiment of a name. Raises ConfigError that lists them."""
    if name not in EXPERIMENTS:
        raise ConfigError(f"there is no experiment {name!r}; there are {', '.join(EXPERIMENTS)}")
    return EXPERIMENTS[name]
