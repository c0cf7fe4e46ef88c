"""Reads an episode file with Habitat-Lab's own ObjectNav loader and prints what it found, as JSON. Run by Python alone.

Habitat-Lab cannot be imported without habitat-sim and magnum, nor with OpenCV 5, of which the loader uses nothing: the
modules that ask for them are put in place empty.
"""

import gzip
import json
import sys
import types
from typing import Any


def _put_in_place(name: str, is_package: bool = False, **contents: object) -> None:
    module = types.ModuleType(name)
    vars(module).update(contents)
    if is_package:
        module.__path__ = []
    sys.modules[name] = module


def _do_without_habitat_sim() -> None:
    _put_in_place("habitat.sims.habitat_simulator.object_state_machine", ObjectStateMachine=object)
    _put_in_place("habitat.core.batch_rendering.env_batch_renderer", EnvBatchRenderer=object)
    _put_in_place("habitat.tasks.rearrange", is_package=True, _try_register_rearrange_task=lambda: None)
    _put_in_place("habitat.tasks.rearrange.rearrange_sim", add_perf_timing_func=lambda name=None: lambda call: call)
    maps, fog_of_war = types.ModuleType("maps"), types.ModuleType("fog_of_war")
    _put_in_place("habitat.utils.visualizations", is_package=True, maps=maps, fog_of_war=fog_of_war)
    _put_in_place("habitat.utils.visualizations.utils", images_to_video=None, observations_to_image=None)


def main(path: str) -> None:
    _do_without_habitat_sim()
    from habitat.datasets.object_nav.object_nav_dataset import ObjectNavDatasetV1

    dataset: Any = ObjectNavDatasetV1()
    with gzip.open(path, "rt", encoding="utf-8") as file:
        dataset.from_json(file.read())
    episodes = [
        {
            "scene_id": episode.scene_id,
            "object_category": episode.object_category,
            "start_position": list(episode.start_position),
            "start_rotation": list(episode.start_rotation),
            "geodesic_distance": episode.info["geodesic_distance"],
            "goals_key": episode.goals_key,
            "goals": len(episode.goals),
        }
        for episode in dataset.episodes
    ]
    goals = {
        key: [
            [goal.object_id, list(goal.position), [list(view.agent_state.position) for view in goal.view_points]]
            for goal in found
        ]
        for key, found in dataset.goals_by_category.items()
    }
    sys.stdout.write(json.dumps({"episodes": episodes, "goals": goals}))


if __name__ == "__main__":
    main(sys.argv[1])
