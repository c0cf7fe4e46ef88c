"""Objects in view, against what a renderer's own triangles say and against scenes made by hand."""

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_sim.homes import generate_home, home_seed
from thinknav_sim.objectnav import make_grid
from thinknav_sim.render import Camera, Renderer, make_renderer
from thinknav_sim.scene import Box, ObjectInstance, Scene
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.visible import objects_in_view

CAMERA = Camera(64, 64)


def room_with(*objects: tuple[str, tuple[float, float, float], tuple[float, float, float]]) -> Scene:
    """One far triangle and boxes without triangles: depth images are made by hand."""
    return Scene(
        "hand-made",
        np.array([[50, 0, 0], [51, 0, 0], [50, 1, 0]], np.float32),
        np.array([[0, 1, 2]], np.int32),
        np.zeros((3, 3), np.uint8),
        np.array([-1], np.int32),
        tuple(
            ObjectInstance(index, category, Box(np.array(low), np.array(high)))
            for index, (category, low, high) in enumerate(objects)
        ),
    )


def wall(distance: float, camera: Camera = CAMERA) -> NDArray[np.float32]:
    return np.full((1, camera.height, camera.width), distance, np.float32)


ORIGIN = np.zeros((1, 4))


def test_an_object_on_the_left_has_a_positive_bearing_and_its_distance() -> None:
    scene = room_with(("chair", (-1.5, 0.0, -2.1), (-0.5, 1.0, -2.0)))
    ((chair,),) = objects_in_view(scene, ORIGIN, wall(2.0), CAMERA)
    assert chair.category == "chair"
    assert chair.bearing == pytest.approx(math.atan2(1.0, 2.0), abs=0.05)
    assert chair.distance == pytest.approx(math.hypot(0.5, 2.0), abs=0.05)
    half_picture = 2 * 2.0 * math.tan(math.radians(39.5))  # metres of wall that the picture shows each way
    assert chair.share == pytest.approx(1.0 * 1.0 / half_picture**2, rel=0.15)


@pytest.mark.parametrize("quarter", range(4))
def test_the_frame_turns_with_the_agent(quarter: int) -> None:
    """The chair stands at -z; an agent that has turned left by a quarter must look elsewhere."""
    scene = room_with(("chair", (-0.5, 0.0, -2.1), (0.5, 1.0, -2.0)))
    pose = np.array([[0.0, 0.0, 0.0, quarter * math.pi / 2]])
    (seen,) = objects_in_view(scene, pose, wall(2.0), CAMERA)
    assert [found.object_id for found in seen] == ([0] if quarter == 0 else [])


def test_the_smallest_box_wins() -> None:
    scene = room_with(
        ("table", (-1.0, 0.0, -2.5), (1.0, 1.5, -1.9)),
        ("plant", (-0.2, 0.7, -2.1), (0.2, 1.1, -1.95)),
    )
    (seen,) = objects_in_view(scene, ORIGIN, wall(2.0), CAMERA)
    assert [found.category for found in seen] == ["table", "plant"]
    plant = seen[1]
    half_picture = 2 * 2.0 * math.tan(math.radians(39.5))
    assert plant.share == pytest.approx(0.46 * 0.46 / half_picture**2, rel=0.3)


def test_what_fills_too_little_of_the_picture_is_left_out() -> None:
    scene = room_with(("plant", (-0.1, 0.8, -2.1), (0.1, 1.0, -2.0)))
    assert objects_in_view(scene, ORIGIN, wall(2.0), CAMERA, least_share=0.05) == [()]
    assert len(objects_in_view(scene, ORIGIN, wall(2.0), CAMERA, least_share=0.0)[0]) == 1


def test_nothing_is_seen_where_the_picture_is_empty_or_the_scene_is() -> None:
    scene = room_with(("chair", (-9.0, -9.0, -9.0), (9.0, 9.0, 9.0)))
    assert objects_in_view(scene, ORIGIN, wall(0.0), CAMERA) == [()]
    assert objects_in_view(room_with(), np.zeros((3, 4)), np.ones((3, 64, 64), np.float32), CAMERA) == [()] * 3


def test_depth_of_another_camera_is_refused() -> None:
    with pytest.raises(ValueError, match=r"must have shape \(1, 64, 64\)"):
        objects_in_view(room_with(), ORIGIN, wall(1.0, Camera(32, 64)), CAMERA)


def test_it_agrees_with_the_triangles_that_rays_meet() -> None:
    """In a furnished home nearly every ray's owner by box is its owner by triangle."""
    scene = generate_home(home_seed("planner", 3))
    config = ObjectNavConfig()
    renderer = make_renderer()
    grid = make_grid(scene, renderer, config)
    scene_id = renderer.add_scene(scene)
    rng = np.random.default_rng(0)
    poses = np.concatenate([grid.random_navigable(rng, 40), rng.uniform(-math.pi, math.pi, (40, 1))], axis=1)
    camera = Camera(32, 32)
    _, depth = renderer.render(np.full(40, scene_id), poses, camera)
    seen = objects_in_view(scene, poses, depth[..., 0], camera, least_share=0.0)
    difference, total = 0.0, 0.0
    for pose, found in zip(poses, seen, strict=True):
        shares = np.zeros(len(scene.objects) + 1)
        np.add.at(shares, owners_by_triangle(scene, renderer, scene_id, pose, camera), 1 / 1024)
        mine = np.zeros(len(scene.objects) + 1)
        for item in found:
            mine[item.object_id] = item.share
        difference += np.abs(mine - shares)[:-1].sum()
        total += shares[:-1].sum()
    assert total > 5
    assert difference / total < 0.1


def owners_by_triangle(
    scene: Scene, renderer: Renderer, scene_id: int, pose: NDArray[np.float64], camera: Camera
) -> NDArray[np.int32]:
    """The object that each pixel's triangle belongs to, -1 for none."""
    columns = (np.arange(camera.width) + 0.5 - camera.width / 2) / camera.focal_length
    right, up = np.meshgrid(columns, -columns)
    sine, cosine = math.sin(pose[3]), math.cos(pose[3])
    directions = np.stack([cosine * right - sine, up, -sine * right - cosine], axis=-1).reshape(-1, 3)
    eye = pose[:3] + np.array([0, camera.elevation, 0])
    hits = renderer.cast(
        scene_id, np.broadcast_to(eye, directions.shape).astype(np.float32), directions.astype(np.float32)
    )
    return np.where(hits.triangle >= 0, scene.triangle_objects[hits.triangle], np.int32(-1))
