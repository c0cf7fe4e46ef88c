"""Several replicas behind one transport: who is asked, who is put out, who comes back, and what the user is told."""

import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor

import numpy as np
import pytest

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import (
    EmbedReply,
    EmbedRequest,
    decode_embed_request,
    decode_requests,
    encode_embed_reply,
    encode_error,
    encode_info,
    encode_replies,
)
from thinknav_trainer.planner import (
    DeadlineExceeded,
    Frame,
    InvalidRequest,
    Overloaded,
    PlannerClient,
    PlannerError,
    PlannerFailed,
    PlannerInfo,
    SubgoalReply,
    SubgoalRequest,
    Unauthenticated,
    Unavailable,
    mock_info,
    reply_to,
)
from thinknav_trainer.planner import member as member_module
from thinknav_trainer.planner.balancer import Balancer
from thinknav_trainer.planner.link import Question, settle, settle_error

FRAME = Frame.raw(np.zeros((2, 2, 3), np.uint8))
SOON = 10.0


def request(name: str, deadline: float = 30.0) -> SubgoalRequest:
    return SubgoalRequest(request_id=name, goal="chair", frame=FRAME, deadline=deadline)


class Replica:
    """A link to nothing, which does as it is told. asked: the ids of each body; deadlines: of their first requests."""

    def __init__(self, name: str, info: PlannerInfo = mock_info()) -> None:
        self.name = name
        self.info = info
        self.does: Callable[[SubgoalRequest], SubgoalReply | PlannerError] = lambda r: reply_to(r, f"ask {name}")
        self.gone: PlannerError | None = None
        self.frozen = False
        self.asked: list[list[str]] = []
        self.deadlines: list[float] = []
        self.held: list[tuple[list[SubgoalRequest], Future[bytes]]] = []
        self.introduced = self.unheard = 0  # how often it said who it is, and how often it was asked in vain

    def send(self, question: Question, body: bytes, patience: float) -> "Future[bytes]":
        answer: Future[bytes] = Future()
        if question == "subgoal":
            requests = [r for r in decode_requests(body) if isinstance(r, SubgoalRequest)]
            self.asked.append([r.request_id for r in requests])
            self.deadlines.append(requests[0].deadline)
            self.held.append((requests, answer))
        if self.gone is not None:
            settle_error(answer, self.gone)
        elif self.frozen:
            self.unheard += question == "info"
        elif question == "subgoal":
            self.release()
        elif question == "embed":
            embeddings = shipped_text_encoder().encode(decode_embed_request(body).texts)
            settle(
                answer, encode_embed_reply(EmbedReply(embedding_space=self.info.embedding_space, embeddings=embeddings))
            )
        else:
            self.introduced += 1
            settle(answer, encode_info(self.info))
        return answer

    def release(self) -> None:
        for requests, answer in self.held:
            settle(answer, encode_replies([self.does(r) for r in requests]))
        self.held.clear()

    def close(self) -> None:
        self.gone = Unavailable("closed")


@pytest.fixture(autouse=True)
def _impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("FIRST_RETRY_S", 0.02), ("LONGEST_RETRY_S", 0.05), ("SUSPECT_S", 0.1), ("PROBE_S", 0.1)):
        monkeypatch.setattr(member_module, name, value)
    monkeypatch.setattr("thinknav_trainer.planner.balancer._TICK_S", 0.01)


@pytest.fixture
def pair() -> Iterator[tuple[Replica, Replica, Balancer]]:
    one, two = Replica("one"), Replica("two")
    balancer = Balancer([one, two])
    balancer.info()
    until(lambda: len(balancer.serving) == 2)
    yield one, two, balancer
    balancer.close()


def until(true: Callable[[], bool]) -> None:
    end = time.monotonic() + SOON
    while not true():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.005)


def ask(balancer: Balancer, name: str = "0", deadline: float = 30.0) -> SubgoalReply | PlannerError:
    (answer,) = balancer.ask([request(name, deadline)])
    return answer


