"""Textures: which way up they are, how they repeat, and what a scene refuses."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_sim.render import Camera, Renderer
from thinknav_sim.scene import Scene, SceneError

# Two rows of three texels, each of its own colour.
TEXELS = np.array(
    [[(10, 0, 0), (20, 0, 0), (30, 0, 0)], [(0, 10, 0), (0, 20, 0), (0, 30, 0)]],
    np.uint8,
)
# Straight at the middle of a wall 2 m wide and high, so that the wall fills the picture.
POSE = np.array([(0.0, 0.12, 0.0, 0.0)])
CAMERA = Camera(width=6, height=4, hfov=53.130102354)


def hung(wall: Scene, uv: list[tuple[float, float]]) -> Scene:
    """The wall with the texture: uv at the lower left, lower right, upper right and upper left corner."""
    return replace(wall, textures=(TEXELS,), uv=np.array(uv, np.float32), triangle_textures=np.zeros(2, np.int32))


def picture(renderer: Renderer, scene: Scene) -> NDArray[np.uint8]:
    rgb, _ = renderer.render(np.array([renderer.add_scene(scene)]), POSE, CAMERA)
    shown: NDArray[np.uint8] = rgb[0]
    return shown


def test_v_runs_down_from_the_first_row(renderer: Renderer, wall: Scene) -> None:
    rgb = picture(renderer, hung(wall, [(0, 1), (1, 1), (1, 0), (0, 0)]))
    # Square pixels and a picture of 6 by 4: the middle two thirds of the wall's height, hence of the texture's.
    expected = np.repeat(np.repeat(TEXELS, 2, axis=0), 2, axis=1)
    np.testing.assert_array_equal(rgb, expected)


def test_textures_repeat(renderer: Renderer, wall: Scene) -> None:
    rgb = picture(renderer, hung(wall, [(-2, 3), (0, 3), (0, 2), (-2, 2)]))
    expected = np.repeat(np.concatenate([TEXELS, TEXELS], axis=1), 2, axis=0)
    np.testing.assert_array_equal(rgb, expected)


def test_triangles_without_a_texture_keep_their_colours(renderer: Renderer, wall: Scene) -> None:
    half = replace(hung(wall, [(0, 1), (1, 1), (1, 0), (0, 0)]), triangle_textures=np.array([0, -1], np.int32))
    rgb, plain, papered = (
        picture(renderer, scene) for scene in (half, wall, hung(wall, [(0, 1), (1, 1), (1, 0), (0, 0)]))
    )
    # Triangle 0 is the lower right one.
    assert rgb[3, 5].tolist() == papered[3, 5].tolist() == [0, 30, 0]
    assert rgb[0, 0].tolist() == plain[0, 0].tolist()
    assert rgb[0, 0].tolist() != papered[0, 0].tolist()


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"uv": None}, "textures, uv and triangle_textures go together"),
        ({"triangle_textures": None}, "go together"),
        ({"uv": None, "triangle_textures": None}, "go together"),
        ({"uv": np.zeros((3, 2), np.float32)}, r"uv must be float32 of shape \(4, 2\)"),
        ({"uv": np.zeros((4, 2))}, "not float64"),
        ({"uv": np.full((4, 2), np.nan, np.float32)}, "NaN or infinite"),
        ({"uv": np.full((4, 2), -3e38, np.float32)}, "beyond 1e.06, which name no texel"),
        ({"triangle_textures": np.zeros(3, np.int32)}, r"triangle_textures must be int32 of shape \(2,\)"),
        ({"triangle_textures": np.array([0, 1], np.int32)}, "names texture 1, and 1 textures"),
        ({"triangle_textures": np.array([0, -2], np.int32)}, "names texture -2"),
        ({"textures": (TEXELS.astype(np.float32),)}, "texture 0 must be uint8"),
        ({"textures": (TEXELS[..., :1],)}, r"texture 0 must be uint8 of shape \('any', 'any', 3\)"),
        ({"textures": (TEXELS[:0],)}, "texture 0 has no texels"),
    ],
)
def test_textures_that_do_not_fit_are_named(wall: Scene, changes: dict[str, object], message: str) -> None:
    scene = hung(wall, [(0, 1), (1, 1), (1, 0), (0, 0)])
    with pytest.raises(SceneError, match=message):
        replace(scene, **changes)  # type: ignore[arg-type]
