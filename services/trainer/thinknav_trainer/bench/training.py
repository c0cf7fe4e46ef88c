"""The trainer's figures: steps per second from frames to updated weights, beside other libraries' learners, and what a
slow planner leaves of them.
"""

import logging
import statistics
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import torch

from thinknav_proto import PlannerError, PlannerFailed, SubgoalRequest
from thinknav_trainer.bench.figures import Figure, compared, rounded
from thinknav_trainer.bench.peer import PeerMissing
from thinknav_trainer.bench.peer_trainers import PEERS, PeerTrainer
from thinknav_trainer.bench.stepping import timed_renderer
from thinknav_trainer.config import TrainConfig, load_config
from thinknav_trainer.planner import MockTransport, PlannerClient, connect
from thinknav_trainer.scenes import Homes, make_homes
from thinknav_trainer.service_process import planning_service
from thinknav_trainer.train import Session, open_session

PARTS = ("speed", "peers", "latency", "scaling")
LATENCY_S = 0.3
DEADLINE_S = 3.0
FAILING, SILENT = 0.05, 0.01

# Two thinks in three wait while a rollout is collected: it takes many envs, with few steps each, to go on meanwhile.
LATENCY = (
    "num_envs=128",
    "ppo.num_steps=16",
    "think.forced=0.1",
    "think.forced_until=1",
    "policy.think_bias=-20",
    f"think.deadline={DEADLINE_S}",
    "scenes.homes=4",
)
NEVER = ("think.strategy=never",)
# A policy that has not learnt anything thinks in one step of four or five; one that has, in fewer than one of ten.
ONE_IN_TEN = ("think.forced=0.1", "think.forced_until=1", "policy.think_bias=-20")
BESIDE = ("learn_beside=true",)
LARGE_EYE = ("policy.image_encoder=clip", "env.width=128", "env.height=128")
LARGE_LSTM = ("policy.hidden_size=512", "policy.lstm_layers=2")


def training_figures(
    repeats: int, peers: Path, url: str | None = None, parts: Sequence[str] = PARTS
) -> Iterator[Figure]:
    """Every figure of the trainer, as soon as it is there, or those of some PARTS.

    peers: virtual environment of the peers. url: of a planning service; none: one of our own.
    """
    logging.getLogger("thinknav_trainer").setLevel(logging.WARNING)
    if "speed" in parts:
        yield from speeds(repeats, url)
    if "peers" in parts:
        with _service(url) as planner:
            yield from against_peers("train.cpu", load_config("cpu"), peers, repeats, planner)
        yield from against_peers("train.cpu_never", load_config("cpu", overrides=NEVER), peers, repeats)
    if "latency" in parts:
        yield from latency_hidden(load_config("cpu", overrides=LATENCY), repeats)
    if "scaling" in parts:
        yield from scaling(repeats)


def speeds(repeats: int, url: str | None) -> Iterator[Figure]:
    """Steps per second of the preset cpu and of what differs from it in one thing."""
    with _service(url) as planner:
        for name, overrides in (
            ("cpu", ()),
            ("cpu_beside", BESIDE),
            ("cpu_one_in_ten", ONE_IN_TEN),
            ("cpu_one_in_ten_beside", (*ONE_IN_TEN, *BESIDE)),
            ("lstm512", LARGE_LSTM),
            ("lstm512_beside", (*LARGE_LSTM, *BESIDE)),
        ):
            yield from speed(f"train.{name}", load_config("cpu", overrides=overrides), planner, repeats)
    for name, overrides in (("cpu_never", ()), ("cpu_never_beside", BESIDE), ("cpu_never_clip", LARGE_EYE)):
        yield from speed(f"train.{name}", load_config("cpu", overrides=(*NEVER, *overrides)), None, repeats)


