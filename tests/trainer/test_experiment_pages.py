"""What is written down of an experiment: from lines of a ledger to the result file, the table and the curves."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.cli import app
from thinknav_trainer.config import ConfigError, load_config
from thinknav_trainer.experiments import AgentRow, named_experiment, write_results
from thinknav_trainer.experiments.figure import PANELS
from thinknav_trainer.experiments.headline import EXPERIMENTS, ROWS, with_headline
from thinknav_trainer.experiments.job import jobs_of
from thinknav_trainer.experiments.ledger import Ledger
from thinknav_trainer.experiments.named import SIMPLEST
from thinknav_trainer.experiments.results_page import with_tables
from thinknav_trainer.experiments.summary import summarize
from thinknav_trainer.experiments.work import hears_its_planner
from thinknav_trainer.scenes import make_homes
from thinknav_trainer.simple_homes import rank_homes

DOCS = Path(__file__).parents[2] / "docs"
SINGLE = named_experiment("single")
SHORT = replace(SINGLE.with_arms(["never", "agent-paper", "agent-cloned"]), rows=(AgentRow("planner-only", "planner"),))
SUCCESS = {
    "never": (0.1, 0.2, 0.3, 0.2, 0.2),
    "agent-paper": (0.2, 0.1, 0.3),
    "agent-cloned": (0.8, 0.7, 0.6),
    "planner-only": (0.65,),
}


def measures(success: float, thinks: bool = True) -> dict[str, float | None]:
    told: dict[str, float | None] = {"success": success, "spl": success / 2, "soft_spl": success / 2, "sot": 0.1}
    told |= {"distance_to_goal": 4 - success, "steps": 250.0, "thinks": 25.0 * thinks, "think_rate": 0.1 * thinks}
    told |= {"think_loops": 0.0, "spinning": 0.25, "agreement_share": 0.0}
    told |= {"calls_per_success": 25 * thinks / success if success else None}
    return told | {"reward/success": 3.0, "reward/slack": -1.0}


def fill(folder: Path) -> Ledger:
    """A ledger as runs would leave it."""
    ledger = Ledger(folder, SHORT.full_name)
    curve = {"steps": [100.0, 200.0, 300.0]}
    curve |= {name: [0.0, 0.1, 0.2] for name in PANELS}
    for job in jobs_of(SHORT):
        if job.seed >= len(SUCCESS[job.arm]):
            continue
        thinks = job.arm != "never"
        line: dict[str, Any] = {"arm": job.arm, "seed": job.seed, "digest": job.digest, "agent": job.agent}
        line |= {"version": "0.1.0", "commit": "abc", "wall_seconds": 1800, "split": "held_out", "episodes": 100}
        line |= {"scenes": ["home-0"], "planner": "embedded@1" if thinks else None, "privileged": False}
        line["measures"] = measures(SUCCESS[job.arm][job.seed], thinks)
        if not job.agent:
            line["curve"] = curve
            line |= {name: measures(0.0) if thinks else None for name in ("masked", "shuffled")}
        ledger.add(line)
    return ledger


def test_the_result_file_has_the_form_that_was_agreed(tmp_path: Path) -> None:
    fill(tmp_path)
    page = write_results(SHORT, tmp_path)
    assert page == tmp_path / "single.md"
    result = json.loads((tmp_path / "single.json").read_text())
    assert list(result)[:3] == ["protocol", "arms", "ratios"]
    assert result["protocol"]["agent-best"] == "agent-cloned"
    assert result["arms"]["never"]["success"]["per_seed"] == list(SUCCESS["never"])
    # Student's t for five seeds is 2.776, the deviation 0.0707.
    assert result["arms"]["never"]["success"]["mean"] == pytest.approx(0.2)
    assert result["arms"]["never"]["success"]["low"] == pytest.approx(0.2 - 2.776 * 0.0707 / 5**0.5, abs=1e-3)
    ratio = result["ratios"]["agent-best/never"]["spl"]
    assert set(ratio) == {"mean", "low", "high"}
    assert ratio["mean"] == pytest.approx(3.5)
    assert 2 < ratio["low"] < 3.5 < ratio["high"] < 6.5
    assert set(result["ratios"]) == {"agent-best/never", "agent-paper/never"}
    assert result["differences"]["agent-best/never"]["success"]["mean"] == pytest.approx(0.5)
    assert set(result["masked"]) == set(result["shuffled"]) == {"agent-paper", "agent-cloned"}
    assert result["masked"]["agent-cloned"]["calls_per_success"]["mean"] is None
    # All calls over all successes, not the mean of 125, 250 and 83.
    assert result["arms"]["agent-paper"]["calls_per_success"]["mean"] == pytest.approx(25 / 0.2)
    assert result["agents"]["planner-only"]["success"] == 0.65
    assert result["protocol"]["seeds"]["agent-paper"] == [0, 1, 2]
    assert result["protocol"]["same_rgb_features"] is True


def line_of(name: str, seed: int, success: float) -> dict[str, Any]:
    """What a ledger says of a run, as far as it is compared."""
    return {
        **{"arm": name, "seed": seed, "agent": None, "version": "1", "commit": "a", "planner": None},
        **{"privileged": False, "split": "held_out", "episodes": 9, "scenes": ["h"], "wall_seconds": 1},
        "measures": measures(success),
    }


@pytest.mark.parametrize(
    ("experiment", "names", "pairs"),
    [
        ("single", ["never", "agent-cloned", "never-480k", "agent-cloned-480k", "never-1m"], "480k"),
        ("five", ["never", "agent-cloned", "never-memory", "agent-cloned-memory", "never-1m"], "memory"),
    ],
)
def test_arms_with_more_steps_or_sensors_stand_over_a_baseline_that_has_them(
    experiment: str, names: list[str], pairs: str
) -> None:
    lines = [
        line_of(name, seed, success)
        for name, success in zip(names, (0.2, 0.8, 0.4, 0.9, 0.6), strict=True)
        for seed in range(3)
    ]
    found = summarize(named_experiment(experiment).with_arms(names), lines)["ratios"]
    assert set(found) == {"agent-best/never", f"agent-cloned-{pairs}/never-{pairs}"}
    assert found[f"agent-cloned-{pairs}/never-{pairs}"]["success"]["mean"] == pytest.approx(2.25)


def test_of_two_baselines_alike_the_later_stands_over_the_first_and_never_the_other_way_round() -> None:
    names = ["never", "never-480k", "never-taught-480k", "agent-foresight-480k"]
    lines = [line_of(name, 0, success) for name, success in zip(names, (0.2, 0.4, 0.6, 0.8), strict=True)]
    found = summarize(named_experiment("single"), lines)["ratios"]
    first, second, third = names[1:]
    assert set(found) == {f"{second}/{first}", f"{third}/{first}", f"{third}/{second}"}
    assert found[f"{third}/{second}"]["success"]["mean"] == pytest.approx(4 / 3, abs=1e-3)


def test_what_follows_imitation_stands_over_it() -> None:
    names = ["agent-cloned", "agent-imitation", "agent-cloned-memory", "agent-imitation-memory", "never"]
    lines = [line_of(name, 0, success) for name, success in zip(names, (0.6, 0.8, 0.9, 0.6, 0.3), strict=True)]
    unseen = named_experiment("unseen")
    found = summarize(unseen, lines)["ratios"]
    assert set(found) == {"agent-best/never", *(f"{of}/{over}" for of, over in (names[:2], names[2:4]))}
    assert found["agent-cloned/agent-imitation"]["success"]["mean"] == pytest.approx(0.75)
    assert found["agent-cloned-memory/agent-imitation-memory"]["success"]["mean"] == pytest.approx(1.5)
    assert set(summarize(unseen, lines[:1] + lines[4:])["ratios"]) == {"agent-best/never"}


def test_the_table_says_what_it_is(tmp_path: Path) -> None:
    fill(tmp_path)
    page = write_results(SHORT, tmp_path)
    assert page is not None
    text = page.read_text()
    assert "thinknav reproduce single\n" in text
    assert "seeds so far: agent-paper (3 of 5), agent-cloned (3 of 5)." in text
    assert "| never | 5 | 0.20 (0.11 to 0.29) | 0.10 (" in text
    assert "| agent-cloned (= agent-best) | 3 |" in text
    assert "| *planner-only* | no training | 0.65 |" in text
    assert "| agent-cloned | 0.35 (0.23 to 0.47) | 0.00 (0.00 to 0.00) | 0.00 (0.00 to 0.00) |" in text
    assert "| never | -1.00 (25%) | +3.00 (75%) |" in text
    assert "| agent-cloned | `warm_start.steps=40000` `ppo.entropy_coef=0.003` `ppo.lr=2.5e-4`" in text
    assert "2.0 hours" not in text
    assert "6.0 hours of processes in all" in text
    short = write_results(SHORT.with_arms(["never"]), tmp_path)
    assert short is not None
    assert "Not all is done yet" not in short.read_text()
    assert "Over the baseline" not in short.read_text()


def test_the_curves_are_drawn_and_the_same_every_time(tmp_path: Path) -> None:
    fill(tmp_path)
    write_results(SHORT, tmp_path)
    first = [(tmp_path / f"single-curves.{ending}").read_bytes() for ending in ("svg", "png")]
    assert first[1].startswith(b"\x89PNG")
    for words in ("Success", "SoftSPL", "never (5 seeds)", "agent-cloned, agent-best (3 seeds)", "steps of training"):
        assert words in first[0].decode()
    write_results(SHORT, tmp_path)
    assert [(tmp_path / f"single-curves.{ending}").read_bytes() for ending in ("svg", "png")] == first


def test_other_configurations_do_not_count(tmp_path: Path) -> None:
    ledger = fill(tmp_path)
    text = ledger.path.read_text().replace('"digest":"', '"digest":"0')
    ledger.path.write_text(text)
    assert write_results(SHORT, tmp_path) is None


def test_the_page_takes_the_tables_in(tmp_path: Path) -> None:
    fill(tmp_path / "results")
    write_results(SHORT, tmp_path / "results")
    page = with_tables((DOCS / "results.md").read_text(), tmp_path / "results")
    assert "### Over the baseline" in page
    assert "](results/single-curves.svg)" in page
    assert "](metrics.md#is-a-bonus-farmed)" in page
    assert "over the preset" not in page
    assert page.count("Nothing has been run yet.") == 2
    assert with_tables(page, tmp_path / "results") == page


def test_the_results_page_is_the_one_of_the_result_files() -> None:
    page = (DOCS / "results.md").read_text()
    command = "python -m thinknav_trainer.experiments.results_page docs/results.md"
    assert with_tables(page, DOCS / "results") == page, command


def test_the_headline_is_the_one_of_the_result_files() -> None:
    readme = (DOCS.parent / "README.md").read_text()
    command = "python -m thinknav_trainer.experiments.headline README.md"
    assert with_headline(readme, DOCS / "results") == readme, command
    known = {arm.name for name in EXPERIMENTS for arm in named_experiment(name).arms} | {"planner-only"}
    assert set(ROWS) <= known


def test_the_headline_tells_of_arms_and_agents_as_far_as_there_are(tmp_path: Path) -> None:
    fill(tmp_path)
    write_results(SHORT, tmp_path)
    for name in EXPERIMENTS:
        (tmp_path / f"{name}.json").write_bytes((tmp_path / "single.json").read_bytes())
    page = with_headline("a\n<!-- headline: begin -->\nold\n<!-- headline: end -->\nb\n", tmp_path)
    assert page.startswith("a\n<!-- headline: begin -->\n\n| success, SPL (seeds) | one home, 160,000 steps |")
    assert page.endswith("|\n\n<!-- headline: end -->\nb\n")
    for words in (
        "| PPO, the baseline (`never`) | 0.20, 0.10 (5) | 0.20, 0.10 (5) |",
        "(`agent-cloned`) | 0.70, 0.35 (3) |",
        "(`never-taught`) | – | – | – |",
        "(`planner-only`) | 0.65, 0.33 |",
    ):
        assert words in page


def test_whose_thoughts_can_be_replaced() -> None:
    replaced = {arm.name for arm in SINGLE.arms if hears_its_planner(SINGLE.config(arm, 0))}
    assert {"agent-paper", "every-n", "once", "privileged"} <= replaced
    assert not {"never", "never-1m", "agent-cloned-zeros", "agent-paper-random"} & replaced


def test_five_are_the_simplest() -> None:
    """The whole ranking of twenty takes long; the fifth and the sixth are what it hangs on."""
    config = ObjectNavConfig(width=16, height=16)
    assert [home.index for home in rank_homes([6, SIMPLEST[-1], SIMPLEST[0]], None, config)] == [11, 19, 6]
    small = load_config("smoke", None, ["scenes.chosen=[3, 1]", "scenes.episodes=12", "scenes.rooms=1"])
    one = load_config("smoke", None, ["scenes.first_home=3", "scenes.episodes=12", "scenes.rooms=1"])
    homes, alone = make_homes(small), make_homes(one)
    assert [scene.name for scene in homes.scenes][:1] == [scene.name for scene in alone.scenes]
    assert len(homes.train) + len(homes.held_out) == 24


def test_the_command_writes_down_what_there_is(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "docs" / "results").mkdir(parents=True)
    fill(tmp_path / "docs" / "results")
    told = CliRunner().invoke(app, ["reproduce", "single", "--table"])
    assert told.exit_code == 0
    assert "seeds so far: agent-paper (3 of 5), agent-cloned (3 of 5), agent-imitation (0 of 3), " in told.output
    assert told.output.endswith("table: docs/results/single.md\n")
    for words, message in (
        # What was changed by hand does not go where results are kept.
        (
            ["experiment", "single", "--table", "--set", "ppo.lr=1e-3"],
            "is done yet in runs/single/results",
        ),
        (["reproduce", "dumps/1.pt"], "there is single, five, unseen to reproduce, not 'dumps/1.pt'; for a dump"),
        (["reproduce", "single", "--table", "--arms", "never"], "--arms: --table is of all that there is"),
        (["reproduce", "single", "--table", "--seeds", "2", "--jobs", "3"], "--seeds, --jobs: --table is of all"),
        (["experiment", "single", "--set", "seed=7"], "--set seed: an experiment numbers its seeds itself"),
        (["reproduce", "single", "--smoke", "--results", __file__], "--results .* is not a folder"),
        (["reproduce", "single", "--smoke", "--quick"], "either --smoke or --quick"),
        (["experiment", "first-light", "--quick"], "experiment first-light has no quick form"),
    ):
        with pytest.raises(ConfigError, match=message):
            CliRunner().invoke(app, words, catch_exceptions=False)
