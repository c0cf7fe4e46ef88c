"""Agents: a policy, the planner-only agent, and baselines, all driven through `Agent`."""

from thinknav_trainer.agents.agent import Agent, Demonstrator
from thinknav_trainer.agents.aside import AsideAgent
from thinknav_trainer.agents.baselines import BumpWalker, PerfectStop, RandomAgent, ShortestPathAgent
from thinknav_trainer.agents.farmer import Farmer
from thinknav_trainer.agents.frontier import FrontierAgent
from thinknav_trainer.agents.named import AGENTS, DEMONSTRATORS, MakeAgent, NamedAgent, obedient
from thinknav_trainer.agents.obedient import Obedience, ObedientAgent
from thinknav_trainer.agents.policy_agent import PolicyAgent

__all__ = [
    "AGENTS",
    "DEMONSTRATORS",
    "Agent",
    "AsideAgent",
    "BumpWalker",
    "Demonstrator",
    "Farmer",
    "FrontierAgent",
    "MakeAgent",
    "NamedAgent",
    "Obedience",
    "ObedientAgent",
    "PerfectStop",
    "PolicyAgent",
    "RandomAgent",
    "ShortestPathAgent",
    "obedient",
]
