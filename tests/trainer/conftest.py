"""One small home with its episodes, shared by the tests of the trainer; and envs in it that think."""

from collections.abc import Callable
from typing import Any

import pytest

from thinknav_proto import PlannerError, SubgoalReply, SubgoalRequest
from thinknav_sim.vector_env import ObjectNavVectorEnv
from thinknav_trainer.asking import AskApart, AskTogether
from thinknav_trainer.config import TrainConfig, load_config
from thinknav_trainer.planner import MockTransport, PlannerClient
from thinknav_trainer.scenes import Homes, make_homes
from thinknav_trainer.thinking import ThinkingEnv

Handler = Callable[[SubgoalRequest], SubgoalReply | PlannerError | str]
MakeThinkingEnv = Callable[..., ThinkingEnv]


@pytest.fixture(scope="session")
def smoke() -> TrainConfig:
    return load_config("smoke")


@pytest.fixture(scope="session")
def homes(smoke: TrainConfig) -> Homes:
    return make_homes(smoke)


@pytest.fixture
def thinking_env(smoke: TrainConfig, homes: Homes) -> MakeThinkingEnv:
    """Makes a ThinkingEnv over `count` agents with a handler (None: no planner) that answers after so many seconds, and
    changes to its think config."""

    def make(
        handler: Handler | None, count: int = 2, max_steps: int = 20, latency: float = 0.0, **think: Any
    ) -> ThinkingEnv:
        if handler is None:
            think["strategy"] = "never"
        config = smoke.model_copy(
            update={
                "env": smoke.env.model_copy(update={"max_steps": max_steps}),
                "think": smoke.think.model_copy(update=think),
            }
        )
        env = ObjectNavVectorEnv(homes.scenes, homes.train, count, config.task, seed=3)
        planner = None if handler is None else PlannerClient(MockTransport(handler, latency))
        return ThinkingEnv(env, config.think, planner, AskApart if latency else AskTogether)

    return make
