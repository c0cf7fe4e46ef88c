"""What a run is made of: typed, validated, and refused where it is not understood.

A configuration starts from a preset (`presets/*.yaml`), takes a user's YAML file over it, then each `--set a.b=c`.
Every key is described here and nowhere else.
"""

import difflib
from collections.abc import Iterable, Mapping
from importlib import resources
from pathlib import Path
from typing import Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from thinknav_sim.homes import SEEDS
from thinknav_sim.task_config import ObjectNavConfig
from thinknav_trainer.errors import UserError

# A prior on the logit of think under which the policy never thinks by itself; finite, so that no product of it is NaN.
NEVER = -1e9
# Each way, so that there is something to halve: over a single pixel, oneDNN's bfloat16 gradient is not finite.
RESNET50_PIXELS = 64
ControlName = Literal["none", "zeros", "another", "constant", "random", "deaf"]  # what the policy is told instead
Precision = Literal["auto", "float32", "bfloat16"]  # in which number format the policy acts and learns


class ConfigError(UserError):
    """A configuration that cannot be used; the message says which key, what is wrong, and the nearest right one."""


class Section(BaseModel):
    """A part of the configuration: immutable, and closed to keys that it does not know."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class ScenesConfig(Section):
    """Which homes, and how many episodes in them."""

    scans: tuple[str, ...] = Field((), description="scans to train in, instead of procedural homes (docs/scenes.md)")
    episodes_file: str | None = Field(
        None, description="Habitat's episodes to split and play, a file or a split's folder; none: they are made"
    )
    folder: str | None = Field(None, description="where the scenes of episodes_file lie (docs/evaluation.md)")
    homes: int = Field(1, ge=1, description="procedural homes to train in")
    first_home: int = Field(0, ge=0, description="index of the first one in the training range of seeds")
    chosen: tuple[int, ...] = Field(
        (), description="indices of the homes in the training range, instead of homes and first_home"
    )
    rooms: int | None = Field(None, ge=1, le=8, description="rooms of each home; none: the home decides")
    episodes: int = Field(400, ge=10, description="episodes made in each home, before the split")
    held_out: float = Field(0.1, gt=0, lt=1, description="share of them held out, stratified by category")
    validation: float = Field(
        0.0, ge=0, lt=1, description="share of the rest set apart to choose checkpoints/best.pt by; 0: none"
    )
    min_distance: float = Field(1.0, gt=0, description="shortest way from start to goal, metres")
    max_distance: float = Field(30.0, gt=0, description="longest way from start to goal, metres")

    @model_validator(mode="after")
    def _distances_in_order(self) -> "ScenesConfig":
        if self.min_distance >= self.max_distance:
            raise ValueError(f"min_distance {self.min_distance} is not below max_distance {self.max_distance}")
        if self.scans and self.episodes_file is not None:
            raise ValueError("scans and episodes_file exclude each other; put the scans in scenes.folder")
        if self.chosen and (self.scans or self.episodes_file is not None):
            raise ValueError("chosen names procedural homes: it does not go with scans or episodes_file")
        if any(index < 0 for index in self.chosen) or len(set(self.chosen)) < len(self.chosen):
            raise ValueError(f"chosen must be indices of different homes, not {self.chosen}")
        last = max(self.chosen, default=self.first_home + self.homes - 1)
        if last >= len(SEEDS["train"]):
            raise ValueError(f"there is no home {last}: the training range has {len(SEEDS['train'])}, from 0 on")
        return self


PRIVILEGED = "privileged"
EMBEDDED = "embedded"


class PrivilegedConfig(Section):
    """The planner that knows the map, for experiments: what planner.url `privileged` stands for."""

    error: float = Field(0.0, ge=0, le=1, description="privileged planner: share of its answers redrawn at random")
    errors_repeat: bool = Field(
        False,
        description="privileged planner: whether it says the same, right or wrong, whenever asked in the same place",
    )
    says_stop: bool = Field(True, description="privileged planner: whether it says stop, or forward in its place")
    shuffled: bool = Field(
        False, description="privileged planner: whether each agent gets the answer to another one (a control)"
    )


class PlannerConfig(Section):
    """The planning service, and what opens it. A bare URL in place of this section stands for its url."""

    url: str = Field(
        "http://127.0.0.1:8765",
        description="where it is: http(s)://… or zenoh(s)://…, several separated by commas; embedded: no service, "
        "the embedded planner in the trainer's own process (docs/planners.md); privileged: no service, but the "
        "simulator's shortest path, for experiments (docs/experiments.md)",
    )
    token_file: Path | None = Field(
        None, description="file with one line name:token; without it the variable THINKNAV_PLANNER_TOKEN is used"
    )
    tls_ca: Path | None = Field(None, description="PEM file of the authority that signed its certificate")
    control: ControlName = Field(
        "none",
        description="what the policy is told in the place of replies, whoever answers: zeros, another agent's reply, "
        "always the same sentence, a random direction; deaf: it sees zeros, and a demonstrator hears the reply "
        "(docs/experiments.md)",
    )
    privileged: PrivilegedConfig = PrivilegedConfig()

    @property
    def knows_the_map(self) -> bool:
        """Whether it is told what no robot is."""
        return self.url == PRIVILEGED

    @property
    def is_embedded(self) -> bool:
        """Whether it is the embedded planner in our own process."""
        return self.url == EMBEDDED


class ThinkConfig(Section):
    """The think action: when it is there, what it costs, what follows from it."""

    strategy: Literal["never", "agent", "every_n", "once"] = Field(
        "agent",
        description="never: the PPO baseline, no planner; agent: the policy decides when to think; every_n: each "
        "think.every-th step is a think; once: a plan at the start of each episode",
    )
    every: int = Field(20, ge=1, description="steps from one think to the next, for strategy every_n")
    forced: float = Field(
        0.0, ge=0, lt=1, description="for strategy agent: probability at first that a step is made a think"
    )
    forced_until: float = Field(0.5, gt=0, le=1, description="share of the run over which that falls to nothing")
    reward: Literal["task", "think_cost", "paper", "annealed", "capped", "progress_gated", "potential"] = Field(
        "think_cost", description="the reward scheme (rewards.py)"
    )
    cost: float = Field(0.01, ge=0, description="charged for each think")
    budget: float | None = Field(
        None,
        gt=0,
        lt=1,
        description="for strategy agent: share of steps that may be thinks; their price begins at think.cost, rises "
        "while there are more and falls while there are fewer; none: the price stays",
    )
    budget_lr: float = Field(0.001, gt=0, description="the most by which an update changes the price of a think")
    budget_after: float = Field(0.0, ge=0, lt=1, description="share of the run over which that price does not change")
    dropout: float = Field(
        0.0,
        ge=0,
        lt=1,
        description="for strategies agent and every_n: share of replies withheld from the policy while it learns",
    )
    agreement_bonus: float = Field(0.1, ge=0, description="the paper's reward for doing what the subgoal says")
    bonus_until: float = Field(0.6, gt=0, le=1, description="share of the run over which the annealed bonus fades")
    frame_size: int = Field(128, ge=16, le=1024, description="width and height of the frame the planner sees, pixels")
    frame_encoding: Literal["jpeg", "raw"] = Field("jpeg", description="how the frame travels")
    context: int = Field(
        1, ge=1, le=16, description="views the planner is shown: the present one and up to context - 1 before it"
    )
    temperature: float = Field(0.0, ge=0, le=10, description="of the planner's sampling; 0: its likeliest answer")
    deadline: float = Field(10.0, gt=0, description="seconds after which a reply is of no use")
    patience: float = Field(60.0, ge=0, description="seconds without any planner after which the run stops")


class PolicyConfig(Section):
    """The recurrent actor-critic network."""

    image_encoder: Literal["clip", "clip-small", "learnt", "resnet50"] = Field(
        "learnt",
        description="clip: the embedded CLIP sees the RGB, frozen, in 128 x 128, and a small layer learns to see the "
        "depth; clip-small: its pupil does, in 64 x 64; learnt: three convolutions learn to see the RGB-D; resnet50: "
        "Habitat's ResNet50 does, from random weights",
    )
    channels: tuple[int, int, int] = Field((16, 32, 32), description="learnt: channels of the convolutions")
    visual_size: int = Field(256, ge=1, description="width of the visual features")
    thought_size: int = Field(64, ge=1, description="width of the thought after its linear layer")
    hidden_size: int = Field(256, ge=1, description="width of the LSTM")
    lstm_layers: int = Field(1, ge=1, le=4, description="layers of the LSTM")
    stop_bias: float = Field(-4.0, description="prior on the logit of stop; keeps first episodes from ending at once")
    think_bias: float = Field(0.0, description="prior on the logit of think")
    obstacle_memory: bool = Field(
        False,
        description="a sensor more: the nearest heading that is free for a step, by a map that the agent makes of its "
        "own depth and of what it ran into",
    )


class PPOConfig(Section):
    """Proximal policy optimisation, with the names of Habitat's DD-PPO configuration."""

    num_steps: int = Field(64, ge=2, description="environment steps of each env between two updates")
    chunk_length: int = Field(16, ge=1, description="steps of a recurrent training sequence")
    epochs: int = Field(4, ge=1, description="passes over a rollout")
    minibatches: int = Field(2, ge=1, description="minibatches of a pass")
    lr: float = Field(2.5e-4, gt=0, description="Adam's learning rate")
    lr_decay: bool = Field(False, description="decay the learning rate linearly to zero over the run")
    adam_eps: float = Field(1e-5, gt=0, description="Adam's epsilon")
    clip: float = Field(0.2, gt=0, description="clip range of the probability ratio and of the value")
    gamma: float = Field(0.99, gt=0, le=1, description="discount")
    tau: float = Field(0.95, ge=0, le=1, description="lambda of generalised advantage estimation")
    value_coef: float = Field(0.5, ge=0, description="weight of the value loss")
    entropy_coef: float = Field(0.01, ge=0, description="weight of the entropy bonus")
    kl_coef: float = Field(
        0.0, ge=0, description="weight of the divergence from the policy that the warm start left (docs/training.md)"
    )
    max_grad_norm: float = Field(0.2, gt=0, description="gradients are clipped to this norm")
    clip_value_loss: bool = Field(True, description="clip the value's change, as Habitat does")
    normalize_advantages: bool = Field(True, description="zero mean, unit deviation over a rollout (Habitat: off)")
    precision: Precision = Field(
        "auto", description="of the policy's matrix products; auto: bfloat16 where the processor has it"
    )