def who(answer: SubgoalReply | PlannerError) -> str:
    assert isinstance(answer, SubgoalReply), repr(answer)
    return answer.subgoal.removeprefix("ask ")


def test_equal_replicas_take_turns(pair: tuple[Replica, Replica, Balancer]) -> None:
    one, two, balancer = pair
    for index in range(10):
        ask(balancer, str(index))
    assert len(one.asked) == len(two.asked) == 5


def test_the_one_with_fewest_questions_outstanding_is_asked(pair: tuple[Replica, Replica, Balancer]) -> None:
    one, two, balancer = pair
    one.frozen = two.frozen = True
    with ThreadPoolExecutor(8) as threads:
        asking = [threads.submit(ask, balancer, str(index)) for index in range(6)]
        until(lambda: len(one.held) + len(two.held) == 6)
        assert (len(one.held), len(two.held)) == (3, 3)
        two.release()
        until(lambda: sum(future.done() for future in asking) == 3)
        late = threads.submit(ask, balancer, "late")
        until(lambda: len(two.held) == 1)
        one.frozen = two.frozen = False  # before somebody asks whether they live
        one.release()
        two.release()
        assert who(late.result(SOON)) == "two"
        assert all(isinstance(future.result(SOON), SubgoalReply) for future in asking)


def test_who_cannot_be_reached_is_left_out_and_another_asked_with_what_is_left_of_the_deadline(
    pair: tuple[Replica, Replica, Balancer],
) -> None:
    one, two, balancer = pair
    one.gone = Unavailable("the cable is out")
    answers = [ask(balancer, str(index), deadline=9.0) for index in range(6)]
    assert [who(answer) for answer in answers] == ["two"] * 6
    assert len(one.asked) <= 1
    assert all(8.0 < deadline <= 9.0 for deadline in two.deadlines)
    assert min(two.deadlines) < 9.0  # the one that was asked again


def test_who_is_left_out_comes_back(pair: tuple[Replica, Replica, Balancer]) -> None:
    one, _two, balancer = pair
    one.gone = Unavailable("the cable is out")
    for index in range(4):
        ask(balancer, str(index))
    one.gone = None
    until(lambda: len(balancer.serving) == 2)
    answers = [ask(balancer, str(index)) for index in range(4)]
    assert {who(answer) for answer in answers} == {"one", "two"}


def test_while_all_are_gone_questions_fail_at_once_and_say_why(pair: tuple[Replica, Replica, Balancer]) -> None:
    one, two, balancer = pair
    one.gone, two.gone = Unavailable("one has no power"), Unavailable("two is on fire")
    assert isinstance(ask(balancer), Unavailable)
    before = len(one.asked), len(two.asked)
    with pytest.raises(Unavailable, match="none of 2 replicas can be asked: one has no power; two is on fire"):
        ask(balancer)
    with pytest.raises(Unavailable, match="none of 2 replicas"):
        balancer.embed(EmbedRequest(texts=("find a chair",)))
    assert (len(one.asked), len(two.asked)) == before
    two.gone = None
    until(lambda: balancer.serving == ["two"])
    assert who(ask(balancer)) == "two"


def test_a_frozen_replica_is_found_out_and_its_questions_asked_elsewhere_once(
    pair: tuple[Replica, Replica, Balancer],
) -> None:
    one, two, balancer = pair
    one.frozen = True
    with ThreadPoolExecutor(4) as threads:
        answers = list(threads.map(lambda index: ask(balancer, str(index)), range(4)))
    assert [who(answer) for answer in answers] == ["two"] * 4
    assert sorted(name for body in two.asked for name in body) == list("0123")
    one.frozen = False
    one.release()  # its answers come too late for anybody to hear
    until(lambda: len(balancer.serving) == 2)
    assert {who(ask(balancer, str(index))) for index in range(4)} == {"one", "two"}


