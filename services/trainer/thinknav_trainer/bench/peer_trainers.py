"""Other libraries' learners, each in a process of its own, on our env: what they are called and how to start them.

A peer has the same homes, observations and rewards, the same layers before its LSTM and the same LSTM, as many envs and
steps, passes and minibatches. It collects in lock-step, as it knows no other way.
"""

import json
from dataclasses import dataclass
from pathlib import Path

from thinknav_trainer.bench.peer import Peer
from thinknav_trainer.config import TrainConfig


@dataclass(frozen=True)
class TrainerPeer:
    """figure: the end of its figure's name. name: for people. module: that trains, by the peers' Python."""

    figure: str
    name: str
    module: str


PEERS = (
    TrainerPeer("vs_sb3", "sb3-contrib 2.9.2 RecurrentPPO", "thinknav_trainer.bench.sb3_peer"),
    TrainerPeer("vs_habitat", "Habitat-Baselines 0.3.3 PPO trainer", "thinknav_trainer.bench.habitat_peer"),
)


class PeerTrainer(Peer):
    """A running peer that trains on request. Raises PeerMissing."""

    def __init__(self, peer: TrainerPeer, peers: Path, config: TrainConfig, planner: str | None) -> None:
        """peers: the virtual environment. planner: URL of a planning service, for a configuration that thinks."""
        setting = json.dumps(config.model_dump(mode="json"))
        super().__init__(peer.name, peers, ["-m", peer.module, setting, *([planner] if planner else [])])

    def rate(self, updates: int) -> float:
        """Collect and learn that often: steps per second."""
        done = self.work(updates)
        return float(done["steps"] / done["seconds"])