class WarmStartConfig(Section):
    """Imitating an agent, before learning from rewards."""

    demonstrator: Literal["planner", "planner-aside", "bump-walker"] = Field(
        "planner",
        description="the agent to imitate, of those of `thinknav eval --agent`: planner thinks and obeys; bump-walker "
        "never thinks; or planner-aside: as planner, but the embedded planner is asked aside, and only moves are seen",
    )
    steps: int = Field(0, ge=0, description="environment steps of demonstrations, part of total_steps; 0: none")
    own_share: float = Field(
        0.5,
        ge=0,
        le=1,
        description="share of the envs in which, at last, the policy itself acts and is told what to do instead; it "
        "grows from none",
    )
    epochs: int = Field(
        16, ge=1, description="passes after each rollout of demonstrations: one over it, the rest over earlier ones"
    )
    remembered: int = Field(64, ge=1, description="rollouts of demonstrations that are kept to be gone through again")
    lr: float = Field(1e-3, gt=0, description="Adam's learning rate while imitating")
    max_grad_norm: float = Field(1.0, gt=0, description="gradients are clipped to this norm while imitating")
    foresight_coef: float = Field(
        0.0, ge=0, description="weight of learning to do untold what one does once told (docs/thinking.md)"
    )


class WorkersConfig(Section):
    """Several processes that train one policy (docs/scaling.md)."""

    sync_frac: float = Field(
        0.6,
        gt=0,
        le=1,
        description="when this share of the workers has finished its rollout, the others stop, after a quarter of "
        "theirs at the earliest (as Habitat's); not with deterministic",
    )
    timeout: float = Field(300.0, gt=0, description="seconds that workers wait for a late one before the run ends")


