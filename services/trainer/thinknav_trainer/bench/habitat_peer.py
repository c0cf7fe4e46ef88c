"""Habitat-Baselines' PPO trainer on our env, for the benchmark to time. Run by the Python of `make bench-peers` alone.

Its own `train` runs as it is; it is given our env in the place of its processes, and the layers that our policy has
before the LSTM.
"""

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gym.spaces
import numpy as np
import torch
from omegaconf import OmegaConf
from torch import Tensor

from thinknav_sim.observations import Observations
from thinknav_trainer.bench import habitat_without_sim
from thinknav_trainer.bench.lock_step import LockStepEnv, Orders, Senses, orders, set_priors
from thinknav_trainer.config import TrainConfig
from thinknav_trainer.thinking import Step

habitat_without_sim.put_in_place()

from habitat_baselines.common.baseline_registry import baseline_registry  # noqa: E402
from habitat_baselines.common.env_spec import EnvironmentSpec  # noqa: E402
from habitat_baselines.config.default_structured_configs import HabitatBaselinesRLConfig, PolicyConfig  # noqa: E402
from habitat_baselines.rl.models.rnn_state_encoder import build_rnn_state_encoder  # noqa: E402
from habitat_baselines.rl.ppo.policy import Net, NetPolicy  # noqa: E402
from habitat_baselines.rl.ppo.ppo_trainer import PPOTrainer  # noqa: E402

_AGENT = "main_agent"


class _Envs:
    """Our env as the trainer speaks to its processes: one by one. All step when the first is waited for."""

    def __init__(self, env: LockStepEnv) -> None:
        self.num_envs = env.num_envs
        self._env = env
        self._actions = np.zeros(env.num_envs, np.int64)
        self._step: Step

    def reset(self) -> list[Observations]:
        return _rows(self._env.reset(), self.num_envs)

    def post_step(self, observations: list[Observations]) -> list[Observations]:
        return observations

    def async_step_at(self, index: int, action: int) -> None:
        self._actions[index] = action

    def wait_step_at(self, index: int) -> tuple[Observations, float, bool, dict[str, Any]]:
        if index == 0:
            self._step = self._env.step(self._actions)
        step = self._step
        observation = {name: values[index] for name, values in step.observations.items()}
        return observation, float(step.rewards[index]), bool(step.terminated[index] or step.truncated[index]), {}

    def close(self) -> None:
        """The process ends with it."""


class _Net(Net):  # type: ignore[misc]
    def __init__(self, config: TrainConfig, thought_size: int) -> None:
        super().__init__()
        network = config.network
        self._size = network.hidden_size
        self.senses = Senses(config, thought_size)
        self.state_encoder = build_rnn_state_encoder(self.senses.size, self._size, "LSTM", network.lstm_layers)

    output_size = property(lambda self: self._size)
    recurrent_hidden_size = property(lambda self: self._size)
    perception_embedding_size = property(lambda self: self._size)
    num_recurrent_layers = property(lambda self: self.state_encoder.num_recurrent_layers)
    is_blind = False

    def forward(
        self,
        observations: Mapping[str, Tensor],
        hidden: Tensor,
        previous_actions: Tensor,  # noqa: ARG002 - they are among the observations
        masks: Tensor,
        sequences: dict[str, Tensor] | None = None,
    ) -> tuple[Tensor, Tensor, dict[str, Tensor]]:
        output, hidden = self.state_encoder(self.senses(observations), hidden, masks, sequences)
        return output, hidden, {}


class _Trainer(PPOTrainer):  # type: ignore[misc]
    """Their trainer, for whom our env is already there, and which goes on as long as updates are wanted."""

    def __init__(self, config: Any, told: Orders) -> None:
        super().__init__(config)
        self._told = told

    def _init_envs(self, config: Any = None, is_eval: bool = False) -> None:  # noqa: ARG002
        env = LockStepEnv(self._told.config, self._told.planner)
        spaces = {name: gym.spaces.Box(box.low, box.high, dtype=box.dtype) for name, box in env.boxes.items()}
        actions = gym.spaces.Discrete(env.num_actions)
        baseline_registry.register_policy(_make_policy(self._told.config, env.thought_size), name=_AGENT)
        self.envs = _Envs(env)
        self._env_spec = EnvironmentSpec(gym.spaces.Dict(spaces), actions, actions)
        self._rank0_keys: set[str] = set()
        self._single_proc_infos: dict[str, list[float]] = {}

    def is_done(self) -> bool:
        """Asked once before each update."""
        return next(self._told.updates, self) is self


def _make_policy(config: TrainConfig, thought_size: int) -> type:
    class Policy(NetPolicy):  # type: ignore[misc]
        @classmethod
        def from_config(cls, _config: Any, _space: Any, action_space: Any, **_: Any) -> "Policy":
            policy = cls(_Net(config, thought_size), action_space)
            set_priors(policy.action_distribution.linear, config)
            return policy

    return Policy


def _rows(observations: Observations, count: int) -> list[Observations]:
    return [{name: values[row] for name, values in observations.items()} for row in range(count)]


def _their_config(config: TrainConfig, folder: Path) -> Any:
    """Their configuration with our sizes, and whatever they would save or log in a folder."""
    baselines = OmegaConf.structured(HabitatBaselinesRLConfig)
    baselines.verbose = False
    baselines.num_environments = config.num_envs
    baselines.num_updates, baselines.total_num_steps = 10**9, -1.0
    baselines.num_checkpoints, baselines.checkpoint_interval = -1, 10**9
    baselines.checkpoint_folder, baselines.tensorboard_dir = str(folder / "checkpoints"), ""
    baselines.log_file = str(folder / "train.log")
    baselines.rl.policy = {_AGENT: PolicyConfig(name=_AGENT)}
    ours = config.ppo
    baselines.rl.ppo.update(
        {
            "num_steps": ours.num_steps,
            "ppo_epoch": ours.epochs,
            "num_mini_batch": ours.minibatches,
            "lr": ours.lr,
            "eps": ours.adam_eps,
            "clip_param": ours.clip,
            "gamma": ours.gamma,
            "tau": ours.tau,
            "value_loss_coef": ours.value_coef,
            "entropy_coef": ours.entropy_coef,
            "max_grad_norm": ours.max_grad_norm,
            "use_clipped_value_loss": ours.clip_value_loss,
            "use_normalized_advantage": ours.normalize_advantages,
            "use_gae": True,
            "use_linear_lr_decay": False,
            "use_linear_clip_decay": False,
        }
    )
    habitat = {
        "seed": config.seed,
        "task": {"measurements": {}, "rank0_env0_measure_names": [], "rank0_measure_names": []},
        "simulator": {"agents_order": [_AGENT]},
    }
    return OmegaConf.create({"habitat": habitat, "habitat_baselines": baselines})


def main() -> None:
    with orders() as told, tempfile.TemporaryDirectory() as folder:
        torch.manual_seed(told.config.seed)
        _Trainer(_their_config(told.config, Path(folder)), told).train()


if __name__ == "__main__":
    main()
