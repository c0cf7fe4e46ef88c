"""One policy at several budgets of thinks: how it comes to think more or less, and the curves of that."""

import json
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest
import torch
from typer.testing import CliRunner

from thinknav_sim.task_config import Action
from thinknav_trainer.budget_curve import Curve, Point, gains
from thinknav_trainer.budgets import evaluate_budgets, write_curves
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.cli import app
from thinknav_trainer.config import NEVER, ConfigError, TrainConfig, change_config
from thinknav_trainer.interrupt import Interruption
from thinknav_trainer.policy import ObservationShape, Policy
from thinknav_trainer.records import MEASURES, EpisodeRecord
from thinknav_trainer.run import Run
from thinknav_trainer.scenes import Homes
from thinknav_trainer.train import train
from thinknav_trainer.when_to_think import WhenToThink
from thinknav_trainer.workflow import connect_if_thinking, evaluation_folder, own_split


def record(number: int, thinks: float, spl: float) -> EpisodeRecord:
    values = dict.fromkeys(MEASURES, 0.0) | {"thinks": thinks, "spl": spl}
    return EpisodeRecord(f"e{number}", "home-1", "chair", values, {}, [[0.0] * 4], [0], [], None, None)


def point(name: str, thinks: float, spl: float, spread: float = 0.0) -> Point:
    """Forty episodes, their calls and SPL around a mean."""
    noise = spread * np.linspace(-1, 1, 40)
    return Point(name, [record(number, thinks + each, spl + each / 10) for number, each in enumerate(noise)])


CLOCK = Curve.of("clock", [point("every-5", 20, 0.6), point("every-20", 5, 0.3), point("every-10", 10, 0.4)])


def test_points_are_put_in_the_order_of_their_calls() -> None:
    assert [each.name for each in CLOCK.points] == ["every-20", "every-10", "every-5"]
    assert [row["thinks"]["mean"] for row in CLOCK.table()] == [5, 10, 20]
    assert CLOCK.table()[2]["spl"] == pytest.approx({"mean": 0.6, "low": 0.6, "high": 0.6})


def test_a_gain_is_over_the_other_curve_at_as_many_calls() -> None:
    own = Curve.of("own", [point("a", 7.5, 0.5), point("b", 4.9, 0.9), point("c", 20, 0.5), point("d", 21, 0.9)])
    found = {row.pop("name"): row for row in gains(own, CLOCK)}
    assert found == {
        "a": pytest.approx({"mean": 0.15, "low": 0.15, "high": 0.15}),  # the clock's is 0.35 at 7.5 calls
        "c": pytest.approx({"mean": -0.1, "low": -0.1, "high": -0.1}),
    }
    assert gains(own, Curve.of("none", [])) == []


def test_intervals_of_gains_are_of_episodes() -> None:
    """What all points share from episode to episode takes no part."""
    own = Curve.of("own", [point("a", 10, 0.5, spread=1.0)])
    for spread, narrow in ((0.0, False), (1.0, True)):
        clock = Curve.of("clock", [point("x", 5, 0.4, spread), point("y", 15, 0.4, spread)])
        (row,) = gains(own, clock)
        assert row["mean"] == pytest.approx(0.1)
        assert row["low"] <= 0.1 + 1e-9
        assert row["high"] >= 0.1 - 1e-9
        assert (row["high"] - row["low"] < 1e-6) == narrow


def test_a_bias_moves_the_logit_of_think_alone() -> None:
    policy = Policy(ObservationShape(32, 32, num_actions=5, thought_size=8), TrainConfig().policy)
    before = policy.actor.bias.detach().clone()
    WhenToThink().apply(policy)
    assert torch.equal(policy.actor.bias, before)
    WhenToThink(bias=-1.5).apply(policy)
    assert (policy.actor.bias - before).tolist() == pytest.approx([0, 0, 0, 0, -1.5])
    WhenToThink(every=3).apply(policy)
    assert policy.actor.bias[Action.THINK] == NEVER


@pytest.mark.parametrize(
    ("strategy", "manner", "words"),
    [
        ("never", WhenToThink(every=5), "strategy never cannot think in the manner every-5"),
        ("once", WhenToThink(bias=1), r"strategy once cannot think in the manner bias\+1"),
        ("every_n", WhenToThink(bias=-2), "strategy every_n cannot think in the manner bias-2"),
        ("agent", WhenToThink(bias=1, every=5), "either a bias of thinking or the steps"),
    ],
)
def test_manners_that_a_policy_cannot_take_are_refused(
    smoke: TrainConfig, strategy: str, manner: WhenToThink, words: str
) -> None:
    with pytest.raises(ConfigError, match=words):
        manner.configure(change_config(smoke, overrides=[f"think.strategy={strategy}"]))


def test_as_learnt_every_policy_can_think(smoke: TrainConfig) -> None:
    for strategy in ("never", "agent", "every_n", "once"):
        config = change_config(smoke, overrides=[f"think.strategy={strategy}"])
        assert WhenToThink().configure(config) == config
    clocked = WhenToThink(every=7).configure(change_config(smoke, overrides=["think.budget=0.1"]))
    assert (clocked.think.strategy, clocked.think.every, clocked.think.budget) == ("every_n", 7, None)


