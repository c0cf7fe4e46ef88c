"""Peers: how they are spoken to, that they are given our env and our policy's layers, and that they train."""

import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from thinknav_sim.task_config import Action
from thinknav_trainer.bench.lock_step import PREVIOUS_ACTION, LockStepEnv, Senses, set_priors
from thinknav_trainer.bench.peer import Peer, PeerMissing
from thinknav_trainer.bench.peer_trainers import PEERS, PeerTrainer, TrainerPeer
from thinknav_trainer.bench.training import against_peers
from thinknav_trainer.config import TrainConfig, change_config
from thinknav_trainer.policy import Policy
from thinknav_trainer.train import observation_shape

REPOSITORY = Path(__file__).parents[3]
ECHO = """
print("ready", flush=True)
for line in map(int, open(0)):
    print('{"steps": %d, "seconds": 0.5}' % (64 * line), flush=True)
"""


@pytest.fixture
def config(smoke: TrainConfig) -> TrainConfig:
    return change_config(smoke, overrides=["think.strategy=never", "scenes.episodes=10"])


@pytest.fixture
def peers(tmp_path: Path) -> Path:
    """A virtual environment that is our own."""
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "python").symlink_to(sys.executable)
    return tmp_path


def test_a_peer_works_when_it_is_told_to(peers: Path) -> None:
    with Peer("echo", peers, ["-c", ECHO]) as peer:
        assert peer.work(1) == {"steps": 64, "seconds": 0.5}
        assert peer.work(3)["steps"] == 192


def test_a_peer_that_is_not_there_or_does_not_start_says_why(peers: Path, tmp_path: Path) -> None:
    with pytest.raises(PeerMissing, match="echo is not installed: make bench-peers"):
        Peer("echo", tmp_path / "nowhere", [])
    with pytest.raises(PeerMissing, match=r"echo does not run here \(.*no such thing\); it needs patience"):
        Peer("echo", peers, ["-c", "raise SystemExit('no such thing')"], "patience")


def test_figures_go_on_without_peers(config: TrainConfig, tmp_path: Path) -> None:
    figures = list(against_peers("train.cpu", config, tmp_path, 1))
    assert [figure.figure for figure in figures] == ["train.cpu.vs_sb3", "train.cpu.vs_habitat"]
    assert all(figure.value > 0 and figure.ratio is None for figure in figures)
    assert all("make bench-peers" in str(figure.peer) for figure in figures)


def test_a_previous_action_is_shown_and_forgotten_with_its_episode(config: TrainConfig) -> None:
    env = LockStepEnv(config, None)
    assert env.reset()[PREVIOUS_ACTION].tolist() == [[0]] * 4
    actions = np.array([Action.STOP, Action.MOVE_FORWARD, Action.TURN_LEFT, Action.TURN_RIGHT])
    step = env.step(actions)
    assert step.observations[PREVIOUS_ACTION].tolist() == [[0], [2], [3], [4]]
    assert step.final_observations[0][PREVIOUS_ACTION].tolist() == [1]
    assert all(env.boxes[name].contains(values[1]) for name, values in step.observations.items())


def test_a_peer_sees_what_our_policy_sees(config: TrainConfig) -> None:
    """The same weights make the same of the same observations, though those come flat and as floats."""
    torch.manual_seed(0)
    policy = Policy(observation_shape(config, None), config.network)
    senses = Senses(config, 0)
    same = {f"_policy.{name}": values for name, values in policy.state_dict().items()}
    senses.load_state_dict({name: same[name] for name in senses.state_dict()})
    observations = {name: torch.from_numpy(values) for name, values in LockStepEnv(config, None).reset().items()}
    vision = policy.vision
    expected = policy.features(vision.prepare(vision.look(observations)), torch.full((4,), -1))
    flat = {name: values.reshape(len(values), -1).float() for name, values in observations.items()}
    torch.testing.assert_close(senses(flat), expected)
    assert senses.size == expected.shape[1] == policy.rnn.input_size


def test_peers_begin_with_the_same_priors(config: TrainConfig) -> None:
    actor = torch.nn.Linear(3, 5)
    set_priors(actor, change_config(config, overrides=["policy.think_bias=-2"]))
    assert [actor.bias[Action.STOP].item(), actor.bias[Action.THINK].item()] == [-4.0, -2.0]


@pytest.mark.parametrize("peer", PEERS, ids=[peer.figure for peer in PEERS])
def test_a_peer_that_is_installed_trains(config: TrainConfig, peer: TrainerPeer) -> None:
    try:
        with PeerTrainer(peer, REPOSITORY / ".venv-peers", config, None) as trainer:
            assert trainer.work(2)["steps"] == 2 * config.steps_per_update
            assert trainer.rate(1) > 0
    except PeerMissing as missing:
        if "make bench-peers" in str(missing) or "No module named" in str(missing):
            pytest.skip(str(missing))
        raise
