"""How a policy sees: what is kept of a step, what is learnt from it, and which CLIP it must be."""

import pytest
import torch

from tests.trainer.conftest import MakeThinkingEnv
from thinknav_models.clip.image import ClipImageEncoder
from thinknav_sim.task_config import Action
from thinknav_trainer.actor import Actor
from thinknav_trainer.collector import Collector
from thinknav_trainer.config import PolicyConfig, PPOConfig, TrainConfig
from thinknav_trainer.planner import MockTransport, PlannerClient, mock_info
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.ppo import PPO
from thinknav_trainer.train import require_shared_space
from thinknav_trainer.vision import ClipVision, EmbeddingSpaceError, LearntVision, make_vision

CLIP = PolicyConfig(image_encoder="clip", visual_size=8, thought_size=4, hidden_size=8)


def observations(count: int = 3) -> dict[str, torch.Tensor]:
    generator = torch.Generator().manual_seed(0)
    return {
        "rgb": torch.randint(0, 256, (count, 48, 64, 3), dtype=torch.uint8, generator=generator),
        "depth": torch.rand(count, 48, 64, 1, generator=generator),
        "gps": torch.rand(count, 2, generator=generator),
    }


def test_the_clip_is_asked_when_looking_and_never_again(monkeypatch: pytest.MonkeyPatch) -> None:
    vision = make_vision(48, 64, CLIP)
    looked = vision.look(observations())
    assert sorted(looked) == ["coarse_depth", "gps", "sight"]
    assert looked["sight"].dtype == looked["coarse_depth"].dtype == torch.float16
    torch.testing.assert_close(looked["sight"], ClipImageEncoder.load().features(observations()["rgb"]))
    monkeypatch.setattr(ClipImageEncoder, "features", None)
    assert vision.look(looked) == looked
    features = vision(vision.prepare(looked))
    assert features.shape == (3, 8)
    features.sum().backward()
    assert all(parameter.grad is not None for parameter in vision.parameters())


def test_frozen_weights_are_neither_trained_nor_saved() -> None:
    vision = make_vision(48, 64, CLIP)
    assert isinstance(vision, ClipVision)
    names = {name.split(".")[0] for name, _ in vision.named_parameters()}
    assert names == {"depth", "linear"}
    assert {name.split(".")[0] for name in vision.state_dict()} == {"depth", "linear", "_extra_state"}


@pytest.mark.parametrize("kind", ["clip", "clip-small", "learnt"])
def test_rgb_and_depth_both_matter(kind: str) -> None:
    torch.manual_seed(0)
    vision = make_vision(48, 64, CLIP.model_copy(update={"image_encoder": kind}))
    assert isinstance(vision, LearntVision if kind == "learnt" else ClipVision)
    seen = observations(1)
    base = vision(vision.prepare(vision.look(seen)))
    for other in (seen | {"rgb": 255 - seen["rgb"]}, seen | {"depth": 1 - seen["depth"]}):
        assert not torch.allclose(base, vision(vision.prepare(vision.look(other))))


def test_weights_that_read_another_clip_are_refused() -> None:
    vision = make_vision(48, 64, CLIP)
    state = vision.state_dict()
    vision.load_state_dict(state)
    state["_extra_state"] = {"space": "other@1"}
    with pytest.raises(EmbeddingSpaceError, match=r"image encoder other@1, and here is thinknav-clip@"):
        vision.load_state_dict(state)
    small = make_vision(48, 64, CLIP.model_copy(update={"image_encoder": "clip-small"}))
    with pytest.raises(EmbeddingSpaceError, match=r"thinknav-clip@\w+, and here is thinknav-clip@\w+, small@"):
        small.load_state_dict(vision.state_dict())


def test_a_rollout_holds_what_was_looked_at_and_learns_from_it(
    thinking_env: MakeThinkingEnv, smoke: TrainConfig
) -> None:
    torch.manual_seed(0)
    env = thinking_env(lambda request: "turn left")
    policy = Policy(ObservationShape(smoke.env.height, smoke.env.width, len(Action), 512), CLIP)
    config = PPOConfig(num_steps=4, chunk_length=4)
    collector = Collector(env, Actor(policy, env.num_envs, config.precision, seed=0), config)
    rollout = collector.collect()
    assert {"sight", "coarse_depth"} <= set(rollout.observations)
    assert not {"rgb", "depth"} & set(rollout.observations)
    before = [parameter.clone() for parameter in policy.vision.parameters()]
    PPO(policy, config).update(rollout)
    assert all(not torch.equal(a, b) for a, b in zip(before, policy.vision.parameters(), strict=True))


@pytest.mark.parametrize("eye", ["clip", "clip-small"])
def test_a_service_of_another_embedding_space_is_refused(smoke: TrainConfig, eye: str) -> None:
    sees = smoke.model_copy(update={"policy": smoke.policy.model_copy(update={"image_encoder": eye})})
    info = mock_info().model_copy(update={"embedding_space": "clip-vit-b32@0123456789ab"})
    stranger = PlannerClient(MockTransport(lambda request: "stop", info=info))
    with pytest.raises(EmbeddingSpaceError, match=r"thinknav-clip@\w+, the service's .* clip-vit-b32@0123456789ab"):
        require_shared_space(sees, stranger)
    require_shared_space(smoke, stranger)
    require_shared_space(sees, None)
    require_shared_space(sees, PlannerClient(MockTransport(lambda request: "stop")))