def speed(name: str, config: TrainConfig, planner: str | None, repeats: int) -> Iterator[Figure]:
    """Steps per second of training, and the shares of the time. planner: its URL."""
    with ExitStack() as stack:
        client = None if planner is None else stack.enter_context(connect(planner))
        session = open_session(config, make_homes(config), client)
        _updates(session, 1)
        with _timed_parts(session) as parts:
            session.collector.stopwatch.take()
            asked = session.env.counts.asked
            rate = statistics.median(_updates(session, 2) for _ in range(repeats))
            seconds = session.collector.stopwatch.take()
            thinks = (session.env.counts.asked - asked) / (2 * repeats * config.steps_per_update)
        session.env.env.close()
    yield Figure(f"{name}.steps_per_s", rounded(rate), "steps/s")
    yield Figure(f"{name}.think_rate", rounded(thinks), "share of the steps")
    for part, share in _shares(seconds, parts).items():
        yield Figure(f"{name}.share_{part}", rounded(share), "share of the time")


def against_peers(
    name: str, config: TrainConfig, peers: Path, repeats: int, planner: str | None = None
) -> Iterator[Figure]:
    """Steps per second of training beside other libraries' learners, which take turns with ours, two updates each.

    They have the same env, sizes and numbers of passes: see `peer_trainers`.
    """
    with ExitStack() as stack:
        client = None if planner is None else stack.enter_context(connect(planner))
        session = open_session(config, make_homes(config), client)
        stack.callback(session.env.env.close)
        rated = {"ours": partial(_updates, session, 2)}
        missing = {}
        for peer in PEERS:
            try:
                rated[peer.figure] = partial(stack.enter_context(PeerTrainer(peer, peers, config, planner)).rate, 2)
            except PeerMissing as reason:
                missing[peer.figure] = str(reason)
        # The first turn warms up.
        turns = [{who: rate() for who, rate in rated.items()} for _ in range(repeats + 1)][1:]
    medians = {who: statistics.median(turn[who] for turn in turns) for who in rated}
    for peer in PEERS:
        figure = f"{name}.{peer.figure}"
        if peer.figure in missing:
            yield Figure(figure, rounded(medians["ours"]), "steps/s", missing[peer.figure])
        else:
            yield compared(figure, medians["ours"], "steps/s", peer.name, medians[peer.figure])


def latency_hidden(config: TrainConfig, repeats: int) -> Iterator[Figure]:
    """What a planner of 300 ms leaves of the speed with one of none, at a forced think rate of one in ten."""
    homes = make_homes(config)
    lock_step = config.model_copy(update={"deterministic": True})
    none, slow, waiting, faulty = rates(
        repeats,
        lambda: _mock_session(config, homes, 0.0, _turn_left),
        lambda: _mock_session(config, homes, LATENCY_S, _turn_left),
        lambda: _mock_session(lock_step, homes, LATENCY_S, _turn_left),
        lambda: _mock_session(config, homes, _silent_at_times, _failing_at_times),
    )
    peer = "a planner without latency"
    yield compared("train.latency_hidden", slow, "steps/s", peer, none)
    yield compared("train.latency_hidden_faulty", faulty, "steps/s", peer, none)
    yield compared("train.latency_hidden_lock_step", waiting, "steps/s", peer, none)


def scaling(repeats: int) -> Iterator[Figure]:
    """What a number of envs, or of homes, costs a policy that never thinks; rollouts have the same length in all."""
    steps = load_config("cpu").steps_per_update
    envs = {
        count: load_config("cpu", overrides=(*NEVER, f"num_envs={count}", f"ppo.num_steps={steps // count}"))
        for count in (8, 16, 32, 64, 128)
    }
    homes = {
        count: load_config("cpu", overrides=(*NEVER, f"scenes.homes={count}", "scenes.episodes=50"))
        for count in (1, 8, 32)
    }
    for what, configs in (("envs", envs), ("homes", homes)):
        found = dict(
            zip(configs, rates(repeats, *(partial(_never, config) for config in configs.values())), strict=True)
        )
        least = min(configs)
        for count, rate in found.items():
            yield compared(f"train.{what}_{count}", rate, "steps/s", f"with {least}", found[least])


def _never(config: TrainConfig) -> Session:
    return open_session(config, make_homes(config), None)


