"""A transport over several replicas of one planning service.

    ask the one with fewest questions outstanding ─► it answers: done
                                                 └► it is gone, or has no room: ask another, within the deadline

A replica that fails is put out and asked from time to time who it is; once it says so, and embeds in the space that the
others embed in, it is back. While all are out, questions fail at once. One that keeps a question waiting is asked
whether it lives, so that one that is frozen or cut off is told from one that is slow.

A request for a subgoal may be asked twice without harm, and is answered once. One on which a planner broke is not
asked elsewhere: it could break the others too. How bodies travel is the links' concern.
"""

import logging
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial

from thinknav_proto import (
    PROTOCOL_VERSION,
    DeadlineExceeded,
    EmbedReply,
    EmbedRequest,
    Overloaded,
    PlannerError,
    PlannerFailed,
    PlannerInfo,
    ProtocolMismatch,
    SubgoalReply,
    SubgoalRequest,
    Unavailable,
    decode_embed_reply,
    decode_info,
    decode_replies,
    encode_embed_request,
    encode_requests,
)
from thinknav_trainer.planner.link import Link, Question, settle_error
from thinknav_trainer.planner.member import FAILURES, PROBE_S, Member, State

logger = logging.getLogger(__name__)

Answer = SubgoalReply | PlannerError

# Seconds beyond the deadline of a question for the travel of its bytes.
GRACE_S = 5.0
# Seconds between two looks at replicas that are out or keep somebody waiting.
_TICK_S = 0.2


