"""The experiments that there are. A new one is an entry in EXPERIMENTS; docs/experiments.md says what each is for."""

from thinknav_trainer.config import ConfigError
from thinknav_trainer.experiments.arms import (
    COMMON,
    HEADLINE,
    ROWS,
    arms_of_five,
    arms_of_single,
    arms_of_unseen,
)
from thinknav_trainer.experiments.experiment import Arm, EvaluatedIn, Experiment, Form

FIRST_LIGHT = Experiment(
    name="first-light",
    question="Does the learner learn to use what it is told? The planner is privileged: it says where the shortest "
    "path leads. In the control each agent is told what another one should do.",
    preset="first-light",
    overrides=("planner.url=privileged",),
    arms=(Arm("privileged"), Arm("shuffled", ("planner.privileged.shuffled=true",))),
)

_STORY = ("never", "agent-paper", "agent-cloned")  # arms of the shorter forms
_DRAWN = (
    "never",
    "agent-paper",
    "agent-cloned",
    "agent-foresight",
    "agent-think-cost",
    "never-taught",
    "privileged",
)

# `thinknav episodes make --homes 5 --among 20` takes these, the simplest first.
SIMPLEST = (11, 9, 14, 1, 19)
SINGLE = Experiment(
    name="single",
    question="The simplest of twenty homes, as the paper's figure 5: does thinking help, by which reward scheme, and "
    "would it also help if the thoughts were others?",
    preset="cpu",
    overrides=("total_steps=160000", f"scenes.chosen=[{SIMPLEST[0]}]", "scenes.episodes=1000", *COMMON),
    arms=arms_of_single(),
    rows=ROWS,
    drawn=_DRAWN,
    quick=Form(_STORY, 2, ("total_steps=40000", "scenes.episodes=300"), warm_start=15_000),
    smoke=_STORY,
    **HEADLINE,
)

FIVE = Experiment(
    name="five",
    question="The five simplest of twenty homes, as the paper's figure 6: does what helped in one home help in five?",
    preset="cpu",
    overrides=("total_steps=300000", f"scenes.chosen={list(SIMPLEST)}", "scenes.episodes=400", *COMMON),
    arms=arms_of_five(),
    rows=ROWS,
    drawn=_DRAWN,
    quick=Form(
        _STORY,
        1,
        ("total_steps=60000", f"scenes.chosen={list(SIMPLEST[:2])}", "scenes.episodes=200"),
        warm_start=20_000,
    ),
    smoke=_STORY,
    **HEADLINE,
)

UNSEEN = Experiment(
    name="unseen",
    question="Trained in 32 homes, evaluated in 32 others that nobody was trained in, the planner included: does it "
    "help where nothing can be known by heart?",
    preset="cpu",
    overrides=("total_steps=300000", "scenes.homes=32", "scenes.episodes=100", *COMMON),
    arms=arms_of_unseen(),
    rows=ROWS,
    evaluated_in=EvaluatedIn("val:0-32", 192),
    drawn=_DRAWN,
    quick=Form(
        _STORY,
        1,
        ("total_steps=60000", "scenes.homes=8"),
        warm_start=20_000,
        evaluated_in=EvaluatedIn("val:0-8", 48),
    ),
    smoke=_STORY,
    **HEADLINE,
)

EXPERIMENTS: dict[str, Experiment] = {experiment.name: experiment for experiment in (FIRST_LIGHT, SINGLE, FIVE, UNSEEN)}
REPRODUCED = tuple(name for name, experiment in EXPERIMENTS.items() if experiment.reproduces)


def named_experiment(name: str) -> Experiment:
    """The experiment of a name. Raises ConfigError that lists them."""
    if name not in EXPERIMENTS:
        raise ConfigError(f"there is no experiment {name!r}; there are {', '.join(EXPERIMENTS)}")
    return EXPERIMENTS[name]
