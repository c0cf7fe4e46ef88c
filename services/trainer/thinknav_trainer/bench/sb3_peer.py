"""Stable-Baselines3's recurrent PPO on our env, for the benchmark to time. Run by the Python of `make bench-peers`."""

from collections.abc import Callable
from typing import Any

import numpy as np
from gymnasium.spaces import Box, Dict, Discrete
from numpy.typing import NDArray
from sb3_contrib import RecurrentPPO
from stable_baselines3.common.torch_layers import BaseFeaturesExtractor
from stable_baselines3.common.vec_env import VecEnv
from torch import Tensor

from thinknav_sim.observations import Observations
from thinknav_trainer.bench.lock_step import LockStepEnv, Senses, orders, set_priors
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.planner import PlannerClient


class _Env(VecEnv):  # type: ignore[misc]
    """The env as Stable-Baselines3 wants it. Pictures are flat, lest it takes them for its own to transpose."""

    def __init__(self, env: LockStepEnv) -> None:
        self._env = env
        self._actions = np.zeros(env.num_envs, np.int64)
        space = Dict([(name, _flat_box(box)) for name, box in env.boxes.items()])
        super().__init__(env.num_envs, space, Discrete(env.num_actions))

    def reset(self) -> Observations:
        return _flat(self._env.reset())

    def step_async(self, actions: NDArray[np.int64]) -> None:
        self._actions = actions

    def step_wait(self) -> tuple[Observations, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        step = self._env.step(self._actions)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        for row, final in step.final_observations.items():
            infos[row]["terminal_observation"] = {name: value.reshape(-1) for name, value in final.items()}
            infos[row]["TimeLimit.truncated"] = bool(step.truncated[row] and not step.terminated[row])
        return _flat(step.observations), step.rewards, step.terminated | step.truncated, infos

    def close(self) -> None:
        """The process ends with it."""

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:  # noqa: ARG002
        return [None] * self.num_envs

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        raise NotImplementedError(attr_name)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        raise NotImplementedError(method_name)

    def env_is_wrapped(self, wrapper_class: type, indices: Any = None) -> list[bool]:  # noqa: ARG002
        return [False] * self.num_envs


class _Features(BaseFeaturesExtractor):  # type: ignore[misc]
    def __init__(self, space: Dict, config: TrainConfig, thought_size: int) -> None:
        senses = Senses(config, thought_size)
        super().__init__(space, senses.size)
        self.senses = senses

    def forward(self, observations: dict[str, Tensor]) -> Tensor:
        features: Tensor = self.senses(observations)
        return features


def _flat_box(box: Box) -> Box:
    return Box(box.low.reshape(-1), box.high.reshape(-1), dtype=np.dtype(box.dtype).type)


def _flat(observations: Observations) -> Observations:
    return {name: values.reshape(len(values), -1) for name, values in observations.items()}


def make_learner(config: TrainConfig, planner: PlannerClient | None) -> Callable[[], None]:
    """Recurrent PPO with the configuration's sizes: one LSTM for actor and critic, the heads right on it."""
    ppo = config.ppo
    env = LockStepEnv(config, planner)
    model = RecurrentPPO(
        "MultiInputLstmPolicy",
        _Env(env),
        n_steps=ppo.num_steps,
        batch_size=config.steps_per_update // ppo.minibatches,
        n_epochs=ppo.epochs,
        learning_rate=ppo.lr,
        gamma=ppo.gamma,
        gae_lambda=ppo.tau,
        clip_range=ppo.clip,
        clip_range_vf=ppo.clip if ppo.clip_value_loss else None,
        normalize_advantage=ppo.normalize_advantages,
        ent_coef=ppo.entropy_coef,
        vf_coef=ppo.value_coef,
        max_grad_norm=ppo.max_grad_norm,
        seed=config.seed,
        device="cpu",
        policy_kwargs={
            "features_extractor_class": _Features,
            "features_extractor_kwargs": {"config": config, "thought_size": env.thought_size},
            "normalize_images": False,
            "net_arch": [],
            "lstm_hidden_size": config.network.hidden_size,
            "n_lstm_layers": config.network.lstm_layers,
            "shared_lstm": True,
            "enable_critic_lstm": False,
            "optimizer_kwargs": {"eps": ppo.adam_eps},
        },
    )
    set_priors(model.policy.action_net, config)
    return lambda: model.learn(config.steps_per_update, log_interval=None, reset_num_timesteps=False)


def main() -> None:
    with orders() as told:
        learn = make_learner(told.config, told.planner)
        for _ in told.updates:
            learn()


if __name__ == "__main__":
    main()