def rates(repeats: int, *openings: Callable[[], Session]) -> list[float]:
    """Each session's median of steps per second. They take turns, two updates at a time.

    Each turn begins with an update that does not count: whose replies came in while others had their turn.
    """
    sessions = [opening() for opening in openings]
    measured: list[list[float]] = [[] for _ in sessions]
    for _ in range(repeats):
        for session, found in zip(sessions, measured, strict=True):
            _updates(session, 1)
            found.append(_updates(session, 2))
    for session in sessions:
        session.env.env.close()
    return [statistics.median(found) for found in measured]


def _updates(session: Session, count: int) -> float:
    """Collect and learn that often: steps per second."""
    start, steps = time.perf_counter(), 0
    for _ in range(count):
        session.env.share = 0.0
        rollout, _ = session.learning.improve(session.collector.collect, remaining=1.0)
        steps += len(rollout)
    return steps / (time.perf_counter() - start)


def _mock_session(
    config: TrainConfig,
    homes: Homes,
    latency: float | Callable[[SubgoalRequest], float],
    answer: Callable[[SubgoalRequest], str | PlannerError],
) -> Session:
    return open_session(config, homes, PlannerClient(MockTransport(answer, latency)))


def _turn_left(request: SubgoalRequest) -> str:  # noqa: ARG001
    return "turn left"


def _failing_at_times(request: SubgoalRequest) -> str | PlannerError:
    return PlannerFailed("now and then") if _share_of(request) < FAILING else "turn left"


def _silent_at_times(request: SubgoalRequest) -> float:
    return 2 * request.deadline if _share_of(request) > 1 - SILENT else LATENCY_S


def _share_of(request: SubgoalRequest) -> float:
    """A number in 0..1 that requests are evenly spread over."""
    return int(request.request_id) * 0.6180339887 % 1


@contextmanager
def _service(url: str | None) -> Iterator[str]:
    if url is not None:
        yield url
        return
    with tempfile.TemporaryDirectory() as folder, planning_service(Path(folder) / "service.log") as own:
        yield own


@contextmanager
def _timed_parts(session: Session) -> Iterator[dict[str, float]]:
    """While the block runs: seconds of drawing, of drawing for the planner alone, and of encoding images to act."""
    env, policy = session.env.env, session.learning.acting
    parts = {"planner_frames": 0.0, "encoding": 0.0, "rendering": 0.0}
    frames, look, began = env.frames, policy.vision.look, [0.0]

    def timed_frames(*arguments: Any) -> Any:
        start = time.perf_counter()
        pictures = frames(*arguments)
        parts["planner_frames"] += time.perf_counter() - start
        return pictures

    def timed_look(observations: Any) -> Any:
        start = time.perf_counter()
        looked = look(observations)
        parts["encoding"] += time.perf_counter() - start
        return looked

    def begin(*_: Any) -> None:
        began[0] = time.perf_counter()

    def end(*_: Any) -> None:
        if not torch.is_grad_enabled():  # while learning it belongs to that
            parts["encoding"] += time.perf_counter() - began[0]

    hooks = [policy.vision.register_forward_pre_hook(begin), policy.vision.register_forward_hook(end)]
    env.frames = timed_frames  # type: ignore[method-assign, assignment]
    policy.vision.look = timed_look  # type: ignore[method-assign]
    with timed_renderer(env) as renderer:
        yield parts
    parts["rendering"] = renderer.wall
    del env.frames, policy.vision.look
    for hook in hooks:
        hook.remove()


def _shares(seconds: Mapping[str, float], parts: Mapping[str, float]) -> dict[str, float]:
    whole = sum(seconds.values())
    spent = {
        "rendering": parts["rendering"],
        "encoding": parts["encoding"],
        "acting": seconds["act"] - parts["encoding"],
        "planning": seconds["plan"] - parts["planner_frames"],
        "learning": seconds["learn"],
        "stepping": seconds["step"] - parts["rendering"] + parts["planner_frames"],
    }
    return {name: value / whole for name, value in spent.items()}
