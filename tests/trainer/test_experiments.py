"""Experiments: what is done once is not done again, what was begun goes on, one failure stops nobody else."""

import json
import signal
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path
from unittest.mock import patch

import pytest

from thinknav_trainer.config import ConfigError
from thinknav_trainer.experiments import (
    EXPERIMENTS,
    AgentRow,
    Arm,
    Wanted,
    named_experiment,
    run_experiment,
    work,
    write_results,
)
from thinknav_trainer.experiments.downsample import learning_curve
from thinknav_trainer.experiments.job import Job, jobs_of
from thinknav_trainer.experiments.ledger import Ledger
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.records import read_evaluation

FIRST_LIGHT = named_experiment("first-light")
SMALL = replace(FIRST_LIGHT.smoked(), rows=(AgentRow("walker", "bump-walker"),))
BROKEN = replace(SMALL, rows=(), arms=(Arm("broken", ("scenes.scans=[nowhere.glb]",)), *SMALL.arms[:1]))


def test_every_arm_of_every_experiment_is_a_configuration_of_its_own() -> None:
    for experiment in EXPERIMENTS.values():
        forms = [experiment, experiment.smoked(), *([experiment.quickened()] if experiment.quick else [])]
        for form in forms:
            jobs = jobs_of(form, seeds=2)
            assert len({job.digest for job in jobs}) == len(jobs) == len({job.key for job in jobs})
            assert len({job.name for job in jobs}) == len(jobs)
        assert {arm.over for arm in experiment.arms} - {None} <= {arm.name for arm in experiment.arms}
    with pytest.raises(ConfigError, match="there is no experiment 'last-light'; there are first-light"):
        named_experiment("last-light")
    with pytest.raises(ConfigError, match="has no arm 'led'; it has privileged, shuffled"):
        FIRST_LIGHT.with_arms(["led"])


def test_first_light_differs_in_nothing_but_whose_answer_it_is() -> None:
    led, control = (FIRST_LIGHT.config(arm, 0) for arm in FIRST_LIGHT.arms)
    assert (led.planner.privileged.shuffled, control.planner.privileged.shuffled) == (False, True)
    straight = control.planner.privileged.model_copy(update={"shuffled": False})
    assert control.model_copy(update={"planner": control.planner.model_copy(update={"privileged": straight})}) == led
    assert led.planner.knows_the_map
    assert (led.total_steps, led.think.reward) == (160_000, "think_cost")


def test_single_has_the_arms_and_seeds_it_should(tmp_path: Path) -> None:
    single = named_experiment("single")
    jobs = jobs_of(single)
    seeds = {arm.name: sum(job.arm == arm.name for job in jobs) for arm in single.arms}
    assert {name for name, count in seeds.items() if count == 5} == {
        "never",
        "agent-paper",
        "agent-cloned",
        "agent-cloned-deaf",
        "never-taught",
    }
    assert set(seeds.values()) == {3, 5}
    over = {arm.name: arm.over for arm in single.arms}
    assert (over["agent-cloned-deaf"], over["agent-paper-random"]) == ("agent-cloned", "agent-paper")
    configs = {arm.name: single.config(arm, 0) for arm in single.arms}
    assert over["never-taught"] == "agent-cloned"
    taught, cloned = configs["never-taught"], configs["agent-cloned"]
    assert taught.think.strategy == "never"
    assert taught.warm_start.model_copy(update={"demonstrator": "planner"}) == cloned.warm_start
    assert taught.ppo == cloned.ppo
    assert configs["never-1m"].total_steps == 1_000_000
    assert configs["agent-foresight-480k"].total_steps == 480_000
    assert configs["agent-cloned-deaf"].planner.control == "deaf"
    assert configs["agent-paper-random"].planner.control == "random"
    assert configs["privileged-0.3"].planner.privileged.error == 0.3
    eyes = {config.policy.model_copy(update={"think_bias": 0.0}).model_dump_json() for config in configs.values()}
    assert len(eyes) == 1
    # One seed of every arm, then the next.
    trained = [job.seed for job in jobs if job.agent is None]
    assert trained == sorted(trained)


