"""Replicas that die, freeze, stop and start again, as real processes, asked over both doors at once.

Whatever befalls a replica, each question has one answer, and in time.
"""

import os
import shutil
import signal
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from thinknav_trainer.planner import (
    PlannerClient,
    PlannerError,
    SubgoalReply,
    SubgoalRequest,
    Unavailable,
    connect,
    encode_frame,
)

StartService = Callable[..., tuple[str, "subprocess.Popen[str]"]]

DEADLINE_S = 20.0
LATE_S = 15.0  # beyond its deadline, on a machine that has much else to do, that somebody may be told so
IN_TIME_S = 60.0
FRAME = encode_frame(np.zeros((16, 16, 3), np.uint8))


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


class Replica:
    """A service that says its own name, and can be started again where it was."""

    def __init__(
        self,
        start: StartService,
        folder: Path,
        name: str,
        *options: str,
        host: str = "127.0.0.1",
        prefix: Sequence[str] = (),
    ) -> None:
        self._start = start
        self._host = host
        self._prefix = prefix
        self._port, self._zenoh_port = free_port(), free_port()
        script = folder / f"{name}.yaml"
        script.write_text(f"default: [turn left to {name}]\n")
        self._options = ("--script", str(script), "--replica", name, *options)
        self.start()

    @property
    def http(self) -> str:
        return f"http://{self._host}:{self._port}"

    @property
    def zenoh(self) -> str:
        return f"{self._host}:{self._zenoh_port}"

    def start(self) -> None:
        where = ("--host", self._host, "--port", str(self._port), "--zenoh", self.zenoh)
        _, self.process = self._start(*where, *self._options, prefix=self._prefix)

    def kill(self) -> None:
        self.process.kill()
        self.process.wait()


class Asking:
    """Many questions under way at once, over several clients. goal: of each; its number comes behind it."""

    def __init__(self, clients: Sequence[PlannerClient], goal: str = "chair") -> None:
        self._clients = clients
        self._goal = goal
        self._threads = ThreadPoolExecutor(64)
        self._number = 0

    def begin(self, count: int) -> list["Future[tuple[str, SubgoalReply | PlannerError]]"]:
        """That many questions to each client."""
        return [self._threads.submit(self._ask, client) for client in self._clients for _ in range(count)]

    def all_answer(self, names: set[str]) -> bool:
        """Whether, over each client, all these replicas answer and no others do."""
        for client in self._clients:
            answers = [self._ask(client)[1] for _ in range(2 * len(names))]
            if {who(answer) for answer in answers} != names:
                return False
        return True

    def _ask(self, client: PlannerClient) -> tuple[str, SubgoalReply | PlannerError]:
        self._number += 1
        name = f"{threading.get_ident()}-{self._number}"
        # At a temperature each question is planned for itself: no answer is shared or remembered.
        goal = f"{self._goal} {name}"
        request = SubgoalRequest(request_id=name, goal=goal, frame=FRAME, temperature=1.0, deadline=DEADLINE_S)
        began = time.monotonic()
        (answer,) = client.ask([request])
        assert time.monotonic() - began < DEADLINE_S + LATE_S
        return name, answer


def who(answer: SubgoalReply | PlannerError) -> str:
    return answer.subgoal.removeprefix("turn left to ") if isinstance(answer, SubgoalReply) else repr(answer)


def answers_of(asked: Sequence["Future[tuple[str, SubgoalReply | PlannerError]]"]) -> list[str]:
    """Who answered each question, having made sure that the answer belongs to it."""
    answers = [future.result(IN_TIME_S) for future in asked]
    for name, answer in answers:
        assert isinstance(answer, SubgoalReply), repr(answer)
        assert answer.request_id == name
    return [who(answer) for _, answer in answers]


def until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + IN_TIME_S
    while not true():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.05)


