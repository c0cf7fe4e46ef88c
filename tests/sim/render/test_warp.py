"""What Warp has beyond other renderers: pictures as torch tensors, on whatever device there is."""

import numpy as np
import pytest

from thinknav_sim.render import Camera, RendererUnavailable, WarpRenderer
from thinknav_sim.scene import Scene

pytest.importorskip("warp", reason="warp-lang is not installed: pip install 'thinknav[gpu]'")
torch = pytest.importorskip("torch", reason="torch is not installed")

CAMERA = Camera(12, 7)
POSES = np.array([(0.1, 0.0, 0.3, 0.5), (-0.4, 0.0, 0.2, 3.0), (0.2, 0.1, -0.5, -1.0)])


def test_tensors_hold_the_same_pictures(rooms: tuple[Scene, ...]) -> None:
    with WarpRenderer() as renderer:
        scene_ids = np.array([renderer.add_scene(room) for room in rooms])
        rgb, depth = renderer.draw(scene_ids, POSES, CAMERA)
        expected_rgb, expected_depth = renderer.render(scene_ids, POSES, CAMERA)
    assert isinstance(rgb, torch.Tensor)
    assert rgb.device == depth.device
    assert rgb.device.type == ("cuda" if renderer.device.startswith("cuda") else "cpu")
    np.testing.assert_array_equal(rgb.cpu().numpy(), expected_rgb)
    np.testing.assert_array_equal(depth.cpu().numpy(), expected_depth)


def test_no_views(rooms: tuple[Scene, ...]) -> None:
    with WarpRenderer() as renderer:
        rgb, depth = renderer.draw(np.empty(0, np.int64), np.empty((0, 4)), CAMERA)
    assert tuple(rgb.shape) == (0, 7, 12, 3)
    assert tuple(depth.shape) == (0, 7, 12, 1)


def test_a_missing_device_is_named() -> None:
    with pytest.raises(RendererUnavailable, match="Warp has no device 'cuda:99'"):
        WarpRenderer("cuda:99")