def test_a_digest_knows_what_matters_and_not_the_machine(tmp_path: Path) -> None:
    [job] = jobs_of(replace(SMALL, rows=(), arms=SMALL.arms[:1]), seeds=1)
    elsewhere = job.config.model_copy(update={"threads": 1, "keep_checkpoints": 9})
    assert replace(job, config=elsewhere).digest == job.digest
    assert replace(job, config=job.config.model_copy(update={"total_steps": 7})).digest != job.digest
    assert replace(job, agent="random").digest != job.digest
    job.write(tmp_path / "job.json")
    assert Job.read(tmp_path / "job.json") == job


def test_an_experiment_is_interrupted_goes_on_and_is_not_done_twice(tmp_path: Path) -> None:
    runs, results = tmp_path / "runs", tmp_path / "results"
    wanted = Wanted(seeds=2, overrides=("planner.privileged.error=0.5",))
    stopped = Interruption()
    stopped.request(2)
    assert run_experiment(SMALL, runs, results, stopped, wanted).page is None
    done = run_experiment(SMALL, runs, results, Interruption(), wanted)
    assert (done.page, done.failures) == (results / "first-light-smoke.md", [])
    result = json.loads((results / "first-light-smoke.json").read_text())
    assert result["protocol"]["command"].endswith(" --set planner.privileged.error=0.5")
    assert result["protocol"]["overrides"]["all"][-1] == "planner.privileged.error=0.5"
    write_results(SMALL, results, replace(wanted, seeds=1))  # what is there is told, whatever is wanted
    assert json.loads((results / "first-light-smoke.json").read_text()) == result
    with patch.object(work, "train_run", side_effect=AssertionError("it was trained before")):
        # The ledger alone is enough; so are the runs alone.
        assert run_experiment(SMALL, tmp_path / "none", results, Interruption(), wanted).failures == []
        assert run_experiment(SMALL, runs, tmp_path / "again", Interruption(), wanted).failures == []
        other = replace(wanted, overrides=("ppo.lr=1e-4",))
        failed = run_experiment(SMALL, tmp_path / "other", tmp_path / "elsewhere", Interruption(), other).failures
        assert [failure.words for failure in failed] == ["AssertionError: it was trained before"] * 4
        assert "it was trained before" in failed[0].log.read_text()
    again = json.loads((tmp_path / "again" / "first-light-smoke.json").read_text())
    assert again["arms"] == result["arms"]
    told, records = read_evaluation(next(runs.glob("shuffled-1-*")) / "evaluation")
    assert result["arms"]["shuffled"]["steps"]["per_seed"][1] == pytest.approx(told["summary"]["steps"]["mean"], 1e-4)
    assert told["protocol"]["planner"] == "privileged@shortest-path.error-0.5.shuffled"
    assert result["protocol"]["privileged_planner"] == {"privileged": True, "shuffled": True}
    assert result["agents"]["walker"]["success"] == 0
    masked, own = read_evaluation(next(runs.glob("privileged-0-*")) / "masked")
    assert masked["protocol"]["control"] == "zeros"
    assert result["masked"]["privileged"]["success"]["per_seed"][0] == pytest.approx(
        sum(record.measures["success"] for record in own) / len(records), abs=1e-4
    )


def test_some_arms_and_fewer_seeds_are_trained_and_all_that_is_done_is_written_down(tmp_path: Path) -> None:
    two = replace(SMALL, rows=(), seeds=2)
    line = {"version": "0.1.0", "commit": "abc", "wall_seconds": 60, "split": "held_out", "episodes": 3}
    line |= {"scenes": ["home-0"], "planner": None, "privileged": False, "curve": {"steps": []}}
    line["measures"] = {"success": 0.5, "spl": 0.5}
    trained: list[tuple[str, int]] = []

    def do(job: Job, *_: object) -> dict[str, object]:
        trained.append((job.arm, job.seed))
        return {"arm": job.arm, "seed": job.seed, "digest": job.digest, "agent": None, **line}

    with patch("thinknav_trainer.experiments.running.do_job", do):
        for wanted in (Wanted(seeds=3), Wanted(arms=("shuffled",), seeds=1), Wanted(arms=("privileged",), seeds=4)):
            run_experiment(two, tmp_path / "runs", tmp_path, Interruption(), wanted)
        with pytest.raises(ConfigError, match="has no arm 'led'"):
            run_experiment(two, tmp_path / "runs", tmp_path, Interruption(), Wanted(arms=("led",)))
    assert trained == [(arm, seed) for seed in range(3) for arm in ("privileged", "shuffled")] + [("privileged", 3)]
    told = json.loads((tmp_path / "first-light-smoke.json").read_text())["protocol"]
    assert told["seeds"] == {"privileged": [0, 1, 2, 3], "shuffled": [0, 1, 2]}
    assert told["seeds_wanted"] == {"privileged": 2, "shuffled": 2}


