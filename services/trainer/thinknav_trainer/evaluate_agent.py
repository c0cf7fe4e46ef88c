"""Named agents in procedural homes: what `thinknav eval --agent` does, for programs that bring their own planner.

    with PlannerClient(FunctionTransport(info, answer, embed)) as planner:
        protocol, records = evaluate_agent("planner", parse_home_set("val:0-20"), 200, setting, planner)

Knows agents and homes; nothing of policies and checkpoints.
"""

from dataclasses import dataclass, field
from typing import Any

from thinknav_trainer.agents import AGENTS, NamedAgent, Obedience, obedient
from thinknav_trainer.config import ConfigError, TrainConfig
from thinknav_trainer.episode_sets import EpisodeSet, of_homes
from thinknav_trainer.evaluate import Clock, Conditions, EpisodeRecord, play
from thinknav_trainer.home_sets import HomeSet
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.planner import PlannerClient
from thinknav_trainer.planner.privileged import PrivilegedPlanner


@dataclass(frozen=True)
class Setting:
    """config: of which the task, the thinking, the number of envs and the seed count. obedience: of agent `planner`.

    clock: the seconds that SOT counts.
    """

    config: TrainConfig
    obedience: Obedience = field(default_factory=Obedience)
    clock: Clock = field(default_factory=Clock)


def named_agent(name: str, obedience: Obedience = Obedience()) -> NamedAgent:
    """The agent of a name. Raises ConfigError that lists the names."""
    if name not in AGENTS:
        raise ConfigError(f"there is no agent {name!r}; there are {', '.join(AGENTS)}")
    return obedient(obedience) if name == "planner" else AGENTS[name]


def evaluate_agent(
    name: str,
    homes: HomeSet,
    episodes: int,
    setting: Setting,
    planner: PlannerClient | None = None,
    interruption: Interruption | None = None,
) -> tuple[dict[str, Any], list[EpisodeRecord]]:
    """Play `episodes` episodes in procedural homes with a named agent: see `play_agent`."""
    named_agent(name)
    made = of_homes(homes, episodes, setting.config.env)
    return play_agent(name, made, setting, planner, interruption)


def play_agent(
    name: str,
    episodes: EpisodeSet,
    setting: Setting,
    planner: PlannerClient | None = None,
    interruption: Interruption | None = None,
) -> tuple[dict[str, Any], list[EpisodeRecord]]:
    """Play episodes with a named agent: the protocol of it, and the records.

    planner: for agents that think; others leave it alone.
    Raises ConfigError for an agent that is not there or lacks its planner.
    """
    agent = named_agent(name, setting.obedience)
    if agent.thinks and planner is None:
        raise ConfigError(f"agent {name!r} thinks, and needs a planner")
    config = setting.config
    think = config.think.model_copy(update={"strategy": "agent" if agent.thinks else "never"})
    conditions = Conditions(config.env, think, config.num_envs, config.seed, setting.clock, config.planner.control)
    asked = planner if agent.thinks else None
    made, scenes = episodes.episodes, episodes.scenes
    records = play(agent.make, conditions, scenes, made, asked, interruption or Interruption())
    protocol = {
        "agent": name,
        "privileged": agent.privileged or isinstance(asked, PrivilegedPlanner),
        "obedience": vars(setting.obedience) if name == "planner" else None,
        "split": episodes.name,
        "episodes": len(records),
        "clock": vars(setting.clock),
        "planner": None if asked is None else asked.info.identity,
        "control": config.planner.control,
        "config": config.model_copy(update={"think": think}).model_dump(mode="json"),
    }
    return protocol, records