class TrainConfig(Section):
    """A whole run."""

    seed: int = Field(0, ge=0, description="of everything: homes are fixed, episodes, weights and actions follow it")
    total_steps: int = Field(160_000, ge=1, description="environment steps, think steps included")
    max_minutes: float | None = Field(
        None, gt=0, description="stop after this wall time even if steps are left; a warm start is not cut short"
    )
    num_envs: int = Field(16, ge=1, description="agents that move in one batch, of each worker")
    threads: int = Field(
        0, ge=0, description="threads of torch and of the renderer; 0: the machine's cores, shared out to its workers"
    )
    device: str = Field(
        "cpu",
        pattern=r"^(cpu|cuda(:\d+)?)$",
        description="where the policy acts and learns: cpu, cuda (each worker of a host on a GPU of its own), cuda:1",
    )
    renderer: Literal["auto", "raster", "embree", "open3d", "warp"] = Field(
        "auto", description="what draws while training (docs/simulator.md); warp: on the policy's GPU, where it has one"
    )
    deterministic: bool = Field(
        False,
        description="wait for every reply before anyone moves on: slower, and the same numbers every time; "
        "false: who waits for the planner holds nobody up",
    )
    learn_beside: bool = Field(
        False,
        description="learn from a rollout while the next one is collected, by the policy from before: for two cores or "
        "more (docs/training.md); not with deterministic, nor with several workers",
    )
    checkpoint_every: int = Field(20_000, ge=1, description="environment steps between checkpoints")
    keep_checkpoints: int = Field(3, ge=1, description="how many are kept")
    scenes: ScenesConfig = ScenesConfig()
    env: ObjectNavConfig = ObjectNavConfig()
    planner: PlannerConfig = PlannerConfig()
    think: ThinkConfig = ThinkConfig()
    policy: PolicyConfig = PolicyConfig()
    ppo: PPOConfig = PPOConfig()
    warm_start: WarmStartConfig = WarmStartConfig()
    workers: WorkersConfig = WorkersConfig()

    @model_validator(mode="after")
    def _consistent(self) -> "TrainConfig":
        if self.ppo.minibatches > self.num_envs * -(-self.ppo.num_steps // self.ppo.chunk_length):
            raise ValueError(
                f"ppo.minibatches {self.ppo.minibatches} is more than the sequences of a rollout "
                f"({self.num_envs} envs x {self.ppo.num_steps} steps / chunks of {self.ppo.chunk_length})"
            )
        if self.policy.image_encoder == "resnet50" and min(self.env.height, self.env.width) < RESNET50_PIXELS:
            raise ValueError(
                f"policy.image_encoder resnet50 halves a picture six times: it needs {RESNET50_PIXELS} pixels each "
                f"way, not {self.env.height} x {self.env.width}; raise env.height and env.width, or take learnt"
            )
        if self.env.think_action:
            raise ValueError("env.think_action follows from think.strategy; set that instead")
        if self.think.forced and self.think.strategy != "agent":
            raise ValueError(f"think.forced is for strategy agent, not {self.think.strategy}")
        if self.warm_start.steps and self.warm_start.demonstrator == "planner" and self.think.strategy != "agent":
            raise ValueError(
                "warm_start.demonstrator planner shows how to think: it needs think.strategy agent, not "
                f"{self.think.strategy}; planner-aside and bump-walker do not"
            )
        if self.warm_start.demonstrator == "planner-aside" and self.think.context > 1:
            raise ValueError("warm_start.demonstrator planner-aside asks with one view: it needs think.context 1")
        if self.ppo.kl_coef and not self.warm_start.steps:
            raise ValueError("ppo.kl_coef is for what a warm start taught: it needs warm_start.steps")
        if self.think.budget is not None and self.think.strategy != "agent":
            raise ValueError(f"think.budget is for strategy agent, not {self.think.strategy}")
        if self.think.budget is not None and self.think.reward == "task":
            raise ValueError("think.budget needs a reward scheme that charges thinks; task does not")
        if self.think.dropout and self.think.strategy not in ("agent", "every_n"):
            raise ValueError(f"think.dropout is for strategies agent and every_n, not {self.think.strategy}")
        if self.warm_start.foresight_coef and self.think.strategy == "never":
            raise ValueError("warm_start.foresight_coef is for strategies that think, not never")
        return self

    @property
    def network(self) -> PolicyConfig:
        """The policy's configuration: `policy`, without thinks of its own where the strategy decides on them."""
        if self.think.strategy in ("every_n", "once"):
            return self.policy.model_copy(update={"think_bias": NEVER})
        return self.policy

    @property
    def task(self) -> ObjectNavConfig:
        """The simulator's configuration: `env`, with the think action where the strategy has one."""
        return self.env.model_copy(update={"think_action": self.think.strategy != "never"})

    def with_planner(self, url: str | None) -> "TrainConfig":
        """The same with the planning service at another URL; unchanged for None."""
        if url is None:
            return self
        return self.model_copy(update={"planner": self.planner.model_copy(update={"url": url})})

    def with_control(self, control: str | None) -> "TrainConfig":
        """The same with another control (planner.control); unchanged for None. Raises ConfigError."""
        return self if control is None else change_config(self, overrides=[f"planner.control={control}"])

    @property
    def steps_per_update(self) -> int:
        return self.num_envs * self.ppo.num_steps


def presets() -> list[str]:
    """Names of the presets that ship with ThinkNav."""
    folder = resources.files("thinknav_trainer") / "presets"
    return sorted(Path(entry.name).stem for entry in folder.iterdir() if entry.name.endswith(".yaml"))


def load_config(preset: str = "cpu", file: Path | None = None, overrides: Iterable[str] = ()) -> TrainConfig:
    """Preset, then file, then `a.b=c` overrides. Raises ConfigError."""
    if preset not in presets():
        raise ConfigError(
            f"there is no preset {preset!r}{_nearest(preset, presets())}; there are {', '.join(presets())}"
        )
    text = (resources.files("thinknav_trainer") / "presets" / f"{preset}.yaml").read_text()
    return _layered(_read_yaml(text, preset), file, overrides)


def change_config(config: TrainConfig, file: Path | None = None, overrides: Iterable[str] = ()) -> TrainConfig:
    """A configuration with a file and overrides over it. Raises ConfigError."""
    return _layered(config.model_dump(mode="json"), file, overrides)


def _layered(values: dict[str, Any], file: Path | None, overrides: Iterable[str]) -> TrainConfig:
    if file is not None:
        try:
            text = file.read_text()
        except OSError as error:
            raise ConfigError(f"cannot read {file}: {error.strerror}") from None
        except UnicodeDecodeError:
            raise ConfigError(f"{file} is not YAML: it is no text") from None
        _merge(values, _read_yaml(text, str(file)))
    for override in overrides:
        _merge(values, _parse_override(override))
    return parse_config(values)


def _planner_section(values: Mapping[str, Any]) -> dict[str, Any]:
    """The same, with a section where the planner is given as a bare URL."""
    planner = values.get("planner")
    return {**values, **({"planner": {"url": planner}} if isinstance(planner, str) else {})}


def parse_config(values: Mapping[str, Any]) -> TrainConfig:
    """A configuration from plain values. Raises ConfigError that names each wrong key."""
    if not isinstance(values, Mapping):
        raise ConfigError(f"a configuration is a mapping of keys to values, not {values!r}")
    try:
        return TrainConfig.model_validate(_planner_section(values))
    except ValidationError as error:
        raise ConfigError("; ".join(_explain(problem) for problem in error.errors())) from None


def _explain(problem: Any) -> str:
    path = [str(part) for part in problem["loc"]]
    key = ".".join(path)
    if problem["type"] == "extra_forbidden":
        return f"there is no configuration key {key!r}{_nearest_key(path)}"
    message = str(problem["msg"]).removeprefix("Value error, ")
    return f"{key}: {message} (got {problem['input']!r})" if key else message


def _nearest_key(path: list[str]) -> str:
    """The key that was probably meant: in the same section first, else anywhere."""
    keys = list(_all_keys(TrainConfig))
    return _nearest(".".join(path), keys, last_part=path[-1])


def _all_keys(section: type[BaseModel], prefix: str = "") -> Iterable[str]:
    for name, info in section.model_fields.items():
        if isinstance(info.annotation, type) and issubclass(info.annotation, BaseModel):
            yield from _all_keys(info.annotation, f"{prefix}{name}.")
        else:
            yield prefix + name


def _nearest(word: str, choices: list[str], last_part: str | None = None) -> str:
    close = difflib.get_close_matches(word, choices, n=1, cutoff=0.75)
    if not close and last_part is not None:
        names = {choice.rsplit(".", 1)[-1]: choice for choice in choices}
        close = [names[name] for name in difflib.get_close_matches(last_part, list(names), n=1)]
    return f"; did you mean {close[0]!r}?" if close else ""


def _read_yaml(text: str, source: str) -> dict[str, Any]:
    try:
        values = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ConfigError(f"{source} is not YAML: {' '.join(str(error).split())}") from None
    if values is None:
        return {}
    if not isinstance(values, dict):
        raise ConfigError(f"{source} must hold a mapping of keys to values, not a {type(values).__name__}")
    return values


def _parse_override(override: str) -> dict[str, Any]:
    key, equals, text = override.partition("=")
    parts = key.strip().split(".")
    if not equals or not all(parts):
        raise ConfigError(f"--set takes key=value, such as ppo.lr=1e-4, not {override!r}")
    try:
        value = yaml.safe_load(text)
    except (yaml.YAMLError, ValueError):  # a date that is none
        raise ConfigError(f"--set {key}: {text!r} is not a value that YAML understands") from None
    if isinstance(value, str):  # YAML 1.1 reads 1e-4 as a word
        value = _number_or_word(value)
    for part in reversed(parts):
        value = {part: value}
    return dict(value)


def _number_or_word(value: str) -> str | float:
    try:
        return float(value)
    except ValueError:
        return value


def _merge(into: dict[str, Any], values: Mapping[str, Any]) -> None:
    for key, value in _planner_section(values).items():
        if isinstance(value, Mapping) and isinstance(into.get(key), dict):
            _merge(into[key], value)
        else:
            into[key] = value