def test_a_slow_replica_is_waited_for(pair: tuple[Replica, Replica, Balancer]) -> None:
    one, _two, balancer = pair
    slow: dict[str, Future[bytes]] = {}
    send = one.send

    def send_slowly(question: Question, body: bytes, patience: float) -> "Future[bytes]":
        if question != "subgoal":
            return send(question, body, patience)
        return slow.setdefault(body.hex(), Future())

    one.send = send_slowly  # type: ignore[method-assign]
    with ThreadPoolExecutor(2) as threads:
        asking = [threads.submit(ask, balancer, str(index)) for index in range(2)]
        before = one.introduced
        until(lambda: one.introduced >= before + 3)  # it was asked whether it lives, and did
        (late,) = slow.values()
        settle(late, encode_replies([reply_to(request(str(i)), "ask one") for i in range(1)]))
        answers = [future.result(SOON) for future in asking]
    assert {who(answer) for answer in answers} == {"one", "two"}


def test_a_lone_replica_that_does_not_say_whether_it_lives_is_asked_on() -> None:
    lone = Replica("lone")
    balancer = Balancer([lone])
    balancer.info()
    lone.frozen = True
    with ThreadPoolExecutor(1) as threads:
        asking = threads.submit(ask, balancer)
        until(lambda: len(lone.held) == 1)
        until(lambda: lone.unheard >= 2)
        assert balancer.serving == ["lone"]
        lone.frozen = False
        lone.release()
        assert who(asking.result(SOON)) == "lone"
    balancer.close()


@pytest.mark.parametrize("kind", [InvalidRequest, PlannerFailed, DeadlineExceeded])
def test_what_another_replica_would_not_mend_is_not_asked_again(
    pair: tuple[Replica, Replica, Balancer], kind: type[PlannerError]
) -> None:
    one, two, balancer = pair
    one.does = two.does = lambda _: kind("no")
    assert isinstance(ask(balancer), kind)
    assert len(one.asked) + len(two.asked) == 1


def test_only_the_items_for_which_there_was_no_room_are_asked_elsewhere(
    pair: tuple[Replica, Replica, Balancer],
) -> None:
    one, two, balancer = pair
    one.does = lambda r: Overloaded("full") if r.request_id in "13" else reply_to(r, "ask one")
    two.does = lambda r: Overloaded("full") if r.request_id == "3" else reply_to(r, "ask two")
    ask(balancer, "turn")
    if two.asked:
        ask(balancer, "turn")
    answers = balancer.ask([request(str(index)) for index in range(4)])
    if one.asked[-1] == ["0", "1", "2", "3"]:
        assert two.asked[-1] == ["1", "3"]
    else:
        assert (two.asked[-1], one.asked[-1]) == (["0", "1", "2", "3"], ["3"])
    assert [type(answer) for answer in answers] == [SubgoalReply, SubgoalReply, SubgoalReply, Overloaded]
    answer = ask(balancer, "no body is put out for being busy")
    assert isinstance(answer, SubgoalReply)


def test_who_is_not_asked_for_want_of_time_has_no_question_to_answer(pair: tuple[Replica, Replica, Balancer]) -> None:
    def too_late(_: SubgoalRequest) -> PlannerError:
        time.sleep(0.05)
        return Overloaded("full")

    one, two, balancer = pair
    answers = one.does, two.does
    one.does = two.does = too_late
    assert isinstance(ask(balancer, "late", deadline=0.01), Overloaded)
    assert len(one.asked) + len(two.asked) == 1
    one.does, two.does = answers
    for index in range(9):
        ask(balancer, str(index))
    assert len(one.asked) == len(two.asked) == 5


def test_who_fails_again_and_again_is_left_out_while_another_does_not(
    pair: tuple[Replica, Replica, Balancer],
) -> None:
    one, two, balancer = pair
    one.does = lambda _: PlannerFailed("out of memory")
    answers = [ask(balancer, str(index)) for index in range(40)]
    failed = sum(isinstance(answer, PlannerFailed) for answer in answers)
    assert 5 <= failed <= 12
    two.does = one.does
    answers = [ask(balancer, str(index)) for index in range(20)]
    assert all(isinstance(answer, PlannerFailed) for answer in answers), "the last one is never left out for this"


