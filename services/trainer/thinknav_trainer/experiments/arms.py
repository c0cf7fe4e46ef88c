"""The arms with which the paper is reproduced; docs/experiments.md has a line for each kind.

Headline arms have five seeds, and what tells lessons from thoughts, the others those of their experiment.
"""

from dataclasses import replace
from typing import TypedDict

from thinknav_trainer.experiments.experiment import AgentRow, Arm

# Of all arms: the planner in our own process, lock-step, which costs nothing then, and what makes the baseline learn.
COMMON = (
    "planner.url=embedded",
    "deterministic=true",
    *("env.success_reward=5", "env.slack_reward=-0.01", "ppo.lr=7e-4", "ppo.max_grad_norm=0.5"),
)
# What was imitated is not to be forgotten at once.
WARM_START_STEPS = 40_000
CLONED = (f"warm_start.steps={WARM_START_STEPS}", "ppo.entropy_coef=0.003", "ppo.lr=2.5e-4", "ppo.max_grad_norm=0.2")
FORCED = ("think.forced=0.3", "think.forced_until=0.5")

HEADLINE_SEEDS = 5
_NEVER = ("think.strategy=never",)
_RECENT = ("think.context=5", "think.temperature=0.5")
_BUDGET = ("think.budget=0.05", "think.budget_after=0.3", "think.dropout=0.2")
_FORESIGHT = ("warm_start.foresight_coef=2", "think.budget_after=0.1")
_BESIDE = ("learn_beside=true", "deterministic=false")
_MEMORY = ("policy.obstacle_memory=true",)
_PRIVILEGED = ("planner.url=privileged", *FORCED)

NEVER = Arm("never", _NEVER, HEADLINE_SEEDS)
NEVER_CLONED = Arm("never-cloned", (*_NEVER, "warm_start.demonstrator=bump-walker", *CLONED))
PAPER = Arm("agent-paper", ("think.reward=paper",), HEADLINE_SEEDS)
THINK_COST = Arm("agent-think-cost")
# The warm start alone: it ends where PPO would begin.
IMITATION = Arm("agent-imitation", (*CLONED, f"total_steps={WARM_START_STEPS}"))
CLONE = Arm("agent-cloned", CLONED, HEADLINE_SEEDS, over=IMITATION.name)
CLONE_BUDGET = Arm("agent-cloned-budget", (*CLONED, *_BUDGET))
FORESIGHT = Arm("agent-foresight", (*CLONED, *_BUDGET, *_FORESIGHT))
# The same lessons for who never thinks, and the warm start alone of that.
TAUGHT = Arm("never-taught", (*_NEVER, "warm_start.demonstrator=planner-aside", *CLONED), over=CLONE.name)
TAUGHT_IMITATION = Arm("never-imitation", (*TAUGHT.overrides, f"total_steps={WARM_START_STEPS}"))
KEPT = Arm("agent-cloned-kl", (*CLONED, "ppo.kl_coef=0.1"), over=IMITATION.name)
EVERY_N = Arm("every-n", ("think.strategy=every_n",))
PERFECT = Arm("privileged", _PRIVILEGED)


class Headline(TypedDict):
    """What the experiments that reproduce the paper have in common."""

    baseline: str
    best: str
    reproduces: bool


HEADLINE: Headline = {"baseline": NEVER.name, "best": CLONE.name, "reproduces": True}

ROWS = (
    # As the arms ask it; with its words drawn, so that who stands still does not hear the same again; with more views.
    AgentRow("planner-only", "planner"),
    AgentRow("planner-only-sampled", "planner", ("think.temperature=0.5",)),
    AgentRow("planner-only-context", "planner", _RECENT),
    AgentRow("bump-walker", "bump-walker"),
    AgentRow("shortest-path", "shortest-path"),
)


def with_memory(arm: Arm) -> Arm:
    """An arm with a sensor more, and compared with such."""
    over = None if arm.over is None else f"{arm.over}-memory"
    return Arm(f"{arm.name}-memory", (*arm.overrides, *_MEMORY), over=over)


def longer(arm: Arm, steps: int) -> Arm:
    """An arm with so many steps of training."""
    name = f"{steps // 1_000_000}m" if steps % 1_000_000 == 0 else f"{steps // 1000}k"
    return Arm(f"{arm.name}-{name}", (*arm.overrides, f"total_steps={steps}"))


def control_of(arm: Arm, control: str) -> Arm:
    """An arm with what it is told replaced, in training and evaluation, and compared with the arm as it is."""
    return Arm(f"{arm.name}-{control}", (*arm.overrides, f"planner.control={control}"), over=arm.name)


WITH_MEMORY = tuple(with_memory(arm) for arm in (NEVER, CLONE, IMITATION, KEPT))


def arms_of_single() -> tuple[Arm, ...]:
    """One home: everything."""
    schemes = ("capped", "task", "annealed", "progress_gated", "potential")
    return (
        NEVER,
        PAPER,
        CLONE,
        IMITATION,
        FORESIGHT,
        CLONE_BUDGET,
        longer(NEVER, 1_000_000),
        *(longer(arm, 480_000) for arm in (NEVER, TAUGHT, CLONE, FORESIGHT, EVERY_N)),
        replace(TAUGHT, seeds=HEADLINE_SEEDS),
        NEVER_CLONED,
        Arm("never-beside", (*_NEVER, *_BESIDE)),
        Arm("agent-cloned-beside", (*CLONED, *_BESIDE)),
        THINK_COST,
        *(Arm(f"agent-{scheme.replace('_', '-')}", (f"think.reward={scheme}",)) for scheme in schemes),
        Arm("agent-prior", ("policy.think_bias=1",)),
        Arm("agent-forced", FORCED),
        Arm("agent-cloned-forced", (*CLONED, *FORCED)),
        Arm("agent-cloned-paper", (*CLONED, *PAPER.overrides)),
        Arm("agent-cloned-capped", (*CLONED, "think.reward=capped")),
        Arm("agent-cloned-context", (*CLONED, *_RECENT)),
        EVERY_N,
        Arm("once", ("think.strategy=once",)),
        replace(control_of(CLONE, "deaf"), seeds=HEADLINE_SEEDS),
        *(control_of(CLONE, control) for control in ("zeros", "another", "constant")),
        control_of(PAPER, "random"),
        PERFECT,
        *(
            Arm(f"privileged-{share}", (*_PRIVILEGED, f"planner.privileged.error={share}"))
            for share in ("0.1", "0.3", "0.5")
        ),
    )


def arms_of_five() -> tuple[Arm, ...]:
    """Five homes: the headline arms, and what it takes to explain them."""
    return (
        NEVER,
        PAPER,
        CLONE,
        IMITATION,
        *WITH_MEMORY,
        FORESIGHT,
        *(longer(arm, 1_000_000) for arm in (NEVER, TAUGHT, CLONE, FORESIGHT)),
        TAUGHT,
        THINK_COST,
        control_of(CLONE, "deaf"),
        PERFECT,
    )


def arms_of_unseen() -> tuple[Arm, ...]:
    """Homes never seen: three seeds of each."""
    deaf = control_of(with_memory(IMITATION), "deaf")
    taught = (TAUGHT, with_memory(TAUGHT_IMITATION))
    arms = (NEVER, CLONE, IMITATION, *taught, *WITH_MEMORY, deaf, FORESIGHT, PAPER)
    return tuple(replace(arm, seeds=None) for arm in arms)
