import numpy as np
import pytest
import torch

from thinknav_models.clip import shipped_text_encoder
from thinknav_trainer.config import PolicyConfig
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.thought_scale import centre_and_scale, typical_sentences


def test_typical_thoughts_have_unit_variance_in_the_policy_and_none_stays_none() -> None:
    embeddings = shipped_text_encoder().encode(typical_sentences())
    centre, scale = centre_and_scale(embeddings)
    net = Policy(ObservationShape(16, 16, 5, embeddings.shape[1]), PolicyConfig(channels=(2, 2, 2), visual_size=8))
    net.scale_thoughts(torch.from_numpy(centre), scale)
    scaled = net._scaled(torch.from_numpy(embeddings)).numpy()
    assert scaled.mean(axis=0) == pytest.approx(np.zeros(embeddings.shape[1]), abs=1e-4)
    assert scaled.var() == pytest.approx(1, abs=1e-3)
    assert not net._scaled(torch.zeros(3, embeddings.shape[1])).any()


def test_the_scale_travels_with_the_weights() -> None:
    nets = [Policy(ObservationShape(16, 16, 5, 4), PolicyConfig(channels=(2, 2, 2), visual_size=8)) for _ in range(2)]
    nets[0].scale_thoughts(torch.tensor([1.0, 2, 3, 4]), 7.0)
    nets[1].load_state_dict(nets[0].state_dict())
    thoughts = torch.tensor([[1.0, 0, 0, 0]])
    assert nets[1]._scaled(thoughts).tolist() == [[0, -14, -21, -28]]
