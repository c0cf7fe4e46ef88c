"""Experiments: what is done once is not done again, what was begun goes on, and the table holds what was measured."""

import json
from pathlib import Path
from unittest.mock import patch

import pytest

from thinknav_trainer.config import ConfigError, TrainConfig
from thinknav_trainer.experiments import EXPERIMENTS, Outcome, named_experiment, run_experiment, running, write_table
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.records import EpisodeRecord, read_evaluation

FIRST_LIGHT = named_experiment("first-light")


def test_every_arm_of_every_experiment_is_a_configuration_of_its_own() -> None:
    for experiment in EXPERIMENTS.values():
        configs = [experiment.config(arm, seed) for arm in experiment.arms for seed in range(2)]
        assert len({config.model_dump_json() for config in configs}) == len(configs)
    with pytest.raises(ConfigError, match="there is no experiment 'last-light'; there are first-light"):
        named_experiment("last-light")


def test_first_light_differs_in_nothing_but_whose_answer_it_is() -> None:
    led, control = (FIRST_LIGHT.config(arm, 0) for arm in FIRST_LIGHT.arms)
    assert (led.planner.privileged.shuffled, control.planner.privileged.shuffled) == (False, True)
    straight = control.planner.privileged.model_copy(update={"shuffled": False})
    assert control.model_copy(update={"planner": control.planner.model_copy(update={"privileged": straight})}) == led
    assert led.planner.knows_the_map
    assert (led.total_steps, led.think.reward) == (160_000, "think_cost")


def test_an_experiment_is_interrupted_goes_on_and_is_not_done_twice(tmp_path: Path) -> None:
    overrides = ["total_steps=128", "planner.privileged.error=0.5"]
    stopped = Interruption()
    stopped.request(2)
    assert run_experiment(FIRST_LIGHT, tmp_path, 2, stopped, overrides, smoke=True) is None
    assert not (tmp_path / "result.json").exists()
    [begun] = tmp_path.iterdir()
    page = run_experiment(FIRST_LIGHT, tmp_path, 2, Interruption(), overrides, smoke=True)
    assert page == tmp_path / "result.md"
    assert begun in tmp_path.glob("privileged-0-*")
    assert len(list(tmp_path.glob("*/evaluation/result.json"))) == 4
    first = (tmp_path / "result.json").read_text()
    with patch.object(running, "train_run", side_effect=AssertionError("it was trained before")):
        run_experiment(FIRST_LIGHT, tmp_path, 2, Interruption(), overrides, smoke=True)
        assert (tmp_path / "result.json").read_text() == first
        with pytest.raises(AssertionError, match="trained before"):
            run_experiment(FIRST_LIGHT, tmp_path, 2, Interruption(), [*overrides, "ppo.lr=1e-4"], smoke=True)
    # A default that has changed since then.
    kept = begun / "config.yaml"
    kept.write_text(kept.read_text().replace("stop_bias: -4.0", "stop_bias: -3.0"))
    with pytest.raises(ConfigError, match="made with other defaults than today's"):
        run_experiment(FIRST_LIGHT, tmp_path, 2, Interruption(), overrides, smoke=True)
    result = json.loads(first)
    told, _ = read_evaluation(next(tmp_path.glob("shuffled-1-*")) / "evaluation")
    assert result["arms"]["shuffled"]["steps"]["per_seed"][1] == told["summary"]["steps"]["mean"]
    assert told["protocol"]["planner"] == "privileged@shortest-path.error-0.5.shuffled"
    assert result["protocol"]["privileged_planner"] == {"privileged": True, "shuffled": True}
    assert "The planner is privileged in: privileged, shuffled." in page.read_text()


def record(success: float) -> EpisodeRecord:
    measures = dict.fromkeys(("spl", "soft_spl", "distance_to_goal", "sot", "steps", "thinks", "think_rate"), 0.5)
    return EpisodeRecord("0", "home-0", "chair", {"success": success} | measures, {}, [], [], [], None, None)


def test_the_table_has_means_and_intervals_over_seeds(tmp_path: Path, smoke: TrainConfig) -> None:
    def outcomes(seeds: int) -> list[Outcome]:
        won = {"privileged": (1.0, 0.5, 1.0), "shuffled": (0.0, 0.0, 0.0)}
        return [
            Outcome(arm, seed, smoke, [record(won[arm][seed]), record(1.0 if arm == "privileged" else 0.0)])
            for seed in range(seeds)
            for arm in won
        ]

    page = write_table(tmp_path, FIRST_LIGHT, outcomes(3))
    row = json.loads((tmp_path / "result.json").read_text())["arms"]["privileged"]["success"]
    # Student's t for three seeds is 4.303, the deviation 0.1443.
    assert row.pop("per_seed") == [1, 0.75, 1]
    assert row == pytest.approx({"mean": 11 / 12, "low": 0.5581, "high": 1.2752}, abs=1e-3)
    assert "| privileged | 0.917 (0.558 to 1.275) | 0.500 (0.500 to 0.500) |" in page.read_text()
    write_table(tmp_path, FIRST_LIGHT, outcomes(1))
    row = json.loads((tmp_path / "result.json").read_text())["arms"]["privileged"]["success"]
    assert (row["mean"], row["low"], row["high"]) == (1, None, None)
    assert "| privileged | 1.000 | 0.500 |" in page.read_text()
