"""Success zones and the rule of success: sight, walking distance, facing."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from thinknav_sim.navigation import Goal, NavigationGrid, distances_at, find_goal
from thinknav_sim.navigation.visibility import surface_points
from thinknav_sim.render import Renderer
from thinknav_sim.scene import Box, Scene
from thinknav_sim.success import faces_goal, goal_bearings

CHAIR = ("chair", (2.75, 0.0, 2.75, 3.25, 0.8, 3.25))
HFOV = 79.0


class Place:
    """A scene with one goal found in it."""

    def __init__(self, scene: Scene, renderer: Renderer, category: str = "chair") -> None:
        self.scene, self.renderer = scene, renderer
        self.grid = NavigationGrid.from_scene(scene, renderer)
        self.scene_id = renderer.add_scene(scene)
        self.goal: Goal = find_goal(scene, self.grid, renderer, self.scene_id, category)

    def in_zone(self, x: float, z: float) -> bool:
        return bool(self.goal.zone[self.grid.cells(np.array([[x, 0.0, z]]))][0])

    def bearings(self, x: float, z: float, heading: float) -> NDArray[np.float64]:
        pose = np.array([x, 0.0, z, heading])
        return goal_bearings(self.scene, self.grid, self.renderer, self.scene_id, self.goal, pose, 0.88)

    def succeeds(self, x: float, z: float, heading: float) -> bool:
        return faces_goal(self.bearings(x, z, heading), HFOV)


@pytest.fixture(scope="module")
def open_place(make_room, renderer: Renderer) -> Place:  # type: ignore[no-untyped-def]
    return Place(make_room(objects=[CHAIR]), renderer)


def test_the_zone_is_what_lies_within_a_metre_of_the_footprint(open_place: Place) -> None:
    rows, cols = np.nonzero(open_place.grid.navigable)
    centers = open_place.grid.positions(rows, cols)
    box = open_place.scene.objects[0].box
    apart = np.linalg.norm(np.maximum(np.maximum(box.low - centers, centers - box.high), 0)[:, [0, 2]], axis=1)
    inside = open_place.goal.zone[rows, cols]
    assert inside[apart < 0.98].all()
    assert not inside[apart > 1.02].any()


@pytest.mark.parametrize("degrees", [20, 45])
def test_in_a_scan_the_zone_is_what_lies_within_a_metre_of_an_object_at_any_angle(
    make_room: Any, renderer: Renderer, degrees: int
) -> None:
    scene = make_room(objects=[("sofa", (2.0, 0.0, 2.55, 4.0, 0.8, 3.45))])
    angle = math.radians(degrees)
    turn = np.array([[math.cos(angle), 0, math.sin(angle)], [0, 1, 0], [-math.sin(angle), 0, math.cos(angle)]])
    own = np.unique(scene.triangles[scene.triangle_objects == 0])
    vertices = scene.vertices.copy()
    vertices[own] = (vertices[own] - [3, 0, 3]) @ turn.T + [3, 0, 3]
    box = Box(vertices[own].min(axis=0).astype(np.float64), vertices[own].max(axis=0).astype(np.float64))
    turned = replace(scene, vertices=vertices, objects=(replace(scene.objects[0], box=box),), level_floors=False)
    place = Place(turned, renderer, "sofa")
    centers = place.grid.positions(*np.nonzero(place.grid.navigable))
    outside = np.abs((centers - [3, 0, 3]) @ turn)[:, [0, 2]] - [1.0, 0.45]
    apart = np.linalg.norm(np.maximum(outside, 0), axis=1)
    inside = place.goal.zone[place.grid.navigable]
    assert inside[apart < 0.96].all()
    assert not inside[apart > 1.02].any()


def test_distance_is_nil_in_the_zone_and_grows_from_its_rim(open_place: Place) -> None:
    positions = np.array([[3.0, 0.0, 2.0], [3.0, 0.0, 0.75]])
    np.testing.assert_allclose(
        distances_at(open_place.grid, open_place.goal.distance, positions), [0.0, 1.0], atol=0.03
    )


@pytest.mark.parametrize(
    ("heading", "found"),
    [
        (math.pi, True),  # the chair is at +z of where we stand
        (math.pi - math.radians(35), True),
        (math.pi + math.radians(35), True),
        (math.pi / 2, False),
        (-math.pi / 2, False),
        (0.0, False),
    ],
)
def test_success_asks_to_face_the_object(open_place: Place, heading: float, found: bool) -> None:
    assert open_place.in_zone(3.0, 2.2)
    assert open_place.succeeds(3.0, 2.2, heading) is found


def test_bearings_are_positive_to_the_left(open_place: Place) -> None:
    assert (open_place.bearings(3.0, 2.0, math.pi - 1.0) > 0).all()
    assert (open_place.bearings(3.0, 2.0, math.pi + 1.0) < 0).all()


def test_outside_of_the_zone_facing_does_not_help(open_place: Place) -> None:
    assert not open_place.succeeds(3.0, 1.2, math.pi)


def test_an_object_behind_a_wall_is_not_found_through_it(make_room, renderer: Renderer) -> None:  # type: ignore[no-untyped-def]
    scene = make_room(walls=[(0.0, 0.0, 2.6, 5.0, 2.5, 2.7)], objects=[CHAIR])
    place = Place(scene, renderer)
    # 0.55 m in front of the chair as the crow flies, but the wall stands between.
    assert place.grid.is_navigable(np.array([[3.0, 0.0, 2.2]]))[0]
    assert not place.in_zone(3.0, 2.2)
    assert not place.succeeds(3.0, 2.2, math.pi)
    assert distances_at(place.grid, place.goal.distance, np.array([[3.0, 0.0, 2.2]]))[0] > 2.0
    assert place.in_zone(3.0, 3.8)
    assert place.succeeds(3.0, 3.8, 0.0)


def test_an_object_seen_over_a_counter_is_not_within_walking_distance(make_room, renderer: Renderer) -> None:  # type: ignore[no-untyped-def]
    low_wall = make_room(walls=[(0.0, 0.0, 2.3, 5.0, 0.6, 2.4)], objects=[CHAIR])
    place = Place(low_wall, renderer)
    assert place.in_zone(3.0, 3.8)
    assert place.grid.is_navigable(np.array([[3.0, 0.0, 2.0]]))[0]
    assert not place.in_zone(3.0, 2.0)
    assert distances_at(place.grid, place.goal.distance, np.array([[3.0, 0.0, 2.0]]))[0] > 2.0


def test_the_nearest_of_several_instances_counts(make_room, renderer: Renderer) -> None:  # type: ignore[no-untyped-def]
    place = Place(make_room(objects=[CHAIR, ("chair", (0.3, 0.0, 0.3, 0.8, 0.8, 0.8)), ("bed", CHAIR[1])]), renderer)
    assert [found.instance.object_id for found in place.goal.objects] == [0, 1]
    assert place.in_zone(1.2, 1.2)
    assert place.in_zone(3.0, 4.0)


def test_an_object_out_of_reach_is_left_out(make_room, renderer: Renderer) -> None:  # type: ignore[no-untyped-def]
    sealed = [
        (2.4, 0.0, 2.4, 3.6, 2.5, 2.5),
        (2.4, 0.0, 3.5, 3.6, 2.5, 3.6),
        (2.4, 0.0, 2.4, 2.5, 2.5, 3.6),
        (3.5, 0.0, 2.4, 3.6, 2.5, 3.6),
    ]
    place = Place(make_room(walls=sealed, objects=[CHAIR]), renderer)
    assert place.goal.objects == ()
    assert not place.goal.zone.any()
    assert np.isinf(place.goal.distance).all()


def test_an_object_on_the_storey_below_does_not_count(make_room: Any, renderer: Renderer) -> None:
    """A gallery 1.6 m above a hall, and a sofa in the hall that one sees over the gallery's edge."""
    gallery, sofa = (0.0, 1.5, 0.0, 6.0, 1.6, 4.0), (6.15, 0.0, 1.0, 6.95, 0.8, 3.0)
    scene = replace(make_room((9.0, 4.0), [gallery], [("sofa", sofa)]), level_floors=False)
    assert not Place(replace(scene, floors=(1.6,)), renderer, "sofa").goal.objects
    assert Place(scene, renderer, "sofa").in_zone(7.5, 2.0)


@pytest.mark.parametrize(("low", "counts"), [(2.1, True), (2.4, False)])
def test_what_hangs_higher_than_a_storey_does_not_count(
    make_room: Any, renderer: Renderer, low: float, counts: bool
) -> None:
    scene = make_room(objects=[("plant", (2.8, low, 2.8, 3.2, low + 0.08, 3.2))])
    assert Place(scene, renderer, "plant").goal.zone.any() == counts


def test_surface_points_lie_on_the_surface(open_place: Place) -> None:
    points = surface_points(open_place.scene, 0)
    box = open_place.scene.objects[0].box
    depth = np.minimum(points - box.low, box.high - points).min(axis=1)
    np.testing.assert_allclose(depth, 0.0, atol=1e-6)
    # Spread: every side of the box has some.
    on_low = (np.abs(points - box.low) < 1e-6).any(axis=0)
    on_high = (np.abs(points - box.high) < 1e-6).any(axis=0)
    assert on_low.all()
    assert on_high.all()
