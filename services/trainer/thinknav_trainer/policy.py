"""The recurrent actor-critic: what it sees, in the order of Habitat's PointNavResNetNet, plus the thought.

RNN input: [visual features | goal embedding | cos, sin of compass | gps | moved | previous action | free heading, where
there is that sensor | thought] -> LSTM -> action logits and value. How it sees is `vision`'s affair. Knows nothing of
rewards, planners or where observations come from.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass

import torch
from torch import Tensor, nn

from thinknav_sim.scene import GOAL_CATEGORIES
from thinknav_sim.task_config import Action
from thinknav_trainer.config import PolicyConfig
from thinknav_trainer.obstacle_memory import FREE_SIZE
from thinknav_trainer.vision import make_vision

EMBEDDING_SIZE = 32  # of goal, compass, gps and previous action, as in Habitat, and of what was moved
STEP_M = 0.25  # what was moved is seen as a share of Habitat's step


@dataclass(frozen=True)
class ObservationShape:
    """What the network must fit: image height and width, number of actions, length of a thought (0: none)."""

    height: int
    width: int
    num_actions: int
    thought_size: int


@dataclass(frozen=True)
class Sequences:
    """How M transitions, laid one after the other, fall into S recurrent sequences of at most L steps.

    index: (L, S) int64, the transition at each place; padding repeats some valid one.
    mask: (L, S) bool, false where there is only padding.
    hidden: (2, layers, S, H) float32, the LSTM's state before the first step of each.
    """

    index: Tensor
    mask: Tensor
    hidden: Tensor


class Policy(nn.Module):
    """Actor and critic on one LSTM. `stop` starts with a low prior: see `PolicyConfig.stop_bias`."""

    thought_centre: Tensor
    thought_scale: Tensor

    def __init__(self, shape: ObservationShape, config: PolicyConfig) -> None:
        super().__init__()
        self.shape = shape
        self.vision = make_vision(shape.height, shape.width, config)
        self.goal = nn.Embedding(len(GOAL_CATEGORIES), EMBEDDING_SIZE)
        self.compass = nn.Linear(2, EMBEDDING_SIZE)
        self.gps = nn.Linear(2, EMBEDDING_SIZE)
        self.moved = nn.Linear(1, EMBEDDING_SIZE)
        self.previous_action = nn.Embedding(shape.num_actions + 1, EMBEDDING_SIZE)  # 0: an episode begins
        rnn_input = config.visual_size + 5 * EMBEDDING_SIZE
        self.free = nn.Linear(FREE_SIZE, EMBEDDING_SIZE) if config.obstacle_memory else None
        if self.free is not None:
            rnn_input += EMBEDDING_SIZE
        if shape.thought_size:
            self.thought = nn.Linear(shape.thought_size, config.thought_size)
            # Where thoughts lie and how far apart: by default they have unit norm, and each element unit variance.
            self.register_buffer("thought_centre", torch.zeros(shape.thought_size))
            self.register_buffer("thought_scale", torch.tensor(math.sqrt(shape.thought_size)))
            rnn_input += config.thought_size
        self.rnn = nn.LSTM(rnn_input, config.hidden_size, config.lstm_layers)
        for name, parameter in self.rnn.named_parameters():
            nn.init.orthogonal_(parameter) if "weight" in name else nn.init.zeros_(parameter)
        self.actor = nn.Linear(config.hidden_size, shape.num_actions)
        self.critic = nn.Linear(config.hidden_size, 1)
        nn.init.orthogonal_(self.actor.weight, 0.01)
        nn.init.orthogonal_(self.critic.weight)
        nn.init.zeros_(self.critic.bias)
        nn.init.zeros_(self.actor.bias)
        with torch.no_grad():
            self.actor.bias[Action.STOP] = config.stop_bias
            if shape.num_actions > Action.THINK:
                self.actor.bias[Action.THINK] = config.think_bias

    @property
    def device(self) -> torch.device:
        """Where it computes, and wants what it is given."""
        return self.actor.weight.device

    def initial_hidden(self, count: int) -> Tensor:
        """The state at the start of an episode: (2, layers, count, hidden) zeros, on the CPU, where it is kept."""
        return torch.zeros(2, self.rnn.num_layers, count, self.rnn.hidden_size)

    def features(self, observations: Mapping[str, Tensor], previous_actions: Tensor) -> Tensor:
        """What the LSTM sees of B prepared transitions: (B, rnn_input). previous_actions: (B,) int64, -1 for none."""
        compass = observations["compass"]
        parts = [
            self.vision(observations),
            self.goal(observations["objectgoal"][:, 0]),
            self.compass(torch.cat([compass.cos(), compass.sin()], dim=1)),
            self.gps(observations["gps"]),
            self.moved(observations["moved"] / STEP_M),
            self.previous_action(previous_actions + 1),
        ]
        if self.free is not None:
            parts.append(self.free(observations["free"]))
        if self.shape.thought_size:
            parts.append(self.thought(self._scaled(observations["thought"])))
        return torch.cat([part.to(parts[0].dtype) for part in parts], dim=1)

    def scale_thoughts(self, centre: Tensor, scale: float) -> None:
        """Take (thought - centre (D,)) x scale for a thought: what `thought_scale` is about."""
        self.thought_centre.copy_(centre)
        self.thought_scale.fill_(scale)

    def _scaled(self, thoughts: Tensor) -> Tensor:
        """Thoughts (B, D) centred and scaled; where there is none it stays at zero."""
        there = thoughts.any(dim=1, keepdim=True)
        return (thoughts - self.thought_centre) * self.thought_scale * there

    def step(
        self, observations: Mapping[str, Tensor], previous_actions: Tensor, hidden: Tensor
    ) -> tuple[Tensor, Tensor, Tensor]:
        """One step of N agents: logits (N, A), values (N,), and the next hidden state, all float32."""
        features = self.features(self.vision.prepare(self.vision.look(observations)), previous_actions)
        output, (h, c) = self.rnn(features[None].float(), (hidden[0], hidden[1]))
        logits, values = self._heads(output[0])
        return logits, values, torch.stack([h, c]).float()

    def sequence(
        self, observations: Mapping[str, Tensor], previous_actions: Tensor, sequences: Sequences
    ) -> tuple[Tensor, Tensor]:
        """M prepared transitions in S sequences: logits and values in the order of `sequences.index[mask]`."""
        features = self.features(observations, previous_actions)
        hidden = (sequences.hidden[0].contiguous(), sequences.hidden[1].contiguous())
        output, _ = self.rnn(features[sequences.index].float(), hidden)
        return self._heads(output[sequences.mask])

    def _heads(self, output: Tensor) -> tuple[Tensor, Tensor]:
        return self.actor(output).float(), self.critic(output).float()[:, 0]
