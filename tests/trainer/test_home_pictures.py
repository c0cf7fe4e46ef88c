"""The plan and views of a home."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from thinknav_sim.homes import generate_home
from thinknav_sim.navigation import NavigationGrid
from thinknav_sim.render import make_renderer
from thinknav_trainer.report.floor_map import GOAL_COLOR, draw_floor_map
from thinknav_trainer.report.home_pictures import draw_plan, write_home_pictures


@pytest.mark.parametrize("rooms", [1, 2, 6])
def test_a_plan_and_four_different_views(tmp_path: Path, rooms: int) -> None:
    scene = generate_home(7, rooms)
    paths = write_home_pictures(scene, tmp_path / "pictures")
    assert [path.name for path in paths] == [
        f"home-7-{rooms}-{name}.png" for name in ("plan", "view-1", "view-2", "view-3", "view-4")
    ]
    views = [np.asarray(Image.open(path)) for path in paths[1:]]
    for number, view in enumerate(views):
        assert view.shape == (576, 768, 3)
        assert view.std() > 20, "a view of a bare wall"
        assert all(np.abs(view.astype(int) - other).mean() > 5 for other in views[:number])


def test_goals_are_framed_on_the_plan() -> None:
    scene, renderer = generate_home(7, 2), make_renderer()
    floor_map = draw_floor_map(scene, renderer, NavigationGrid.from_scene(scene, renderer), 0.18)
    plan = draw_plan(scene, floor_map)
    (bed,) = scene.objects_of("bed")
    x, y = (round(value) for value in floor_map.pixel(bed.box.low[0], bed.box.center[2]))
    assert (np.asarray(plan)[y - 3 : y + 4, x - 3 : x + 4] == GOAL_COLOR).all(axis=-1).any()
    assert plan.size == floor_map.image.size
