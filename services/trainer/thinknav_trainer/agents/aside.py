"""The planner-only agent for those who never think: it asks its planner aside, at no step, and only its moves are seen.

A policy that imitates it takes lessons in what the planner knows, and none in listening.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from thinknav_proto import SubgoalRequest
from thinknav_sim.observations import Observations
from thinknav_sim.scene import GOAL_CATEGORIES
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.agents.obedient import ObedientAgent
from thinknav_trainer.config import ThinkConfig
from thinknav_trainer.planner import PlannerClient, encode_frame
from thinknav_trainer.planner_frames import PlannerFrames
from thinknav_trainer.thoughts import Thought

_ASKS = np.array([Action.THINK])


class AsideAgent:
    """Does what `ObedientAgent` does but for its thinks, in N envs; the reply is there within the same step."""

    def __init__(self, env: ObjectNavVectorEnv, planner: PlannerClient, config: ThinkConfig) -> None:
        self._frames = PlannerFrames(env, config.frame_size)
        self._planner = planner
        self._config = config
        self._agents = [ObedientAgent(1, env.config) for _ in range(env.num_envs)]
        self._asked = 0

    def actions(self, observations: Observations, thoughts: Sequence[Thought]) -> NDArray[np.int64]:  # noqa: ARG002
        """Moves and stops; `thoughts` are of whoever thinks in the envs, and not for its ears."""
        seen = [_row(observations, env) for env in range(len(self._agents))]
        named = np.array([agent.actions(own, ())[0] for agent, own in zip(self._agents, seen, strict=True)], np.int64)
        asking = np.flatnonzero(named == Action.THINK)
        for env, thought in zip(asking.tolist(), self._thoughts(asking, observations), strict=True):
            self._agents[env].took(_ASKS)
            named[env] = self._agents[env].actions(seen[env], [thought])[0]
        return named

    def took(self, actions: NDArray[np.int64]) -> None:
        for env, agent in enumerate(self._agents):
            agent.took(actions[env : env + 1])

    def ended(self, done: NDArray[np.bool_]) -> None:
        for env, agent in enumerate(self._agents):
            agent.ended(done[env : env + 1])

    def _thoughts(self, envs: NDArray[np.integer], observations: Observations) -> list[Thought]:
        """What the planner says to these envs (n,), each as of the only env of its agent."""
        if not len(envs):
            return []
        self._frames.observe(np.arange(len(self._agents)), observations["rgb"])
        goals = [GOAL_CATEGORIES[category] for category in observations["objectgoal"][envs, 0]]
        requests = []
        for frame, goal in zip(self._frames.of(envs), goals, strict=True):
            self._asked += 1
            requests.append(
                SubgoalRequest(
                    request_id=str(self._asked),
                    goal=goal,
                    frame=encode_frame(frame, "raw"),
                    temperature=self._config.temperature,
                    deadline=self._config.deadline,
                )
            )
        return [Thought(0, goal, answer) for goal, answer in zip(goals, self._planner.ask(requests), strict=True)]


def _row(observations: Observations, env: int) -> Observations:
    """What one env sees, as a batch of one."""
    return {name: rows[env : env + 1] for name, rows in observations.items()}
