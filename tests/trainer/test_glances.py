"""Who has the same pictures before it does not look again; what comes of a look stays what it was."""

from typing import Any
from unittest.mock import patch

import numpy as np
import torch
from numpy.typing import NDArray

from tests.trainer.conftest import MakeThinkingEnv
from thinknav_sim.task_config import Action
from thinknav_trainer.actor import Actor
from thinknav_trainer.config import PolicyConfig, TrainConfig
from thinknav_trainer.glances import Glances
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.vision import ClipVision, make_vision

SMALL_CLIP = PolicyConfig(image_encoder="clip-small", visual_size=16)


def observed(rng: np.random.Generator, count: int) -> dict[str, NDArray[Any]]:
    return {
        "rgb": rng.integers(0, 256, (count, 64, 64, 3), dtype=np.uint8),
        "depth": rng.random((count, 64, 64, 1), dtype=np.float32),
        "gps": rng.random((count, 2), dtype=np.float32),
    }


def looks() -> Any:
    return patch.object(ClipVision, "look", autospec=True, side_effect=ClipVision.look)


def test_only_what_is_new_is_looked_at() -> None:
    vision = make_vision(64, 64, SMALL_CLIP)
    assert isinstance(vision, ClipVision)
    glances = Glances(vision, 5)
    rng = np.random.default_rng(0)
    first = observed(rng, 5)
    everyone = np.arange(5)
    before = glances.look(first, everyone)
    moved = {name: values.copy() for name, values in first.items()}
    moved["gps"] += 1  # is no picture
    moved["rgb"][1, 5, 5, 0] ^= 1
    moved["depth"][3, 0, 0] += 0.5
    with looks() as look:
        after = glances.look(moved, everyone)
    assert [len(call.args[1]["rgb"]) for call in look.call_args_list] == [2]
    assert set(after) == set(before) == {"sight", "coarse_depth", "gps"}
    np.testing.assert_array_equal(after["gps"], moved["gps"])
    for name in ("sight", "coarse_depth"):
        np.testing.assert_array_equal(after[name][[0, 2, 4]], before[name][[0, 2, 4]])
        exact = vision.look({key: torch.from_numpy(values) for key, values in moved.items()})[name].numpy()
        np.testing.assert_allclose(after[name].astype(np.float32), exact.astype(np.float32), atol=2e-2)
    assert not np.array_equal(after["sight"][1], before["sight"][1])
    assert not np.array_equal(after["coarse_depth"][3], before["coarse_depth"][3])


def test_agents_are_not_taken_for_each_other() -> None:
    vision = make_vision(64, 64, SMALL_CLIP)
    assert isinstance(vision, ClipVision)
    glances = Glances(vision, 4)
    seen = observed(np.random.default_rng(1), 4)
    of_all = glances.look(seen, np.arange(4))
    some = np.array([3, 1])
    with looks() as look:
        of_some = glances.look({name: values[some] for name, values in seen.items()}, some)
    assert not look.called
    np.testing.assert_array_equal(of_some["sight"], of_all["sight"][some])
    with looks() as look:
        glances.look({name: values[some] for name, values in seen.items()}, np.array([1, 3]))
    assert look.call_count == 1


def test_who_has_not_looked_yet_looks_at_the_dark_too() -> None:
    vision = make_vision(64, 64, SMALL_CLIP)
    glances = Glances(vision, 2)
    seen = observed(np.random.default_rng(4), 2)
    dark = {name: np.zeros_like(values) for name, values in seen.items()}
    glances.look({name: values[:1] for name, values in seen.items()}, np.array([0]))
    with looks() as look:
        glances.look({name: values[1:] for name, values in dark.items()}, np.array([1]))
    assert look.call_count == 1


def test_who_goes_on_remembers() -> None:
    vision = make_vision(64, 64, SMALL_CLIP)
    assert isinstance(vision, ClipVision)
    seen = observed(np.random.default_rng(2), 3)
    one, other = Glances(vision, 3), Glances(vision, 3)
    expected = one.look(seen, np.arange(3))
    other.load_state_dict(one.state_dict())
    with looks() as look:
        again = other.look(seen, np.arange(3))
    assert not look.called
    np.testing.assert_array_equal(again["sight"], expected["sight"])


def test_pictures_that_are_kept_pass_through(smoke: TrainConfig) -> None:
    glances = Glances(make_vision(smoke.env.height, smoke.env.width, smoke.policy), 2)
    rng = np.random.default_rng(3)
    shape = (2, smoke.env.height, smoke.env.width)
    rgb = rng.integers(0, 256, (*shape, 3), dtype=np.uint8)
    seen: dict[str, NDArray[Any]] = {"rgb": rgb, "depth": np.zeros((*shape, 1), np.float32)}
    for _ in range(2):
        looked = glances.look(seen, np.arange(2))
        assert set(looked) == {"rgb", "depth"}
        np.testing.assert_array_equal(looked["rgb"], seen["rgb"])


def test_who_thinks_does_not_look_again(thinking_env: MakeThinkingEnv, smoke: TrainConfig) -> None:
    env = thinking_env(lambda request: "turn left", count=3)
    policy = Policy(ObservationShape(smoke.env.height, smoke.env.width, len(Action), 512), SMALL_CLIP)
    actor = Actor(policy, 3, "float32", seed=0)
    observations = env.reset()
    actor.look(observations)
    with looks() as look:
        step = env.step(np.array([Action.THINK, Action.TURN_LEFT, Action.THINK]))
        actor.look(step.observations)
    assert [len(call.args[1]["rgb"]) for call in look.call_args_list] == [1]
