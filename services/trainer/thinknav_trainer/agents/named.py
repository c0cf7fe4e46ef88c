"""The agents that the command line knows by name."""

from collections.abc import Callable
from dataclasses import dataclass

from thinknav_sim.task_config import Action
from thinknav_trainer.agents.agent import Agent, Demonstrator
from thinknav_trainer.agents.aside import AsideAgent
from thinknav_trainer.agents.baselines import BumpWalker, PerfectStop, RandomAgent, ShortestPathAgent
from thinknav_trainer.agents.farmer import Farmer
from thinknav_trainer.agents.frontier import FrontierAgent
from thinknav_trainer.agents.obedient import Obedience, ObedientAgent
from thinknav_trainer.planner.embedded import EmbeddedPlanner
from thinknav_trainer.thinking import ThinkingEnv

# Makes an agent for all of an env's envs, from a seed.
MakeAgent = Callable[[ThinkingEnv, int], Agent]

MOVES = (Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)


@dataclass(frozen=True)
class NamedAgent:
    """description: one line. thinks: it needs a planner. privileged: it is told what no robot is."""

    description: str
    make: MakeAgent
    thinks: bool = False
    privileged: bool = False


def obedient(obedience: Obedience) -> NamedAgent:
    """The planner-only agent, which obeys in this manner."""
    return NamedAgent(
        "thinks, obeys, thinks again",
        lambda env, seed: ObedientAgent(env.num_envs, env.env.config, obedience),  # noqa: ARG005
        thinks=True,
    )


# Whom a policy may imitate: `warm_start.demonstrator`. None of them is privileged.
DEMONSTRATORS: dict[str, Callable[[ThinkingEnv, int], Demonstrator]] = {
    "planner": lambda env, seed: ObedientAgent(env.num_envs, env.env.config),  # noqa: ARG005
    "planner-aside": lambda env, seed: AsideAgent(env.env, EmbeddedPlanner(seed), env.config),
    "bump-walker": lambda env, seed: BumpWalker(env.num_envs, seed),
}

AGENTS: dict[str, NamedAgent] = {
    "planner": obedient(Obedience()),
    "random": NamedAgent(
        "any action, stop among them",
        lambda env, seed: RandomAgent(env.num_envs, (Action.STOP, *MOVES), seed),
    ),
    "random-perfect-stop": NamedAgent(
        "any move; told when to stop",
        lambda env, seed: PerfectStop(RandomAgent(env.num_envs, MOVES, seed), env.env),
        privileged=True,
    ),
    "bump-walker": NamedAgent(
        "straight on until something blocks; never stops",
        lambda env, seed: BumpWalker(env.num_envs, seed),
    ),
    "bump-walker-perfect-stop": NamedAgent(
        "the same; told when to stop",
        lambda env, seed: PerfectStop(BumpWalker(env.num_envs, seed), env.env),
        privileged=True,
    ),
    "farmer": NamedAgent(
        "thinks, obeys, undoes it; never stops",
        lambda env, seed: Farmer(env.num_envs),  # noqa: ARG005
        thinks=True,
    ),
    "frontier": NamedAgent(
        "explores by a map of its own; told which pixels show the goal",
        lambda env, seed: FrontierAgent(env.env),  # noqa: ARG005
        privileged=True,
    ),
    "shortest-path": NamedAgent(
        "knows the map and the goal",
        lambda env, seed: ShortestPathAgent(env.env),  # noqa: ARG005
        privileged=True,
    ),
}
