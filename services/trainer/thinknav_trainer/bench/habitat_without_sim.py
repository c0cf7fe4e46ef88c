"""Lets Habitat-Baselines be imported where Habitat-Sim, Magnum and torchvision are not: its PPO trainer needs none.

Some modules of theirs import them for what is not used here; those are put in place as empty ones, before the import.
"""

import sys
from types import ModuleType
from typing import Any

# Each module, and the names that others import from it.
_MODULES: dict[str, tuple[str, ...]] = {
    "habitat.sims.habitat_simulator.object_state_machine": ("ObjectStateMachine",),
    "habitat.core.batch_rendering.env_batch_renderer": ("EnvBatchRenderer",),
    "habitat.tasks.rearrange": (),
    "habitat.tasks.rearrange.rearrange_sim": (),
    "habitat.tasks.rearrange.rearrange_sensors": ("GfxReplayMeasure",),
    "habitat.tasks.rearrange.utils": ("write_gfx_replay",),
    "habitat.tasks.nav.instance_image_nav_task": ("InstanceImageGoalSensor",),
    "habitat_baselines.rl.hrl.hierarchical_policy": ("HierarchicalPolicy",),
    "habitat_baselines.rl.ver.ver_trainer": ("VERTrainer",),
    "habitat_baselines.il.trainers.eqa_cnn_pretrain_trainer": ("EQACNNPretrainTrainer",),
    "habitat_baselines.il.trainers.pacman_trainer": ("PACMANTrainer",),
    "habitat_baselines.il.trainers.vqa_trainer": ("VQATrainer",),
    "torchvision": (),
    "torchvision.transforms": (),
    "torchvision.transforms.functional": (),
}


class _Absent:
    """In the place of a class that is not used. cls_uuid: what sensors and measures are looked up by."""

    cls_uuid = "absent"


def _nothing(*_: Any, **__: Any) -> None:
    """In the place of a function that does nothing that matters here."""


def put_in_place() -> None:
    """Before anything of Habitat is imported."""
    for name, contents in _MODULES.items():
        module = ModuleType(name)
        module.__path__ = []
        vars(module).update(dict.fromkeys(contents, _Absent))
        sys.modules[name] = module
        package, _, last = name.rpartition(".")
        if package in _MODULES:
            setattr(sys.modules[package], last, module)
    vars(sys.modules["habitat.tasks.rearrange"])["_try_register_rearrange_task"] = _nothing
    vars(sys.modules["habitat.tasks.rearrange.rearrange_sim"])["add_perf_timing_func"] = lambda *_: lambda timed: timed
