"""`thinknav eval`: play episodes with a checkpoint's policy, or with an agent that needs none."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from thinknav_trainer.agents import AGENTS, Obedience
from thinknav_trainer.config import ConfigError, load_config
from thinknav_trainer.evaluate import EpisodeRecord, summarize, write_evaluation
from thinknav_trainer.evaluate_agent import Setting, evaluate_agent, named_agent
from thinknav_trainer.home_sets import parse_home_set
from thinknav_trainer.interrupt import Interruption, interruption
from thinknav_trainer.workflow import connect_if_thinking, evaluate_checkpoint

_POLICY = "a checkpoint's policy"
_AGENT = "an agent of a name"
_OBEDIENT = "the agent planner"


def evaluate(
    checkpoint: Annotated[Path | None, typer.Argument(help="a checkpoint file; or --agent")] = None,
    planner: Annotated[str | None, typer.Option(help="URL of the planning service, over the configuration's")] = None,
    output: Annotated[Path | None, typer.Option(help="folder of the result; default: among the run's")] = None,
    split: Annotated[str, typer.Option(help="held_out or train", rich_help_panel=_POLICY)] = "held_out",
    greedy: Annotated[
        bool, typer.Option("--greedy", help="the likeliest action instead of sampling", rich_help_panel=_POLICY)
    ] = False,
    agent: Annotated[str | None, typer.Option(help=f"one of: {', '.join(AGENTS)}", rich_help_panel=_AGENT)] = None,
    homes: Annotated[
        str, typer.Option(help="SPLIT:FIRST-END; val:0-20 are 20 homes", rich_help_panel=_AGENT)
    ] = "val:0-20",
    episodes: Annotated[int, typer.Option(min=1, help="in all homes together", rich_help_panel=_AGENT)] = 200,
    preset: Annotated[str, typer.Option(help="whose task is played", rich_help_panel=_AGENT)] = "cpu",
    config_file: Annotated[
        Path | None, typer.Option("--config", help="a YAML file over the preset", rich_help_panel=_AGENT)
    ] = None,
    overrides: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="one key", rich_help_panel=_AGENT)
    ] = None,
    context: Annotated[
        int | None, typer.Option(min=1, help="views it shows: think.context", rich_help_panel=_OBEDIENT)
    ] = None,
    temperature: Annotated[
        float | None, typer.Option(min=0, help="of the planner: think.temperature", rich_help_panel=_OBEDIENT)
    ] = None,
    stop_gate: Annotated[
        float, typer.Option(min=0, max=1, help="confidence from which stop is believed", rich_help_panel=_OBEDIENT)
    ] = Obedience.stop_gate,
    looks: Annotated[
        int, typer.Option(min=1, help="replies in a row that must say stop", rich_help_panel=_OBEDIENT)
    ] = Obedience.looks,
    turns: Annotated[
        int, typer.Option(min=1, help="turns for one that is told", rich_help_panel=_OBEDIENT)
    ] = Obedience.turns,
    forwards: Annotated[
        int, typer.Option(min=1, help="steps forward for one that is told", rich_help_panel=_OBEDIENT)
    ] = Obedience.forwards,
) -> None:
    """Play every episode of a split with a checkpoint's policy, or episodes in unseen homes with a named agent."""
    if (checkpoint is None) == (agent is None):
        raise ConfigError("give either a checkpoint or --agent")
    with interruption() as interrupted:
        if checkpoint is not None:
            title = f"{split} episodes of {checkpoint}"
            folder, records = evaluate_checkpoint(checkpoint, split, interrupted, planner, greedy, output)
        else:
            name = str(agent)
            title = f"episodes in homes {homes}, agent {name}"
            think = {"planner": planner, "think.context": context, "think.temperature": temperature}
            given = [f"{key}={value}" for key, value in think.items() if value is not None]
            config = load_config(preset, config_file, [*(overrides or ()), *given])
            setting = Setting(config, Obedience(turns, forwards, stop_gate, looks))
            folder = output or Path("runs") / "evaluations" / name
            records = _play(name, homes, episodes, setting, folder, interrupted)
    if not interrupted.requested:
        print_summary(title, records)
        Console().print(f"result: {folder / 'result.json'}", soft_wrap=True)
    raise typer.Exit(interrupted.exit_code)


def _play(
    name: str, homes: str, episodes: int, setting: Setting, folder: Path, interrupted: Interruption
) -> list[EpisodeRecord]:
    thinks = named_agent(name).thinks
    chosen = parse_home_set(homes)
    with ExitStack() as stack:
        planner = connect_if_thinking(setting.config, stack) if thinks else None
        protocol, records = evaluate_agent(name, chosen, episodes, setting, planner, interrupted)
    if not interrupted.requested:
        write_evaluation(folder, protocol, records)
    return records


def print_summary(title: str, records: list[EpisodeRecord]) -> None:
    """A table for people: mean and 95 % interval over episodes."""
    table = Table("measure", "mean", "95 % interval", title=f"{len(records)} {title}", title_justify="left")
    for name, row in summarize(records).items():
        table.add_row(name, f"{row['mean']:.3f}", f"{row['low']:.3f} to {row['high']:.3f}")
    Console().print(table)
