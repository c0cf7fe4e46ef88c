"""Options from a file: below the command line and the environment, above the defaults."""

from pathlib import Path
from typing import Annotated

import pytest
import typer
from typer.testing import CliRunner

from thinknav_server.settings_file import SettingsFile

app = typer.Typer(context_settings={"auto_envvar_prefix": "TEST"}, pretty_exceptions_enable=False)


@app.command()
def one(
    _config: SettingsFile = None,
    batch_size: Annotated[int, typer.Option()] = 1,
    name: Annotated[str, typer.Option()] = "nobody",
    loud: Annotated[bool, typer.Option("--loud")] = False,
    path: Annotated[Path | None, typer.Option()] = None,
) -> None:
    typer.echo(f"{batch_size} {name} {loud} {path}")


@app.command()
def two(
    _config: SettingsFile = None,
    other: Annotated[str, typer.Option()] = "x",
    many: Annotated[list[str] | None, typer.Option()] = None,
) -> None:
    typer.echo(f"{other} {many or []}")


def run(tmp_path: Path, text: str, *arguments: str, **environment: str) -> tuple[int, str]:
    file = tmp_path / "settings.yaml"
    file.write_text(text)
    command, *options = arguments or ("one",)
    result = CliRunner().invoke(
        app, [command, "--config", str(file), *options], env={"COLUMNS": "400", "TERM": "dumb", **environment}
    )
    return result.exit_code, result.output


def test_each_source_has_its_place(tmp_path: Path) -> None:
    text = "batch-size: 2\nname: file\nloud: true\npath: /tmp/x\n"
    assert run(tmp_path, text) == (0, "2 file True /tmp/x\n")
    assert run(tmp_path, text, TEST_ONE_NAME="env") == (0, "2 env True /tmp/x\n")
    assert run(tmp_path, text, "one", "--name", "line", TEST_ONE_NAME="env") == (0, "2 line True /tmp/x\n")
    assert run(tmp_path, "") == (0, "1 nobody False None\n")


def test_one_file_may_serve_two_commands(tmp_path: Path) -> None:
    text = "batch_size: 2\nother: y\n"
    assert run(tmp_path, text) == (0, "2 nobody False None\n")
    assert run(tmp_path, text, "two") == (0, "y []\n")
    assert run(tmp_path, "many: [a, b]\n", "two") == (0, "x ['a', 'b']\n")
    assert run(tmp_path, "many: a=1\n", "two") == (0, "x ['a=1']\n")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("batch_sizes: 3", "there is no option 'batch_sizes'; did you mean 'batch_size'?"),
        ("_config: x", "there is no option '_config'"),
        ("- 3", "must hold a mapping"),
        ("a: [", "is not YAML"),
        ("batch_size: many", "'--batch-size': Input should be a valid integer"),
        ("name: [a, b]", "name takes one value, not ['a', 'b']"),
    ],
)
def test_a_file_that_cannot_be_used_is_told(tmp_path: Path, text: str, message: str) -> None:
    status, output = run(tmp_path, text)
    assert status == 2
    assert message in " ".join(output.split())


def test_a_file_that_is_not_there_is_told(tmp_path: Path) -> None:
    result = CliRunner().invoke(app, ["one", "--config", str(tmp_path / "none")], env={"COLUMNS": "400"})
    assert result.exit_code == 2
    assert "No such file" in result.output
