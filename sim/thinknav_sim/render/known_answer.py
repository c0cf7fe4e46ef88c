"""The check that a renderer gives the right answer on this machine, made before it is used.

A renderer calls foreign code through addresses and memory layouts that no compiler compares. A scene whose
picture is known in closed form shows in about a millisecond whether they agree.
"""

import math

import numpy as np

from thinknav_sim.render.camera import Camera
from thinknav_sim.render.renderer import NOTHING_DEPTH, Renderer, RendererUnavailable
from thinknav_sim.scene import Scene

_DISTANCE = 2.0
_HALF_WIDTH = 4.0
_DEPTH_TOLERANCE = 1e-4


def check_known_answer(renderer: Renderer) -> None:
    """Draw and cast at one wall. Raises RendererUnavailable that says what came out wrong."""
    scene_id = renderer.add_scene(_wall())
    try:
        _check_picture(renderer, scene_id)
        _check_rays(renderer, scene_id)
    finally:
        renderer.remove_scene(scene_id)


def _wall() -> Scene:
    """A wall ahead of the origin: red grows to the right, green upwards, and triangle 0 is the lower one."""
    a, z = _HALF_WIDTH, -_DISTANCE
    return Scene(
        name="known answer",
        vertices=np.array([(-a, -a, z), (a, -a, z), (a, a, z), (-a, a, z)], np.float32),
        triangles=np.array([(0, 1, 2), (0, 2, 3)], np.int32),
        colors=np.array([(0, 0, 50), (200, 0, 50), (200, 200, 50), (0, 200, 50)], np.uint8),
        triangle_objects=np.array([-1, -1], np.int32),
    )


def _check_picture(renderer: Renderer, scene_id: int) -> None:
    # A size that no tile divides; the second view has its back to the wall.
    camera = Camera(width=7, height=5, hfov=90.0, elevation=0.5)
    poses = np.array([(0.3, 0.0, 0.0, 0.0), (0.3, 0.0, 0.0, math.pi)])
    rgb, depth = renderer.render(np.array([scene_id, scene_id]), poses, camera)
    x = 0.3 + _DISTANCE * (np.arange(7) + 0.5 - 3.5) / camera.focal_length
    y = 0.5 + _DISTANCE * (2.5 - np.arange(5) - 0.5) / camera.focal_length
    expected = np.empty((5, 7, 3))
    expected[..., 0] = (x + _HALF_WIDTH) * 25
    expected[..., 1] = (y[:, None] + _HALF_WIDTH) * 25
    expected[..., 2] = 50
    if not np.allclose(depth[0], _DISTANCE, rtol=0, atol=_DEPTH_TOLERANCE):
        raise RendererUnavailable(f"a wall at {_DISTANCE} m was drawn at {depth[0].min()} to {depth[0].max()} m")
    if not np.allclose(rgb[0], expected, rtol=0, atol=1):
        worst = np.abs(rgb[0] - expected).max()
        raise RendererUnavailable(f"a wall of known colours was drawn with colours {worst:.0f} levels off")
    if not (depth[1] == NOTHING_DEPTH).all() or rgb[1].any():
        raise RendererUnavailable("something was drawn where there is nothing")


def _check_rays(renderer: Renderer, scene_id: int) -> None:
    origins = np.zeros((3, 3), np.float32)
    directions = np.array([(1, -0.5, -2), (-1, 0.5, -2), (0, 0, 1)], np.float32)
    hits = renderer.cast(scene_id, origins, directions)
    near = np.allclose(hits.distance, (1, 1, np.inf), rtol=0, atol=_DEPTH_TOLERANCE)
    if not near or hits.triangle.tolist() != [0, 1, -1]:
        raise RendererUnavailable(f"rays at known triangles met {hits.triangle.tolist()} at {hits.distance.tolist()}")
