"""A planner that knows the map and where the agent stands, and says where the shortest path leads.

For experiments only: what a policy could learn from a perfect planner, from one that errs, and from one whose answers
mean nothing.

It reads the simulator, not frames, so that it needs the env that asks: `PrivilegedPlanner.asking`. Everything that is
trained or evaluated with it names it: the planner's identity is `privileged@…`.
"""

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import PlannerError, PlannerFailed, PlannerInfo, SubgoalReply, SubgoalRequest, Timings
from thinknav_sim.follower import ShortestPathFollower
from thinknav_sim.scene import GOAL_CATEGORIES
from thinknav_sim.task_config import Action
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.config import ConfigError, PrivilegedConfig
from thinknav_trainer.model_training.sentences import subgoal_sentence
from thinknav_trainer.planner.client import Answer, PlannerClient
from thinknav_trainer.planner.function_transport import FunctionTransport
from thinknav_trainer.planner.mock_transport import mock_info

NAME = "privileged"
DIRECTIONS = (Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT)


class PrivilegedPlanner(PlannerClient):
    """Embeds texts as any planner does; subgoals it has for the agents of an env alone."""

    def __init__(self, config: PrivilegedConfig = PrivilegedConfig(), seed: int = 0) -> None:
        """seed: of its errors, its wording, and of whose answer stands for whose when they are shuffled."""
        info = mock_info(NAME, _revision(config))
        super().__init__(FunctionTransport(info, _answer_frames, shipped_text_encoder().encode))
        self._config = config
        self._seed = seed

    def asking(self, env: ObjectNavVectorEnv) -> "AskPrivileged":
        """Ask for the agents of an env. Raises ConfigError where there are none to shuffle with."""
        if self._config.shuffled and env.num_envs < 2:
            raise ConfigError("planner.privileged.shuffled gives an agent another one's answers: it needs two envs")
        return AskPrivileged(env, self._config, self.info, self._seed)


class AskPrivileged:
    """An `Asking` that answers from where the agents stand when they ask, at once.

    What is drawn at random follows from the seed and from the request's number, or from the place: nothing is
    remembered, and a run that goes on draws as one that was never stopped.
    """

    def __init__(self, env: ObjectNavVectorEnv, config: PrivilegedConfig, info: PlannerInfo, seed: int) -> None:
        self._env = env
        self._config = config
        self._info = info
        self._seed = seed
        self._follower = ShortestPathFollower(env)
        self._embeddings: dict[str, NDArray[np.float32]] = {}
        self._answers: dict[int, Answer] = {}

    def ask(self, requests: Mapping[int, SubgoalRequest]) -> None:
        self._answers |= {env: self._reply(env, request) for env, request in requests.items()}

    def replies(self, must_wait: bool) -> dict[int, Answer]:  # noqa: ARG002 - nobody waits for it
        answers, self._answers = dict(sorted(self._answers.items())), {}
        return answers

    def _reply(self, env: int, request: SubgoalRequest) -> SubgoalReply:
        subgoal = self._subgoal(env, int(request.request_id))
        if subgoal not in self._embeddings:
            [self._embeddings[subgoal]] = shipped_text_encoder().encode([subgoal])
        return SubgoalReply(
            request_id=request.request_id,
            subgoal=subgoal,
            embedding=self._embeddings[subgoal],
            planner=self._info.identity,
            embedding_space=self._info.embedding_space,
            timings=Timings(queued=0.0, planned=0.0, embedded=0.0),
        )

    def _subgoal(self, asker: int, number: int) -> str:
        rng = np.random.default_rng((self._seed, number))
        env = asker
        if self._config.shuffled:
            env = (asker + int(rng.integers(1, self._env.num_envs))) % self._env.num_envs
        if self._config.errors_repeat:
            rng = np.random.default_rng((self._seed, *self._place(env)))
        directions = DIRECTIONS if self._config.says_stop else DIRECTIONS[1:]
        [direction] = self._follower.actions([env]).tolist()
        if rng.random() < self._config.error:
            direction = int(rng.choice(directions))
        elif direction not in directions:
            direction = Action.MOVE_FORWARD
        return subgoal_sentence(rng, self._goal(env), Action(direction), (), "room", None)

    def _goal(self, env: int) -> str:
        return str(self._env.episodes[self._env.episode_indices[env]].object_category)

    def _place(self, env: int) -> tuple[int, ...]:
        """Scene, goal, position to the centimetre and heading to the degree, as whole numbers that are not negative."""
        scene = int(self._env.world.table.scene[self._env.episode_indices[env]])
        x, y, z, heading = self._env.poses[env].tolist()
        where = [round(100 * value) for value in (x, y, z)]
        degrees = round(float(np.degrees(heading))) % 360
        return (scene, GOAL_CATEGORIES.index(self._goal(env)), *(value % 2**32 for value in where), degrees)


def _revision(config: PrivilegedConfig) -> str:
    """What distinguishes it from the perfect planner, in its identity."""
    knobs = {
        f"error-{config.error:g}": config.error > 0,
        "errors-repeat": config.errors_repeat,
        "never-stop": not config.says_stop,
        "shuffled": config.shuffled,
    }
    return ".".join(["shortest-path", *(knob for knob, turned in knobs.items() if turned)])


def _answer_frames(requests: Sequence[SubgoalRequest]) -> Sequence[SubgoalReply | PlannerError]:
    """Whoever has nothing but frames to show gets no answer."""
    return [PlannerFailed("the privileged planner answers agents of an env, and cannot read frames")] * len(requests)