def test_a_replica_of_another_embedding_space_is_never_asked(pair: tuple[Replica, Replica, Balancer]) -> None:
    one, two, balancer = pair
    two.gone = Unavailable("restarting")
    for index in range(3):
        ask(balancer, str(index))
    two.info, two.gone, asked = mock_info().model_copy(update={"embedding_space": "clip@1"}), None, len(two.asked)
    before = two.introduced
    until(lambda: two.introduced > before + 1)
    assert {who(ask(balancer, str(index))) for index in range(6)} == {"one"}
    assert len(two.asked) == asked
    one.gone = Unavailable("gone too")
    ask(balancer)
    with pytest.raises(Unavailable, match=r"two embeds in clip@1, but this client began with thinknav-clip"):
        ask(balancer)


def test_replicas_come_and_go() -> None:
    balancer = Balancer(nobody="nobody is there", patience=0.05, fixed=False)
    with pytest.raises(Unavailable, match="nobody is there"):
        balancer.info()
    one = Replica("one")
    balancer.add(one)
    balancer._patience = SOON
    assert balancer.info() == mock_info()
    assert who(ask(balancer)) == "one"
    one.frozen = True
    with ThreadPoolExecutor(1) as threads:
        asking = threads.submit(ask, balancer)
        until(lambda: len(one.held) == 1)
        balancer.remove("one")
        with pytest.raises(Unavailable, match="nobody is there"):
            ask(balancer)
        one.release()
        assert who(asking.result(SOON)) == "one", "it had time to answer what it was asked"
    balancer.close()


def test_who_never_says_who_it_is_is_no_planner() -> None:
    wrong = Replica("wrong")
    wrong.gone = Unauthenticated("who are you")
    balancer = Balancer([wrong])
    with pytest.raises(Unauthenticated, match="who are you"):
        balancer.info()
    balancer.close()


def test_an_error_of_the_whole_body_befalls_each_of_its_requests(pair: tuple[Replica, Replica, Balancer]) -> None:
    one, two, balancer = pair

    def send(question: Question, body: bytes, patience: float) -> "Future[bytes]":
        answer: Future[bytes] = Future()
        settle(answer, encode_error(InvalidRequest("too long")) if question == "subgoal" else encode_info(mock_info()))
        return answer

    one.send = two.send = send  # type: ignore[method-assign]
    answers = balancer.ask([request("0"), request("1")])
    assert [str(answer) for answer in answers] == ["too long"] * 2


def test_texts_are_embedded_by_whoever_is_there(pair: tuple[Replica, Replica, Balancer]) -> None:
    one, _two, balancer = pair
    with PlannerClient(balancer) as client:
        for _ in range(2):  # each is asked first once
            one.gone = Unavailable("the cable is out")
            expected = shipped_text_encoder().encode(["find a chair"])
            np.testing.assert_array_equal(client.embed(["find a chair"]), expected)
            one.gone = None
            until(lambda: len(balancer.serving) == 2)


def test_no_answer_is_lost_or_doubled_while_replicas_fail_at_random(pair: tuple[Replica, Replica, Balancer]) -> None:
    one, two, balancer = pair
    stop = threading.Event()
    randomness = np.random.default_rng(0)

    def disturb() -> None:
        while not stop.wait(0.005):
            for replica in (one, two):
                replica.gone = Unavailable("flaky") if randomness.random() < 0.4 else None

    disturbing = threading.Thread(target=disturb)
    disturbing.start()
    with PlannerClient(balancer) as client:
        with ThreadPoolExecutor(8) as threads:
            names = [[f"{body}-{item}" for item in range(3)] for body in range(200)]
            answers = list(threads.map(lambda body: client.ask([request(name) for name in body]), names))
        stop.set()
        disturbing.join()
        assert client.counts.asked == 600
    for body, given in zip(names, answers, strict=True):
        assert len(given) == 3
        for name, answer in zip(body, given, strict=True):
            assert isinstance(answer, Unavailable) or (
                isinstance(answer, SubgoalReply) and answer.request_id == name
            ), repr(answer)
