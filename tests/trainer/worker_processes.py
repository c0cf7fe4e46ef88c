"""Real processes that work together over gloo, as torchrun starts them: they meet at a store that the parent has."""

import multiprocessing
import os
import pickle
from collections.abc import Callable
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import torch
from torch.distributed import TCPStore  # type: ignore[attr-defined]

from thinknav_trainer.config import TrainConfig
from thinknav_trainer.torchrun import torchrun_workers

Work = Callable[..., Any]


@dataclass(frozen=True)
class Outcome:
    """How a process ended. value: what its work returned. error: what it raised, as "Kind: message"."""

    value: Any
    error: str | None
    exit_code: int | None


def together(work: Work, config: TrainConfig, *arguments: object, count: int = 2, missing: int = 0) -> list[Outcome]:
    """`work(workers, *arguments)` in each of `count` processes, by rank. A function of a module, not of a test.

    missing: how many more they wait for.
    """
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(["thinknav_trainer.workflow", "thinknav_trainer.torchrun"])
    store = TCPStore("127.0.0.1", 0, None, is_master=True)
    started = []
    for rank in range(count):
        ours, theirs = context.Pipe()
        environment = {
            "RANK": str(rank),
            "WORLD_SIZE": str(count + missing),
            "LOCAL_WORLD_SIZE": str(count),
            "MASTER_ADDR": "127.0.0.1",
            "MASTER_PORT": str(store.port),
            "TORCHELASTIC_USE_AGENT_STORE": "True",
        }
        process = context.Process(target=_run, args=(environment, theirs, work, config, arguments))
        process.start()
        theirs.close()
        started.append((process, ours))
    outcomes = []
    for process, ours in started:
        try:
            value, error = pickle.loads(ours.recv_bytes())
        except EOFError:
            value, error = None, "it was killed"
        process.join()
        outcomes.append(Outcome(value, error, process.exitcode))
    return outcomes


def values(outcomes: list[Outcome]) -> list[Any]:
    """What all of them returned, where all came through."""
    assert [outcome.error for outcome in outcomes] == [None] * len(outcomes)
    return [outcome.value for outcome in outcomes]


def _run(
    environment: dict[str, str], answer: Connection, work: Work, config: TrainConfig, arguments: tuple[object, ...]
) -> None:
    os.environ |= environment
    torch.set_num_threads(1)
    try:
        with torchrun_workers(lambda: config) as (workers, agreed):
            assert agreed == config
            value = work(workers, *arguments)
        answer.send_bytes(pickle.dumps((value, None)))
    except BaseException as error:
        answer.send_bytes(pickle.dumps((None, f"{type(error).__name__}: {error}")))
