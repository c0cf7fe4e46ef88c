"""The command `thinknav-server`: what `check` prints, and where every command's options may come from."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer.main
from typer.testing import CliRunner

from thinknav_server.cli import app


def invoke(*arguments: str, **environment: str) -> tuple[int, str]:
    result = CliRunner().invoke(app, list(arguments), env={"COLUMNS": "400", "TERM": "dumb", **environment})
    return result.exit_code, result.output


def leaves(command: Any, *path: str) -> Iterator[tuple[tuple[str, ...], Any]]:
    below = getattr(command, "commands", {})
    if not below:
        yield path, command
    for name, inner in below.items():
        yield from leaves(inner, *path, name)


COMMANDS = dict(leaves(typer.main.get_command(app)))


def test_check_prints_the_time_of_each_stage() -> None:
    status, output = invoke("check", "--planner", "scripted", "--log-level", "error")
    assert status == 0
    lines = [line.rpartition(" ms")[0].split("  ") for line in output.splitlines()]
    times = {" ".join(line[0].split() or line[1].split()): float(line[-1]) for line in lines}
    assert list(times) == [
        "load",
        "first answer",
        "decode and plan",
        "embed",
        "queue and process",
        "second answer",
    ]
    assert all(milliseconds >= 0 for milliseconds in times.values())


@pytest.mark.parametrize(
    ("options", "status", "message"),
    [
        (("--announce", "no/such/folder/url"), 1, "--announce names a file in no/such/folder, which is no folder"),
        (("--announce", "/tmp"), 1, "--announce /tmp is a folder; name a file"),
        (("--max-batch", "5000"), 2, "Invalid value for '--max-batch'"),
        (("--load-limit", "inf"), 2, "--load-limit takes at most 1000000 seconds, not inf"),
        (("--planner-limit", "1e9"), 2, "--planner-limit takes at most"),
        (("--max-frames", "10000"), 2, "Input should be less than or equal to 4096"),
    ],
)
def test_an_option_that_cannot_be_followed_is_told_before_anything_begins(
    options: tuple[str, ...], status: int, message: str
) -> None:
    got, output = invoke("serve", "--planner", "scripted", *options)
    assert got == status
    assert message in " ".join(output.split())


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_every_command_reads_a_settings_file(path: tuple[str, ...], tmp_path: Path) -> None:
    file = tmp_path / "server.yaml"
    file.write_text("no-such-option: 1\n")
    status, output = invoke(*path, "--config", str(file))
    assert status == 2
    assert "there is no option 'no_such_option'" in output
    status, output = invoke(*path, THINKNAV_SERVER_CONFIG=str(file))
    assert status == 2
    assert "there is no option 'no_such_option'" in output


def test_check_takes_the_settings_file_of_serve(tmp_path: Path) -> None:
    (tmp_path / "script.yaml").write_text("default: [turn left to the light]\n")
    file = tmp_path / "server.yaml"
    file.write_text(
        f"planner: scripted\nscript: {tmp_path}/script.yaml\nlog-level: error\nport: 1\nmax_batch: 4\nseconds: 3\n"
    )
    status, output = invoke("check", "--config", str(file))
    assert status == 0
    assert "turn left to the light" in output
    status, output = invoke("check", "--config", str(file), THINKNAV_SERVER_CHECK_SCRIPT=str(tmp_path / "none.yaml"))
    assert status == 1
    assert "none.yaml" in output


@pytest.mark.parametrize("path", COMMANDS, ids=" ".join)
def test_every_option_has_a_variable_of_the_environment(path: tuple[str, ...]) -> None:
    prefix = "_".join(("THINKNAV_SERVER", *path)).upper()
    status, page = invoke(*path, "--help")
    assert status == 0
    options = [option.name for option in COMMANDS[path].params if option.name not in ("_config", "help")]
    assert options
    for name in options:
        assert f"{prefix}_{name.upper()}" in page
    assert "THINKNAV_SERVER_CONFIG" in page


def test_a_variable_of_a_bench_command_is_read() -> None:
    status, output = invoke("bench", "soak", THINKNAV_SERVER_BENCH_SOAK_MINUTES="many")
    assert status == 2
    assert "minutes" in output
