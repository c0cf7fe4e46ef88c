"""The zenoh door of a planning service: one replica, under keys of its own, announced while it is ready.

It reads a query's body, calls the service and replies, as `http` does; keys, bodies and the form of errors are the
contract's. Zenoh does not tell when a client has gone: a query ends with its deadline.
"""

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Self

import zenoh

from thinknav_proto import (
    PlannerError,
    PlannerFailed,
    alive_key,
    decode_embed_request,
    decode_requests,
    embed_key,
    encode_embed_reply,
    encode_error,
    encode_info,
    encode_replies,
    info_key,
    subgoal_key,
)
from thinknav_server.caller import Caller
from thinknav_server.intake import Intake
from thinknav_server.service import PlanningService

logger = logging.getLogger(__name__)

Handler = Callable[[bytes, Caller], Awaitable[bytes]]

# Seconds that queries in progress are given to end when the door closes; the service has waited for subgoals by then.
GRACE_S = 2.0
# Seconds between two looks at whether the service is ready.
_READINESS_S = 0.1
# Replying waits for the client's socket, so it is done beside the event loop; a client that has stopped reading
# holds one of these until zenoh closes its link.
_REPLIERS = 4


class ZenohDoor:
    """Open as an async context manager, inside the service's; closes the session with itself."""

    def __init__(self, session: zenoh.Session, service: PlanningService, intake: Intake, replica: str) -> None:
        self._session = session
        self._service = service
        self._intake = intake
        self._replica = replica
        self._queries: set[asyncio.Task[None]] = set()

    async def __aenter__(self) -> Self:
        self._repliers = ThreadPoolExecutor(_REPLIERS, thread_name_prefix="zenoh-reply")
        self._queryables = contextlib.ExitStack()
        for key, handler in (
            (subgoal_key(self._replica), self._subgoals),
            (embed_key(self._replica), self._embed),
            (info_key(self._replica), self._info),
        ):
            self._queryables.enter_context(self._answer_at(key, handler))
        self._announcing = asyncio.create_task(self._announce(), name="zenoh-announce")
        return self

    async def __aexit__(self, *_: object) -> None:
        """Clients are told first that this replica goes; what they have asked is answered."""
        self._announcing.cancel()
        await asyncio.gather(self._announcing, return_exceptions=True)
        if self._queries:
            await asyncio.wait(self._queries, timeout=GRACE_S)
        self._queryables.close()
        for query in self._queries:
            query.cancel()
        await asyncio.gather(*self._queries, return_exceptions=True)
        await asyncio.to_thread(self._repliers.shutdown)
        await asyncio.to_thread(self._session.close)

    def _answer_at(self, key: str, handler: Handler) -> "zenoh.Queryable[None]":
        loop = asyncio.get_running_loop()

        def accept(query: zenoh.Query) -> None:  # in a thread of zenoh's, which other queries wait for
            with contextlib.suppress(RuntimeError):  # the loop may have ended: the query goes unanswered
                loop.call_soon_threadsafe(self._begin, key, handler, query)

        return self._session.declare_queryable(key, zenoh.handlers.Callback(accept))

    def _begin(self, key: str, handler: Handler, query: zenoh.Query) -> None:
        task = asyncio.get_running_loop().create_task(self._reply(key, handler, query))
        self._queries.add(task)
        task.add_done_callback(self._queries.discard)

    async def _reply(self, key: str, handler: Handler, query: zenoh.Query) -> None:
        error: PlannerError | None = None
        try:
            with self._intake.body() as body:
                body.add(len(query.payload or b""))
                caller = Caller.of_attachment(query.attachment.to_bytes() if query.attachment else b"")
                answer = await handler(query.payload.to_bytes() if query.payload else b"", caller)
        except PlannerError as refusal:
            error = refusal.as_value()
        except Exception:
            logger.exception("a query on %s failed", key)
            error = PlannerFailed("the service failed; its log says why")
        send = partial(query.reply_err, encode_error(error)) if error else partial(query.reply, key, answer)
        await asyncio.get_running_loop().run_in_executor(self._repliers, _send, query, send)

    async def _subgoals(self, body: bytes, caller: Caller) -> bytes:
        return encode_replies(await self._service.answer_each(decode_requests(body), caller))

    async def _embed(self, body: bytes, _caller: Caller) -> bytes:
        return encode_embed_reply(await self._service.embed(decode_embed_request(body)))

    async def _info(self, _body: bytes, _caller: Caller) -> bytes:
        return encode_info(self._service.introduce())

    async def _announce(self) -> None:
        """Holds the liveliness token while the service is ready."""
        with contextlib.ExitStack() as held:
            announced = False
            while True:
                if self._service.ready and not announced:
                    held.enter_context(self._session.liveliness().declare_token(alive_key(self._replica)))
                    logger.info("replica %s is ready over zenoh", self._replica)
                elif announced and not self._service.ready:
                    held.close()
                    logger.warning("replica %s is not ready", self._replica)
                announced = self._service.ready
                await asyncio.sleep(_READINESS_S)


def _send(query: zenoh.Query, send: Callable[[], None]) -> None:
    try:
        with query:
            send()
    except zenoh.ZError as error:
        logger.warning("a reply could not be sent: %s", error)