class Balancer:
    """See `Transport`. Replicas may come and go while it is used.

    nobody: what to tell the user when there is no replica to ask. patience: seconds that `info` waits for one.
    fixed: whether all replicas there can be are given; then `info` need not wait once each has failed.
    timeout: seconds for texts to be embedded.
    """

    def __init__(
        self,
        links: Sequence[Link] = (),
        *,
        nobody: str = "there is no planning service to ask",
        patience: float = 60.0,
        fixed: bool = True,
        timeout: float = 30.0,
        on_close: Callable[[], None] = lambda: None,
    ) -> None:
        self._members = {link.name: Member(link) for link in links}
        self._nobody = nobody
        self._patience = patience
        self._fixed = fixed
        self._timeout = timeout
        self._on_close = on_close
        self._info: list[PlannerInfo] = []  # what the first replica said, once one has
        self._questions = 0
        self._closed = False
        self._changed = threading.Condition(threading.RLock())
        threading.Thread(target=self._watch, name="planner-watch", daemon=True).start()

    def add(self, link: Link) -> None:
        """A replica has come, or come back. It is asked who it is before it is asked anything else."""
        with self._changed:
            self._members[link.name] = Member(link)
            self._changed.notify_all()

    def remove(self, name: str) -> None:
        """A replica goes; what it is asked may still be answered."""
        with self._changed:
            self._members.pop(name, None)

    @property
    def serving(self) -> list[str]:
        """The names of the replicas that may be asked now."""
        with self._changed:
            return sorted(member.name for member in self._members.values() if member.state is State.SERVING)

    def info(self) -> PlannerInfo:
        with self._changed:
            self._changed.wait_for(self._introduced, self._patience)
            if not self._info:
                raise self._why_nobody()
            return self._info[0]

    def ask(self, requests: Sequence[SubgoalRequest]) -> Sequence[Answer]:
        began = time.monotonic()
        answers: dict[int, Answer] = {}
        waiting = list(range(len(requests)))
        tried: set[str] = set()
        elapsed = 0.0
        while waiting and (member := self._choose(tried)):
            tried.add(member.name)
            part = [_after(elapsed, requests[i]) for i in waiting]
            answers.update(zip(waiting, self._ask_member(member, part), strict=True))
            elapsed = time.monotonic() - began
            waiting = [
                i
                for i in waiting
                if isinstance(answers[i], Unavailable | Overloaded) and requests[i].deadline > elapsed
            ]
        if requests and not answers:
            with self._changed:
                raise self._why_nobody()
        return [answers[i] for i in range(len(requests))]

    def embed(self, request: EmbedRequest) -> EmbedReply:
        tried: set[str] = set()
        body = encode_embed_request(request)
        error: PlannerError | None = None
        while member := self._choose(tried):
            tried.add(member.name)
            try:
                return decode_embed_reply(self._send(member, "embed", body, self._timeout))
            except Unavailable as failure:
                error = failure
                self._put_out(member, failure)
        with self._changed:
            raise error or self._why_nobody()

    def close(self) -> None:
        with self._changed:
            self._closed = True
            members = list(self._members.values())
            self._changed.notify_all()
        for member in members:
            member.link.close()
        self._on_close()

    def _introduced(self) -> bool:
        failed = self._fixed and all(member.error for member in self._members.values())
        return bool(self._info) or failed or self._closed

    def _choose(self, tried: set[str]) -> Member | None:
        """The replica with fewest questions, of those that serve and were not tried; it then has one more."""
        with self._changed:
            serving = [m for m in self._members.values() if m.state is State.SERVING and m.name not in tried]
            if not serving:
                return None
            chosen = min(serving, key=lambda member: (member.questions, member.used))
            chosen.questions += 1
            self._questions += 1
            chosen.used = self._questions
            return chosen

    def _ask_member(self, member: Member, requests: Sequence[SubgoalRequest]) -> Sequence[Answer]:
        """The replica's answers, or as many times the error that befell the body."""
        patience = max(request.deadline for request in requests) + GRACE_S
        try:
            answers = decode_replies(self._send(member, "subgoal", encode_requests(requests), patience))
            if len(answers) != len(requests):
                raise ProtocolMismatch(f"{member.name} gave {len(answers)} answers to {len(requests)} requests")
        except PlannerError as error:
            answers = [error.as_value()] * len(requests)
        self._judge(member, answers)
        return answers

    def _judge(self, member: Member, answers: Sequence[Answer]) -> None:
        if any(isinstance(answer, SubgoalReply) for answer in answers):
            with self._changed:
                member.succeed()
            return
        error = answers[0]
        assert isinstance(error, PlannerError)
        if isinstance(error, Unavailable):
            self._put_out(member, error)
        elif isinstance(error, PlannerFailed | DeadlineExceeded | ProtocolMismatch):
            with self._changed:
                member.failures += 1
                if member.failures >= FAILURES and self._another_serves(member):
                    self._put_out(member, error)

    def _send(self, member: Member, question: Question, body: bytes, patience: float) -> bytes:
        """The body of a replica's answer; the watch may give it up for lost before its time. Raises PlannerError."""
        answer = member.link.send(question, body, patience)
        with self._changed:
            if not any(other.outstanding for other in self._members.values()):
                self._changed.notify_all()  # the watch may sleep while nothing is outstanding
            member.outstanding[answer] = time.monotonic()
        try:
            return answer.result(patience + 1.0)
        except TimeoutError:
            raise DeadlineExceeded(f"{member.name} did not answer within {patience:g} s") from None
        finally:
            with self._changed:
                member.questions -= 1
                del member.outstanding[answer]

    def _put_out(self, member: Member, error: PlannerError) -> None:
        with self._changed:
            if member.state is not State.OUT:
                logger.warning("%s is left out: %s", member.name, error)
            member.put_out(time.monotonic(), error)
            self._changed.notify_all()

    def _another_serves(self, member: Member) -> bool:
        return any(other.state is State.SERVING for other in self._members.values() if other is not member)

    def _why_nobody(self) -> PlannerError:
        errors = {member.name: member.error for member in self._members.values() if member.error}
        if not errors:
            return Unavailable(self._nobody)
        if len(errors) == 1:
            return next(iter(errors.values()))
        kinds = {type(error) for error in errors.values()}
        kind = kinds.pop() if len(kinds) == 1 else Unavailable
        return kind(f"none of {len(errors)} replicas can be asked: " + "; ".join(map(str, errors.values())))

    def _watch(self) -> None:
        """In a thread of its own: asks replicas who they are, when there is reason to."""
        while True:
            with self._changed:
                if self._closed:
                    return
                now = time.monotonic()
                for member in self._members.values():
                    if late := member.late_probe(now):
                        settle_error(late, DeadlineExceeded(f"{member.name} is gone: it did not say whether it lives"))
                    if member.wants_probe(now):
                        self._probe(member, now)
                busy = any(member.needs_watching for member in self._members.values())
                self._changed.wait(_TICK_S if busy else None)

    def _probe(self, member: Member, now: float) -> None:
        probe = member.link.send("info", b"", PROBE_S)
        member.begin_probe(now, probe)
        probe.add_done_callback(partial(self._probed, member))

    def _probed(self, member: Member, probe: "Future[bytes]") -> None:
        try:
            self._introduce(member, decode_info(probe.result()))
        except Exception as failure:
            error = failure if isinstance(failure, PlannerError) else Unavailable(f"{member.name} failed: {failure!r}")
            with self._changed:
                member.end_probe(time.monotonic())
                another = self._another_serves(member)
                if member.state is State.SERVING and isinstance(error, DeadlineExceeded) and not another:
                    return  # the last one may be slow even at this: each question waits for its own deadline
                self._put_out(member, error)
                if another:
                    for question in list(member.outstanding):
                        settle_error(question, Unavailable(f"{member.name} no longer answers: {error}"))

    def _introduce(self, member: Member, info: PlannerInfo) -> None:
        """Raises ProtocolMismatch for a replica that does not fit the others."""
        with self._changed:
            first = self._info[0] if self._info else info
            if info.protocol_version != PROTOCOL_VERSION:
                raise ProtocolMismatch(
                    f"the service at {member.name} speaks protocol version {info.protocol_version}, we "
                    f"{PROTOCOL_VERSION}"
                )
            if info.embedding_space != first.embedding_space:
                raise ProtocolMismatch(
                    f"{member.name} embeds in {info.embedding_space}, but this client began with "
                    f"{first.embedding_space}; start it with the text encoder of then"
                )
            if member.state is State.OUT:
                logger.info("%s answers again", member.name)
            if info.identity != first.identity:
                logger.warning("%s plans with %s, the first one with %s", member.name, info.identity, first.identity)
            self._info = self._info or [info]
            member.end_probe(time.monotonic())
            member.serve()
            self._changed.notify_all()


def _after(seconds: float, request: SubgoalRequest) -> SubgoalRequest:
    """A request as it is asked again, that much later."""
    return request.model_copy(update={"deadline": request.deadline - seconds}) if seconds else request
