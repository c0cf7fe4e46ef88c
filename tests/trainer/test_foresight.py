"""Moving untold as one does once told: the loss against an obvious one, whom it moves, and that it teaches it."""

import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from tests.trainer.conftest import MakeThinkingEnv
from tests.trainer.obeying import ThinkAndObey
from thinknav_proto import SubgoalRequest
from thinknav_sim.task_config import Action
from thinknav_trainer.actor import Actor
from thinknav_trainer.collector import Collector
from thinknav_trainer.config import ConfigError, PPOConfig, TrainConfig, WarmStartConfig, change_config
from thinknav_trainer.foresight import foresight_loss
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.rollout import Rollout
from thinknav_trainer.warm_start import Cloner, Demonstrations


def chances(logits: torch.Tensor) -> torch.Tensor:
    """Of forward, left and right, were there no think."""
    return logits[: Action.THINK].softmax(dim=0)[Action.MOVE_FORWARD :]


@given(lengths=st.lists(st.integers(1, 5), min_size=1, max_size=5), padding=st.integers(0, 2), seed=st.integers(0, 999))
def test_it_is_the_divergence_summed_over_replies(lengths: list[int], padding: int, seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    count = sum(lengths)
    logits = torch.randn(count, 5, generator=generator)
    previous = torch.randint(-1, 5, (count,), generator=generator)
    told = torch.rand(count, generator=generator) < 0.6
    mask = torch.zeros(max(lengths), len(lengths) + padding, dtype=torch.bool)
    for sequence, length in enumerate(lengths):
        mask[:length, sequence] = True
    number = {place: row for row, place in enumerate(map(tuple, mask.nonzero().tolist()))}
    expected = 0.0
    for (step, sequence), row in number.items():
        before = number.get((step - 1, sequence))
        if before is not None and told[row] and previous[row] == Action.THINK:
            target, untold = (moves / moves.sum() for moves in (chances(logits[row]), chances(logits[before])))
            moving = chances(logits[row]).sum()
            expected += float(moving * (target * (target / untold).log()).sum()) / count
    assert float(foresight_loss(logits, previous, told, mask)) == pytest.approx(expected, abs=1e-5)


def test_who_is_told_is_not_moved() -> None:
    logits = torch.zeros(3, 5)
    logits[1, Action.TURN_LEFT] = 3.0
    logits.requires_grad_()
    previous, told = torch.tensor([-1, Action.THINK, Action.TURN_LEFT]), torch.tensor([False, True, False])
    foresight_loss(logits, previous, told, torch.ones(3, 1, dtype=torch.bool)).backward()  # type: ignore[no-untyped-call]
    assert logits.grad is not None
    assert logits.grad[0, Action.TURN_LEFT] < 0  # downhill is up
    assert not logits.grad[0, [Action.THINK, Action.STOP]].any()
    assert not logits.grad[1:].any()


def by_goal(request: SubgoalRequest) -> str:
    return "turn left" if request.goal < "m" else "turn right"


def sequences_of(rollout: Rollout, policy: Policy) -> tuple[torch.Tensor, torch.Tensor]:
    """Logits and actions of a rollout's transitions, in one order."""
    transitions, sequences = rollout.select(torch.arange(len(rollout.sequence_starts)).numpy())
    observations = policy.vision.prepare(rollout.observations)
    with torch.no_grad():
        logits, _ = policy.sequence(
            {name: rows[transitions] for name, rows in observations.items()},
            rollout.previous_actions[transitions],
            sequences,
        )
    return logits, rollout.actions[transitions[sequences.index[sequences.mask]]]


@pytest.mark.parametrize(("coefficient", "foresees"), [(1.0, True), (0.0, False)])
def test_what_a_reply_depends_on_is_learnt(
    thinking_env: MakeThinkingEnv, smoke: TrainConfig, coefficient: float, foresees: bool
) -> None:
    config = PPOConfig(num_steps=16, chunk_length=8, precision="float32")
    env = thinking_env(by_goal, count=8, max_steps=6)
    torch.manual_seed(0)
    policy = Policy(ObservationShape(32, 32, num_actions=5, thought_size=512), smoke.policy)
    actor = Actor(policy, 8, "float32", seed=0)
    shown = Demonstrations(env, actor, ThinkAndObey(8), Collector(env, actor, config), config)
    cloner = Cloner(policy, WarmStartConfig(lr=5e-3, epochs=4, own_share=0, foresight_coef=coefficient), config, seed=0)
    losses = [cloner.update(shown.collect()) for _ in range(12)]
    assert ("foresight_loss" in losses[-1]) == foresees
    rollout = shown.collect()
    logits, actions = sequences_of(rollout, policy)
    assert set(actions.tolist()) == {Action.THINK, Action.TURN_LEFT, Action.TURN_RIGHT}
    assert (logits.argmax(dim=1) == actions).float().mean() > 0.95
    asking = actions == Action.THINK
    chances = logits[asking][:, : Action.THINK].softmax(dim=1)
    turning = chances[:, Action.TURN_LEFT] + chances[:, Action.TURN_RIGHT]
    assert (float(turning.mean()) > 0.9) == foresees
    if foresees:
        assert float(chances.max(dim=1).values.mean()) > 0.9  # and which way


def test_who_never_thinks_has_nothing_to_foresee(smoke: TrainConfig) -> None:
    with pytest.raises(ConfigError, match=r"warm_start\.foresight_coef"):
        change_config(smoke, overrides=["think.strategy=never", "warm_start.foresight_coef=1"])


def test_whether_to_stop_is_not_foreseen() -> None:
    logits = torch.zeros(2, 5)
    logits[1, Action.STOP], logits[1, Action.TURN_LEFT] = 30.0, 10.0
    previous, told = torch.tensor([-1, Action.THINK]), torch.tensor([False, True])
    assert float(foresight_loss(logits, previous, told, torch.ones(2, 1, dtype=torch.bool))) < 1e-6