def test_a_checkpoint_is_played_at_every_budget(tmp_path: Path, smoke: TrainConfig, homes: Homes) -> None:
    config = change_config(smoke, overrides=["planner.url=privileged", "total_steps=64", "policy.stop_bias=-8"])
    run = Run.create(tmp_path / "run", config)
    with ExitStack() as stack:
        last = train(run, homes, connect_if_thinking(config, stack), Interruption())
    run.close()
    own, clocked = [WhenToThink(bias=-20), WhenToThink(), WhenToThink(bias=3)], [WhenToThink(every=10)]
    folder = evaluation_folder(last, "held_out", "budgets")
    played = own_split(config, "held_out", homes)
    found = evaluate_budgets(last, {"own choice": own, "clock": clocked}, played, folder, Interruption())
    points = [*found["own choice"], *found["clock"]]
    never, learnt, often, clock = [float(each.values("think_rate").mean()) for each in points]
    assert never == 0
    assert 0.1 < learnt < 0.4 < often
    assert clock == pytest.approx(0.1, abs=0.02)
    for each, manner in zip(points, [*own, *clocked], strict=True):
        result = json.loads((folder / manner.name / "result.json").read_text())
        assert result["protocol"]["thinking"] == {"bias": manner.bias, "every": manner.every}
        assert result["summary"]["thinks"]["mean"] == pytest.approx(each.values("thinks").mean())
    assert Checkpoint.load(last).policy["actor.bias"][Action.THINK] > -1  # the file is as it was
    svg = write_curves(folder, {}, [Curve.of(name, each) for name, each in found.items()])
    assert svg.read_text().startswith("<svg")
    written = json.loads((folder / "curves.json").read_text())
    assert [row["name"] for row in written["curves"]["own choice"]] == ["bias-20", "bias+0", "bias+3"]
    assert set(written["gains"]) == {"clock"}


@pytest.fixture(scope="module")
def plain(tmp_path_factory: pytest.TempPathFactory, smoke: TrainConfig, homes: Homes) -> Path:
    """A checkpoint of a policy that cannot think, the quickest to play."""
    folder = tmp_path_factory.mktemp("run")
    run = Run.create(folder, change_config(smoke, overrides=["think.strategy=never", "total_steps=64"]))
    last = train(run, homes, None, Interruption())
    run.close()
    return last


def test_an_interrupted_measurement_ends_with_what_it_has(
    tmp_path: Path, plain: Path, smoke: TrainConfig, homes: Homes
) -> None:
    interrupted = Interruption()
    interrupted.request(2)
    played = own_split(smoke, "held_out", homes)
    assert evaluate_budgets(plain, {"own": [WhenToThink()]}, played, tmp_path / "out", interrupted) == {"own": []}


def test_other_evaluations_are_points_of_a_curve_of_their_own(plain: Path) -> None:
    run = plain.parents[1]
    command = ["budgets", str(plain), "--biases", "0", "--every", ""]
    assert CliRunner().invoke(app, ["eval", str(plain)]).exit_code == 0
    done = CliRunner().invoke(app, [*command, "--against", str(run)])
    assert done.exit_code == 0, done.output
    folder = evaluation_folder(plain, "held_out", "budgets")
    curves = json.loads((folder / "curves.json").read_text())["curves"]
    assert set(curves) == {"own choice", "others"}
    assert curves["others"] == [{**curves["own choice"][0], "name": run.name}]
    done = CliRunner().invoke(app, ["eval", str(plain), "--split", "train", "--output", str(run / "other")])
    assert done.exit_code == 0
    done = CliRunner().invoke(app, [*command, "--against", str(run / "other")])
    assert isinstance(done.exception, ConfigError)
    assert "are of different episodes" in str(done.exception)


@pytest.mark.parametrize(
    ("command", "words"),
    [
        (
            ["--agent", "random", "--think-bias", "-1"],
            "--think-bias: for the policy of a checkpoint",
        ),
        (["--think-bias", "-1"], "think.strategy never cannot think in the manner bias-1"),
        (["--think-every", "5"], "think.strategy never cannot think in the manner every-5"),
        (["--think-bias", "1", "--think-every", "5"], "either a bias of thinking or the steps"),
    ],
)
def test_manners_are_refused_by_the_command_too(plain: Path, command: list[str], words: str) -> None:
    done = CliRunner().invoke(app, ["eval", *command, *([] if "--agent" in command else [str(plain)])])
    assert isinstance(done.exception, ConfigError)
    assert words in str(done.exception)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (["--biases", "-1,often"], "--biases takes numbers separated by commas, not '-1,often'"),
        (["--biases", ""], "--biases names no point"),
        (["--every", "5,0"], "--every takes numbers of steps from 1 on"),
        (["--every", "5.5"], "--every takes numbers separated by commas, not '5.5'"),
        (["--biases", "0,nan"], "a bias of thinking is a finite number, not nan"),
        (["--every", "5", "--biases", "0"], "think.strategy never cannot think in the manner every-5"),
        (["--homes", "val:0-1", "--episodes-file", "x.json"], "either --homes or --episodes-file"),
        (["--homes", "val:0-1", "--split", "train"], "--split: a split of the run is not played where val:0-1 is"),
        (["--episodes", "9"], "--episodes: a split of the run is played whole"),
        (["--against", "absent"], "absent holds no evaluation"),
        (["--output", __file__], "is not a folder"),
    ],
)
def test_budgets_that_cannot_be_played_are_refused_before_any_is(plain: Path, options: list[str], words: str) -> None:
    before = sorted(plain.parents[1].rglob("*"))
    done = CliRunner().invoke(app, ["budgets", str(plain), *options])
    assert isinstance(done.exception, ConfigError)
    assert words in str(done.exception)
    assert sorted(plain.parents[1].rglob("*")) == before