def test_a_run_made_with_other_defaults_is_not_taken_for_ones_own(tmp_path: Path) -> None:
    one = replace(SMALL, rows=(), arms=SMALL.arms[:1])
    run_experiment(one, tmp_path, tmp_path / "results", Interruption())
    kept = next(tmp_path.glob("privileged-0-*")) / "config.yaml"
    kept.write_text(kept.read_text().replace("stop_bias: -4.0", "stop_bias: -3.0"))
    [failure] = run_experiment(one, tmp_path, tmp_path / "others", Interruption()).failures
    assert "made with other defaults than today's" in failure.words


def test_runs_side_by_side_fail_alone(tmp_path: Path) -> None:
    done = run_experiment(BROKEN, tmp_path / "runs", tmp_path, Interruption(), Wanted(jobs=2))
    [failure] = done.failures
    assert failure.job.arm == "broken"
    assert "nowhere.glb" in failure.words
    [line] = [json.loads(text) for text in (tmp_path / "first-light-smoke.runs.jsonl").read_text().splitlines()]
    assert (line["arm"], line["seed"], line["episodes"]) == ("privileged", 0, 3)
    assert line["wall_seconds"] >= 0
    assert line["config"]["total_steps"] == 128
    assert "threads" not in line["config"]
    assert done.page is not None
    assert "**Not all is done yet**; seeds so far: broken (0 of 1)." in done.page.read_text()


def test_a_signal_stops_all_and_the_same_command_goes_on(tmp_path: Path) -> None:
    program = (
        "import sys, logging; logging.basicConfig(level=logging.INFO)\n"
        "sys.argv = ['thinknav', 'experiment', 'first-light', '--smoke', '--arms', 'privileged', '--jobs', '2', "
        "'--set', 'total_steps=1000000', '--results', 'results']\n"
        "from thinknav_trainer.cli import main; main()"
    )
    process = subprocess.Popen(
        [sys.executable, "-c", program], cwd=tmp_path, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    )
    metrics = tmp_path / "runs" / "first-light-smoke"
    deadline = time.monotonic() + 240
    while not any(path.stat().st_size for path in metrics.glob("*/metrics.jsonl")) and time.monotonic() < deadline:
        assert process.poll() is None
        time.sleep(0.2)
    process.send_signal(signal.SIGTERM)
    assert process.wait(120) == 128 + signal.SIGTERM
    [run] = metrics.glob("privileged-0-*")
    assert sorted((run / "checkpoints").glob("*.pt"))[-1].name != "0000000000.pt"
    assert not (run / "line.json").exists()
    assert not (tmp_path / "results").exists()
    assert (run / "run.log").stat().st_size


def test_a_curve_has_few_points_and_keeps_the_means() -> None:
    rows = [{"steps": 100.0 * (n + 1), "success": n / 1000, "reward/slack": -1.0} for n in range(1000)]
    del rows[0]["success"]
    curve = learning_curve(rows)
    assert {len(values) for values in curve.values()} == {40}
    assert curve["steps"][-1] == 100_000
    assert curve["success"][-1] == pytest.approx(0.9865, abs=0.002)
    assert set(curve["reward/slack"]) == {-1.0}
    assert set(curve["spl"]) == {None}
    assert learning_curve([]) == {"steps": []}


def test_a_ledger_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    (tmp_path / "x.runs.jsonl").write_text('{"arm":"a","seed":0,"digest":"d"}\n{"arm"')
    with pytest.raises(ConfigError, match=r"x\.runs\.jsonl, line 2 is no line of a ledger"):
        Ledger(tmp_path, "x")


def test_a_line_is_added_to_a_ledger_whose_last_has_no_end(tmp_path: Path) -> None:
    (tmp_path / "x.runs.jsonl").write_text('{"arm":"a","seed":0,"digest":"d"}')
    Ledger(tmp_path, "x").add({"arm": "a", "seed": 1, "digest": "e"})
    assert len(Ledger(tmp_path, "x")) == 2
    (tmp_path / "x.runs.jsonl").write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="is no ledger"):
        Ledger(tmp_path, "x")


def test_an_empty_ledger_gives_no_table(tmp_path: Path) -> None:
    assert write_results(SMALL, tmp_path) is None
