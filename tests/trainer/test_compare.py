"""Evaluations side by side."""

from dataclasses import replace
from pathlib import Path

import pytest

from thinknav_trainer.compare import compare, find_evaluation, read_evaluations
from thinknav_trainer.config import ConfigError
from thinknav_trainer.records import (
    MEASURES,
    EpisodeRecord,
    count_failures,
    read_evaluation,
    summarize_groups,
    write_evaluation,
)


def record(number: int, success: float, category: str = "chair", **measures: float) -> EpisodeRecord:
    values = dict.fromkeys(MEASURES, 0.0) | {"success": success} | measures
    failure = None if success else "stuck"
    return EpisodeRecord(f"e{number}", "home-1", category, values, {"slack": -0.1}, [[0.0] * 4], [0], [], None, failure)


def test_differences_are_taken_episode_by_episode(tmp_path: Path) -> None:
    """Both succeed half of the time; one is 0.1 better in every episode, which means alone would not show."""
    worse = [record(number, number % 2, spl=0.9 * (number % 2)) for number in range(20)]
    better = [record(number, number % 2, spl=0.9 * (number % 2) + 0.1) for number in range(20)]
    write_evaluation(tmp_path / "a", {}, worse)
    write_evaluation(tmp_path / "b", {}, list(reversed(better)))
    first, second = compare(read_evaluations([tmp_path / "a", tmp_path / "b"]))
    assert (first.name, second.name) == ("a", "b")
    assert first.difference == {}
    assert second.difference["spl"] == pytest.approx({"mean": 0.1, "low": 0.1, "high": 0.1})
    assert second.difference["success"] == {"mean": 0, "low": 0, "high": 0}
    assert second.summary["spl"]["high"] - second.summary["spl"]["low"] > 0.3


def test_an_episode_is_known_by_its_scene_as_well(tmp_path: Path) -> None:
    """Ids repeat from scene to scene in Habitat's files."""
    records = [record(number, number % 2) for number in range(4)]
    records += [replace(record(number, (number + 1) % 2), scene="home-2") for number in range(4)]
    write_evaluation(tmp_path / "a", {}, records)
    write_evaluation(tmp_path / "b", {}, list(reversed(records)))
    _, second = compare(read_evaluations([tmp_path / "a", tmp_path / "b"]))
    assert second.difference["success"] == {"mean": 0, "low": 0, "high": 0}


def test_other_episodes_are_not_compared(tmp_path: Path) -> None:
    write_evaluation(tmp_path / "a", {}, [record(1, 1), record(2, 0)])
    write_evaluation(tmp_path / "b", {}, [record(1, 1), record(3, 0)])
    with pytest.raises(ConfigError, match=r"different episodes \(2 and 2, 1 in both\): only .*a has 'e2'"):
        read_evaluations([tmp_path / "a", tmp_path / "b"])


def test_a_run_stands_for_its_last_evaluation(tmp_path: Path) -> None:
    for step in ("0000000000", "0000000256"):
        write_evaluation(tmp_path / "run/evaluations" / f"{step}-held_out", {}, [record(1, 1)])
    assert find_evaluation(tmp_path / "run").name == "0000000256-held_out"
    with pytest.raises(ConfigError, match="absent holds no evaluation, nor a run with one"):
        find_evaluation(tmp_path / "absent")


def test_files_of_another_form_are_named(tmp_path: Path) -> None:
    write_evaluation(tmp_path, {}, [record(1, 1)])
    assert read_evaluation(tmp_path)[1] == [record(1, 1)]
    (tmp_path / "episodes.jsonl").write_text('{"episode_id": "e1"}\n')
    with pytest.raises(ConfigError, match=r"cannot be read .* evaluate again"):
        read_evaluation(tmp_path)
    (tmp_path / "episodes.jsonl").unlink()
    with pytest.raises(ConfigError, match=r"holds no evaluation: cannot read .*episodes.jsonl"):
        read_evaluation(tmp_path)


def test_an_evaluation_of_nothing_is_refused(tmp_path: Path) -> None:
    write_evaluation(tmp_path, {}, [record(1, 1)])
    (tmp_path / "episodes.jsonl").write_text("")
    with pytest.raises(ConfigError, match="an evaluation of no episode"):
        read_evaluation(tmp_path)


def test_groups_and_failures_are_counted() -> None:
    records = [record(1, 1), record(2, 0, "bed"), record(3, 1, "bed"), replace(record(4, 0), failure="never")]
    groups = summarize_groups(records, "category")
    assert list(groups) == ["bed", "chair"]
    assert groups["bed"]["episodes"] == 2
    assert groups["bed"]["success"]["mean"] == 0.5
    assert set(groups["bed"]) == {"episodes", *MEASURES}
    assert list(summarize_groups(records, "scene")) == ["home-1"]
    assert count_failures([*records, record(5, 0)]) == {"stuck": 2, "never": 1}