@pytest.fixture(scope="module")
def replicas(
    start_service: StartService, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[tuple[Replica, Replica, Asking]]:
    """two joins one, so that whoever finds one finds both."""
    folder = tmp_path_factory.mktemp("replicas")
    slow = ("--latency", "0.3", "--max-batch", "4")
    one = Replica(start_service, folder, "one", *slow)
    two = Replica(start_service, folder, "two", *slow, "--zenoh-connect", one.zenoh)
    urls = f"{one.http},{two.http}", f"zenoh://{one.zenoh},{two.zenoh}"
    with connect(urls[0], handshake=IN_TIME_S) as http, connect(urls[1], handshake=IN_TIME_S) as zenoh:
        asking = Asking([http, zenoh])
        until(lambda: asking.all_answer({"one", "two"}))
        yield one, two, asking
        for replica in (one, two):
            if replica.process.poll() is None:
                replica.process.send_signal(signal.SIGCONT)


def test_who_finds_one_finds_all_that_have_joined_it(replicas: tuple[Replica, Replica, Asking]) -> None:
    one, _, _ = replicas
    with connect(f"zenoh://{one.zenoh}") as client:
        until(lambda: Asking([client]).all_answer({"one", "two"}))


def test_questions_spread_over_all(replicas: tuple[Replica, Replica, Asking]) -> None:
    _, _, asking = replicas
    answers = answers_of(asking.begin(16))
    assert 12 <= answers.count("one") <= 20


def test_one_is_killed_while_it_is_asked(replicas: tuple[Replica, Replica, Asking]) -> None:
    one, _, asking = replicas
    asked = asking.begin(16)
    time.sleep(0.2)  # so that they are under way
    one.kill()
    answers = answers_of(asked)
    assert len(answers) == 32
    assert answers.count("two") > 16
    assert set(answers_of(asking.begin(2))) == {"two"}
    one.start()
    until(lambda: asking.all_answer({"one", "two"}))


def test_one_is_frozen_while_it_is_asked(replicas: tuple[Replica, Replica, Asking]) -> None:
    _, two, asking = replicas
    asked = asking.begin(16)
    time.sleep(0.2)
    two.process.send_signal(signal.SIGSTOP)
    try:
        answers = answers_of(asked)
        assert answers.count("one") > 16
        until(lambda: asking.all_answer({"one"}))
    finally:
        two.process.send_signal(signal.SIGCONT)
    until(lambda: asking.all_answer({"one", "two"}))


def test_one_is_told_to_stop_while_it_is_asked(replicas: tuple[Replica, Replica, Asking]) -> None:
    _, two, asking = replicas
    asked = asking.begin(16)
    time.sleep(0.2)
    two.process.terminate()
    assert len(answers_of(asked)) == 32
    _, log = two.process.communicate(timeout=IN_TIME_S)
    assert two.process.returncode == 0
    assert "Traceback" not in log
    assert set(answers_of(asking.begin(2))) == {"one"}
    two.start()
    until(lambda: asking.all_answer({"one", "two"}))


def test_all_are_gone_and_come_back(replicas: tuple[Replica, Replica, Asking]) -> None:
    one, two, asking = replicas
    one.kill()
    two.kill()

    def all_are_told() -> bool:
        answers = [future.result(IN_TIME_S)[1] for future in asking.begin(2)]
        return all(isinstance(answer, Unavailable) for answer in answers)

    until(all_are_told)
    began = time.monotonic()
    assert all_are_told()
    assert time.monotonic() - began < DEADLINE_S, "nobody waits while nobody is there"
    one.start()
    two.start()
    until(lambda: asking.all_answer({"one", "two"}))


HERE, THERE = "169.254.77.1", "169.254.77.2"


@pytest.fixture
def namespace() -> Iterator[tuple[str, str, str]]:
    """The names of a network namespace that reaches this one over a pair of interfaces, of ours and of its own."""
    name, ours, theirs = f"thinknav-{os.getpid()}", f"tn-a{os.getpid() % 100_000}", f"tn-b{os.getpid() % 100_000}"
    steps = [
        f"ip netns add {name}",
        f"ip link add {ours} type veth peer name {theirs} netns {name}",
        f"ip addr add {HERE}/30 dev {ours}",
        f"ip link set {ours} up",
        f"ip -n {name} addr add {THERE}/30 dev {theirs}",
        f"ip -n {name} link set {theirs} up",
        f"ip -n {name} link set lo up",
    ]
    try:
        for step in steps:
            try:
                done = subprocess.run(step.split(), capture_output=True, text=True, check=False)
            except FileNotFoundError:
                pytest.skip("there is no command `ip` to make network namespaces with")
            if done.returncode:
                pytest.skip(f"network namespaces cannot be made here ({step}: {done.stderr.strip()})")
        yield name, ours, theirs
    finally:
        if shutil.which("ip"):
            subprocess.run(["ip", "netns", "del", name], capture_output=True, check=False)
            subprocess.run(["ip", "link", "del", ours], capture_output=True, check=False)


@pytest.mark.parametrize("end", ["ours", "theirs"])
def test_the_network_is_cut_between_two_namespaces(
    start_service: StartService, tmp_path: Path, namespace: tuple[str, str, str], end: str
) -> None:
    """At our end the system knows that there is no way; at the other bytes vanish, and nobody is told."""
    name, ours, theirs = namespace
    link = ["ip", "link", "set", ours] if end == "ours" else ["ip", "-n", name, "link", "set", theirs]
    slow = ("--latency", "0.3", "--max-batch", "4")
    near = Replica(start_service, tmp_path, "near", *slow)
    prefix = ("ip", "netns", "exec", name)
    far = Replica(start_service, tmp_path, "far", *slow, "--insecure", host=THERE, prefix=prefix)
    try:
        urls = f"{near.http},{far.http}", f"zenoh://{near.zenoh},{far.zenoh}"
        with connect(urls[0], handshake=IN_TIME_S) as http, connect(urls[1], handshake=IN_TIME_S) as zenoh:
            asking = Asking([http, zenoh])
            until(lambda: asking.all_answer({"near", "far"}))
            asked = asking.begin(16)
            time.sleep(0.2)
            subprocess.run([*link, "down"], check=True)
            assert answers_of(asked).count("near") > 16
            until(lambda: asking.all_answer({"near"}))
            subprocess.run([*link, "up"], check=True)
            until(lambda: asking.all_answer({"near", "far"}))
    finally:
        for replica in (near, far):
            replica.kill()


def test_64_clients_ask_while_their_only_service_is_killed_and_restarted(
    start_service: StartService, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    paths = [str(Path(__file__).parents[1] / "server"), os.environ.get("PYTHONPATH", "")]
    monkeypatch.setenv("PYTHONPATH", os.pathsep.join(filter(None, paths)))
    planned = tmp_path / "planned"
    planner = ("--planner", "planners_for_tests:Naughty", "--argument", f"planned={planned}")
    lone = Replica(start_service, tmp_path, "lone", *planner)
    urls = [lone.http] * 60 + [f"zenoh://{lone.zenoh}"] * 4
    clients = [connect(url, handshake=IN_TIME_S) for url in urls]
    stop = threading.Event()
    told: list[list[tuple[str, SubgoalReply | PlannerError]]] = [[] for _ in clients]

    def ask_on(index: int) -> None:
        alone = Asking([clients[index]], "sleep 0.001")  # so that some are being planned when it is killed
        while not stop.wait(0.1):
            told[index].append(alone._ask(clients[index]))

    threads = [threading.Thread(target=ask_on, args=(index,)) for index in range(len(clients))]
    for thread in threads:
        thread.start()
    try:
        for _ in range(2):
            time.sleep(0.5)
            lone.kill()
            time.sleep(0.5)
            lone.start()
        seen = [len(answers) for answers in told]
        until(
            lambda: all(
                any(isinstance(answer, SubgoalReply) for _, answer in answers[before:])
                for answers, before in zip(told, seen, strict=True)
            )
        )
    finally:
        stop.set()
        for thread in threads:
            thread.join(IN_TIME_S)
    assert not any(thread.is_alive() for thread in threads)
    begun = planned.read_text().splitlines()
    assert len(set(begun)) == len(begun), "nothing is planned twice"
    assert len(begun) >= sum(isinstance(answer, SubgoalReply) for answers in told for _, answer in answers)
    for client, answers in zip(clients, told, strict=True):
        replies = [(name, answer) for name, answer in answers if isinstance(answer, SubgoalReply)]
        assert all(answer.request_id == name for name, answer in replies)
        failures = [answer for _, answer in answers if isinstance(answer, PlannerError)]
        assert all(isinstance(failure, Unavailable) for failure in failures), failures
        assert (client.counts.answered, client.counts.failed) == (len(replies), len(failures))
        client.close()
    assert sum(isinstance(answer, Unavailable) for answers in told for _, answer in answers) > 0
