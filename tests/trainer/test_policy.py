"""The network: shapes, priors, and that a sequence is the same as its steps."""

import torch

from thinknav_sim.task_config import Action
from thinknav_trainer.config import PolicyConfig
from thinknav_trainer.policy import ObservationShape, Policy, Sequences

SHAPE = ObservationShape(height=24, width=32, num_actions=5, thought_size=16)
CONFIG = PolicyConfig(channels=(2, 4, 4), visual_size=8, thought_size=4, hidden_size=8, lstm_layers=2)


def policy(shape: ObservationShape = SHAPE) -> Policy:
    torch.manual_seed(0)
    return Policy(shape, CONFIG)


def observations(count: int) -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(1)
    return {
        "rgb": torch.randint(0, 256, (count, 24, 32, 3), dtype=torch.uint8, generator=generator),
        "depth": torch.rand(count, 24, 32, 1, generator=generator),
        "gps": torch.rand(count, 2, generator=generator),
        "moved": torch.rand(count, 1, generator=generator) / 4,
        "compass": torch.rand(count, 1, generator=generator),
        "objectgoal": torch.randint(0, 6, (count, 1), generator=generator),
        "thought": torch.rand(count, 16, generator=generator),
    }


def test_a_sequence_equals_its_steps_from_the_stored_state() -> None:
    net, seen = policy(), observations(5)
    previous = torch.tensor([-1, 0, 1, 2, 3])
    hidden = torch.rand(2, 2, 1, 8)
    logits, values = net.sequence(
        net.vision.prepare(seen),
        previous,
        Sequences(torch.arange(5)[:, None], torch.ones(5, 1, dtype=torch.bool), hidden),
    )
    state = hidden
    for t in range(5):
        one = {name: value[t : t + 1] for name, value in seen.items()}
        step_logits, step_values, state = net.step(one, previous[t : t + 1], state)
        torch.testing.assert_close(step_logits[0], logits[t])
        torch.testing.assert_close(step_values[0], values[t])


def test_padding_changes_nothing() -> None:
    net, seen = policy(), observations(4)
    previous = torch.zeros(4, dtype=torch.int64)
    hidden = torch.rand(2, 2, 2, 8)
    index = torch.tensor([[0, 3], [1, 3], [2, 3]])
    mask = torch.tensor([[True, True], [True, False], [True, False]])
    logits, _ = net.sequence(net.vision.prepare(seen), previous, Sequences(index, mask, hidden))
    alone, _ = net.sequence(
        net.vision.prepare({name: value[3:] for name, value in seen.items()}),
        previous[3:],
        Sequences(torch.tensor([[0]]), torch.tensor([[True]]), hidden[:, :, 1:]),
    )
    torch.testing.assert_close(logits[1], alone[0])  # row order of index[mask]: 0, 3, 1, 2


def test_stop_begins_unlikely() -> None:
    net = policy()
    logits, _, _ = net.step(observations(3), torch.full((3,), -1), net.initial_hidden(3))
    probabilities = logits.softmax(1)
    assert (probabilities[:, Action.STOP] < 0.01).all()
    assert (probabilities[:, Action.MOVE_FORWARD] > 0.2).all()


def test_every_observation_reaches_the_output() -> None:
    net, seen = policy(), observations(1)
    previous, hidden = torch.tensor([1]), net.initial_hidden(1)
    _, base, _ = net.step(seen, previous, hidden)
    for name, value in seen.items():
        other = (255 - value) if name == "rgb" else (value + 1) % 6 if name == "objectgoal" else value + 0.5
        _, changed, _ = net.step(seen | {name: other}, previous, hidden)
        assert not torch.equal(base, changed), name
    assert not torch.equal(base, net.step(seen, torch.tensor([2]), hidden)[1])


def test_without_thoughts_there_is_no_layer_for_them() -> None:
    net = policy(ObservationShape(24, 32, 4, 0))
    seen = observations(2)
    del seen["thought"]
    logits, _, _ = net.step(seen, torch.full((2,), -1), net.initial_hidden(2))
    assert logits.shape == (2, 4)
    assert not any("thought" in name for name, _ in net.named_parameters())
