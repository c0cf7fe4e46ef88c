"""Which views are kept for a planner, against what turning and walking should give."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from thinknav_trainer.views import RecentViews, differ


def _pose(degrees: float, x: float = 0.0, z: float = 0.0) -> NDArray[np.float64]:
    return np.array([x, 0.0, z, math.radians(degrees)])


def test_turning_by_tens_keeps_every_third_view() -> None:
    views: RecentViews[int] = RecentViews(4)
    for turned in range(0, 100, 10):
        views.see(_pose(turned), turned)
    shown = views.before(_pose(100))
    assert [view for view, _ in shown] == [0, 30, 60]  # 90 is the present view
    assert [round(math.degrees(heading)) for _, heading in shown] == [-100, -70, -40]


def test_heading_is_relative_and_left_is_positive() -> None:
    views: RecentViews[str] = RecentViews(1)
    views.see(_pose(170), "left of it")
    ((_, heading),) = views.before(_pose(-150))
    assert math.degrees(heading) == pytest.approx(-40)


def test_walking_straight_keeps_a_view_each_metre() -> None:
    views: RecentViews[int] = RecentViews(8)
    for step in range(13):
        views.see(_pose(0, z=-0.25 * step), step)
    assert [view for view, _ in views.before(_pose(0, z=-3.0))] == [0, 4, 8]


def test_looking_back_and_forth_keeps_no_view_twice() -> None:
    views: RecentViews[int] = RecentViews(4)
    for step, heading in enumerate([0, 30, 0, 30, 0, 30, 60]):
        views.see(_pose(heading), step)
    assert [view for view, _ in views.before(_pose(90))] == [0, 1, 6]


def test_a_new_episode_knows_nothing() -> None:
    views: RecentViews[int] = RecentViews(4)
    views.see(_pose(0), 0)
    views.forget()
    assert views.before(_pose(90)) == []


def test_no_views_are_kept_when_none_are_shown() -> None:
    views: RecentViews[int] = RecentViews(0)
    assert not views.is_new(_pose(0))
    views.see(_pose(0), 0)
    assert views.before(_pose(90)) == []


@given(
    st.integers(1, 5),
    st.lists(st.tuples(st.integers(-18, 17), st.floats(-5, 5), st.floats(-5, 5)), min_size=1, max_size=30),
)
def test_shown_views_differ_from_each_other_and_from_the_present_one(
    count: int, walk: list[tuple[int, float, float]]
) -> None:
    poses = [_pose(10 * turns, x, z) for turns, x, z in walk]
    views: RecentViews[int] = RecentViews(count)
    for index, pose in enumerate(poses[:-1]):
        views.see(pose, index)
    shown = [index for index, _ in views.before(poses[-1])]
    assert len(shown) <= count
    assert shown == sorted(shown)
    seen = [poses[index] for index in shown] + [poses[-1]]
    assert all(differ(one, other) for i, one in enumerate(seen) for other in seen[:i])
