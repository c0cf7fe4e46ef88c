"""`thinknav eval`: play episodes with a checkpoint's policy, or with an agent that needs none."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.table import Table

from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.agents import AGENTS, Obedience
from thinknav_trainer.checkpoint import Checkpoint
from thinknav_trainer.commands.options import check_folder, refuse_given
from thinknav_trainer.config import ConfigError, TrainConfig, load_config, parse_config
from thinknav_trainer.control import CONTROLS
from thinknav_trainer.episode_sets import EpisodeSet, of_file, of_homes
from thinknav_trainer.evaluate import Clock, EpisodeRecord, summarize, write_evaluation
from thinknav_trainer.evaluate_agent import Setting, named_agent, play_agent
from thinknav_trainer.home_sets import parse_home_set
from thinknav_trainer.interrupt import Interruption, interruption
from thinknav_trainer.records import count_failures
from thinknav_trainer.when_to_think import WhenToThink
from thinknav_trainer.workflow import connect_if_thinking, evaluate_checkpoint, folder_name

_DEFAULT_HOMES = "val:0-20"


CheckpointFile = Annotated[Path | None, typer.Argument(help="a checkpoint file; or give --agent")]
Planner = Annotated[str | None, typer.Option(help="URL of the planning service, over the configuration's")]
Output = Annotated[Path | None, typer.Option(help="folder of the result; default: among the run's")]
StepSeconds = Annotated[float, typer.Option(min=1e-3, help="of a step, for SOT")]
ThinkSeconds = Annotated[float, typer.Option(min=0, help="of a think, for SOT")]

ControlOption = Annotated[
    str | None, typer.Option("--control", metavar="|".join(CONTROLS), help="told in the place of replies")
]

_WHERE = "Which episodes"
HomesOption = Annotated[str | None, typer.Option(help="SPLIT:FIRST-END; val:0-20 are 20 homes", rich_help_panel=_WHERE)]
Episodes = Annotated[int, typer.Option(min=1, help="how many, of homes or of a file", rich_help_panel=_WHERE)]
EpisodesFile = Annotated[
    Path | None, typer.Option(help="Habitat's episodes: a file, or a split's folder", rich_help_panel=_WHERE)
]
Scenes = Annotated[Path | None, typer.Option(help="folder of the file's scenes", rich_help_panel=_WHERE)]

_POLICY = "A checkpoint's policy"
Split = Annotated[str, typer.Option(help="held_out or train, of its run", rich_help_panel=_POLICY)]
Greedy = Annotated[
    bool, typer.Option("--greedy", help="the likeliest action instead of sampling", rich_help_panel=_POLICY)
]
ThinkBias = Annotated[
    float, typer.Option(help="added to the logit of think, to think more or less often", rich_help_panel=_POLICY)
]
ThinkEvery = Annotated[
    int | None, typer.Option(min=1, help="think in each so-many-th step, and never else", rich_help_panel=_POLICY)
]

_AGENT = "A named agent"
AgentName = Annotated[str | None, typer.Option(help=", ".join(AGENTS), rich_help_panel=_AGENT)]
Preset = Annotated[str, typer.Option(help="whose task is played", rich_help_panel=_AGENT)]
ConfigFile = Annotated[Path | None, typer.Option("--config", help="YAML over the preset", rich_help_panel=_AGENT)]
Overrides = Annotated[
    list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="one key", rich_help_panel=_AGENT)
]

_TOLD = "The agent called planner"
Views = Annotated[
    int | None, typer.Option("--context", min=1, help="views it shows: think.context", rich_help_panel=_TOLD)
]
Temperature = Annotated[
    float | None, typer.Option(min=0, help="of its planner: think.temperature", rich_help_panel=_TOLD)
]
StopGate = Annotated[
    float, typer.Option(min=0, max=1, help="confidence from which stop is believed", rich_help_panel=_TOLD)
]
Looks = Annotated[int, typer.Option(min=1, help="replies in a row that must say stop", rich_help_panel=_TOLD)]
Turns = Annotated[int, typer.Option(min=1, help="turns for one that is told", rich_help_panel=_TOLD)]
Forwards = Annotated[int, typer.Option(min=1, help="steps forward for one that is told", rich_help_panel=_TOLD)]

_OF_POLICY = ("split", "greedy", "think_bias", "think_every")
_OF_QUESTIONS = ("views", "temperature")
_OF_OBEDIENCE = ("stop_gate", "looks", "turns", "forwards")
_OF_AGENT = ("preset", "config_file", "overrides", *_OF_QUESTIONS, *_OF_OBEDIENCE)
_OF_ASKING = (*_OF_QUESTIONS, "control", "planner")


def evaluate(
    context: typer.Context,
    checkpoint: CheckpointFile = None,
    planner: Planner = None,
    control: ControlOption = None,
    output: Output = None,
    step_seconds: StepSeconds = Clock.step,
    think_seconds: ThinkSeconds = Clock.think,
    homes: HomesOption = None,
    episodes: Episodes = 200,
    episodes_file: EpisodesFile = None,
    scenes: Scenes = None,
    split: Split = "held_out",
    greedy: Greedy = False,
    think_bias: ThinkBias = 0.0,
    think_every: ThinkEvery = None,
    agent: AgentName = None,
    preset: Preset = "cpu",
    config_file: ConfigFile = None,
    overrides: Overrides = None,
    views: Views = None,
    temperature: Temperature = None,
    stop_gate: StopGate = Obedience.stop_gate,
    looks: Looks = Obedience.looks,
    turns: Turns = Obedience.turns,
    forwards: Forwards = Obedience.forwards,
) -> None:
    """Play episodes with a checkpoint's policy (a split of its run, unless told otherwise) or with a named agent."""
    _check_options(context, checkpoint, agent, output)
    when = WhenToThink(think_bias, think_every)
    clock, where = Clock(step_seconds, think_seconds), Where(homes, episodes_file, scenes, episodes)
    with interruption() as interrupted:
        if checkpoint is not None:
            refuse_unused(context, where)
            elsewhere = None if where.is_usual else where.for_checkpoint(checkpoint)
            folder, records = evaluate_checkpoint(
                checkpoint,
                split,
                interrupted,
                planner,
                greedy,
                output,
                elsewhere=elsewhere,
                clock=clock,
                when=when,
                control=control,
            )
            title = f"episodes of {split if elsewhere is None else elsewhere.name}, {checkpoint}"
        else:
            think = {"think.context": views, "think.temperature": temperature}
            config = _config(preset, config_file, overrides, {"planner": planner, "planner.control": control, **think})
            setting = Setting(config, Obedience(turns, forwards, stop_gate, looks), clock)
            folder = output or _usual_folder(str(agent), control, where)
            records = _play(str(agent), where, setting, folder, interrupted)
            title = f"episodes of {where.name}, agent {agent}"
    if not interrupted.requested:
        print_summary(title, records)
        typer.echo(f"result: {folder / 'result.json'}")
    raise typer.Exit(interrupted.exit_code)


def _usual_folder(agent: str, control: str | None, where: "Where") -> Path:
    """Where an agent's evaluation goes by default."""
    told = f"-{control}" if control else ""
    return Path("runs") / "evaluations" / folder_name(f"{agent}{told}-{where.name}")


def _check_options(context: typer.Context, checkpoint: Path | None, agent: str | None, output: Path | None) -> None:
    """Refuse what does not go together. Raises ConfigError."""
    if (checkpoint is None) == (agent is None):
        raise ConfigError("give either a checkpoint or --agent")
    if checkpoint is not None:
        refuse_given(context, _OF_AGENT, "for --agent; a checkpoint's policy plays the task of its run")
    if agent is not None:
        refuse_given(context, _OF_POLICY, "for the policy of a checkpoint")
        if not named_agent(agent).thinks:
            refuse_given(context, _OF_ASKING, f"for an agent that asks a planner; {agent} does not")
        if agent != "planner":
            refuse_given(context, _OF_OBEDIENCE, f"for the agent planner, not {agent}")
    check_folder("--output", output)


def refuse_unused(context: typer.Context, where: "Where") -> None:
    """Refuse options of a checkpoint's episodes that would change nothing. Raises ConfigError."""
    if where.is_usual:
        refuse_given(context, ("episodes",), "a split of the run is played whole; give --homes or --episodes-file too")
    else:
        refuse_given(context, ("split",), f"a split of the run is not played where {where.name} is")


def _config(
    preset: str, file: Path | None, overrides: list[str] | None, options: dict[str, str | float | None]
) -> TrainConfig:
    """A preset's configuration, with what is given on the command line over it. Raises ConfigError."""
    given = [f"{key}={value}" for key, value in options.items() if value is not None]
    return load_config(preset, file, [*(overrides or ()), *given])


class Where:
    """The episodes that the options name, made or read when they are wanted.

    is_usual: whether they name none: a policy plays a split of its run, an agent the usual homes.
    """

    def __init__(self, homes: str | None, file: Path | None, scenes: Path | None, count: int) -> None:
        """Raises ConfigError."""
        if homes is not None and file is not None:
            raise ConfigError("give either --homes or --episodes-file")
        if scenes is not None and file is None:
            raise ConfigError("--scenes is the folder of a file's scenes: give --episodes-file too")
        self.is_usual = homes is None and file is None
        self._homes = homes or _DEFAULT_HOMES
        self._file = file
        self._scenes = scenes
        self._count = count

    @property
    def name(self) -> str:
        return self._homes if self._file is None else str(self._file)

    def for_checkpoint(self, checkpoint: Path) -> EpisodeSet:
        """With the task that its policy was trained for."""
        return self.open(parse_config(Checkpoint.load(checkpoint).config).env)

    def open(self, config: ObjectNavConfig) -> EpisodeSet:
        if self._file is not None:
            return of_file(self._file, self._scenes, self._count)
        return of_homes(parse_home_set(self._homes), self._count, config)


def _play(name: str, where: Where, setting: Setting, folder: Path, interrupted: Interruption) -> list[EpisodeRecord]:
    thinks = named_agent(name).thinks
    with ExitStack() as stack:
        planner = connect_if_thinking(setting.config, stack) if thinks else None
        protocol, records = play_agent(name, where.open(setting.config.env), setting, planner, interrupted)
    if not interrupted.requested:
        write_evaluation(folder, protocol, records)
    return records


def print_summary(title: str, records: list[EpisodeRecord]) -> None:
    """A table for people: mean and 95 % interval over episodes, and why episodes failed."""
    table = Table("measure", "mean", "95 % interval", title=f"{len(records)} {title}", title_justify="left")
    for name, row in summarize(records).items():
        table.add_row(name, f"{row['mean']:.3f}", f"{row['low']:.3f} to {row['high']:.3f}")
    Console(markup=False).print(table)
    failures = ", ".join(f"{cause} {count}" for cause, count in count_failures(records).items())
    typer.echo(f"failures: {failures or 'none'}")
