"""The planner's process: `python -m thinknav_server.hosts.child FD`, started by `process`.

It loads the planner, then answers batches one after another until the other end of its socket closes: with the
service that started it, it ends too, whatever the planner is doing. While it plans one batch, it decodes the next.
"""

import contextlib
import json
import logging
import os
import queue
import signal
import socket
import sys
import threading

import numpy as np

from thinknav_proto import decode_requests
from thinknav_server.hosts.base import Identity
from thinknav_server.hosts.wire import HEADER, Kind, message, pack_identity, pack_thoughts, unpack_texts
from thinknav_server.images import PixelMemory
from thinknav_server.logs import LogFormat, LogLevel, configure_logs
from thinknav_server.planners.options import PlannerOptions, load_thinker
from thinknav_server.thinking import DecodedBatch, Thinker, decoded_batch

logger = logging.getLogger(__name__)

Batches = queue.SimpleQueue["_Batch"]


def main() -> None:
    """Load, then answer."""
    # Whoever stops the service stops this process through it, when its last answers are given.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    channel = _Channel(socket.socket(fileno=int(sys.argv[1])))
    call, _, body = channel.receive()
    boot = json.loads(body)
    configure_logs(LogLevel(boot["log_level"]), LogFormat(boot["log_format"]))
    batches: Batches = queue.SimpleQueue()
    encoders: queue.SimpleQueue[Thinker] = queue.SimpleQueue()
    busy = threading.Event()
    threading.Thread(target=_listen, args=(channel, batches, encoders, busy), name="listen", daemon=True).start()
    try:
        thinker = load_thinker(PlannerOptions.model_validate(boot["options"]))
    except ValueError as error:
        channel.send(call, Kind.REFUSED, str(error).encode())
        return
    except Exception as error:
        logger.exception("the planner cannot be loaded")
        channel.send(call, Kind.REFUSED, _in_short(error))
        return
    encoders.put(thinker)
    encoder = thinker.text_encoder
    identity = Identity(thinker.planner.identity, encoder.space, encoder.dimension)
    channel.send(call, Kind.LOADED, pack_identity(identity))
    memory = PixelMemory()
    while True:
        batch = batches.get()
        busy.set()
        try:
            answer = pack_thoughts(thinker.think_decoded(batch.decode(memory)))
        except Exception as error:
            logger.exception("a batch failed")
            channel.send(batch.call, Kind.FAILED, _in_short(error))
        else:
            channel.send(batch.call, Kind.THINK, answer)
        busy.clear()


def _in_short(error: Exception) -> bytes:
    return f"{type(error).__name__}: {str(error)[:200]}".encode()


class _Batch:
    """A batch as it came."""

    def __init__(self, call: int, body: bytes) -> None:
        self.call = call
        self._body = body
        self._decoded: list[DecodedBatch] = []
        self._decoding = threading.Lock()

    def decode(self, memory: PixelMemory) -> DecodedBatch:
        """Done by whoever asks first, in his memory; another waits for him."""
        with self._decoding:
            if not self._decoded:
                self._decoded.append(decoded_batch(decode_requests(self._body), memory))
            return self._decoded[0]


def _listen(
    channel: "_Channel", batches: Batches, encoders: "queue.SimpleQueue[Thinker]", busy: threading.Event
) -> None:
    """Passes batches on, and embeds texts itself so that they need not wait behind a batch."""
    ahead: Batches = queue.SimpleQueue()
    threading.Thread(target=_decode_ahead, args=(ahead,), name="decode", daemon=True).start()
    try:
        thinker: Thinker | None = None
        while True:
            call, kind, body = channel.receive()
            if kind is Kind.THINK:
                batch = _Batch(call, body)
                batches.put(batch)
                if busy.is_set():
                    ahead.put(batch)
                continue
            thinker = thinker or encoders.get()
            try:
                embeddings = thinker.text_encoder.encode(unpack_texts(body)).astype(np.float32, copy=False)
            except Exception as error:
                logger.exception("the text encoder failed")
                channel.send(call, Kind.FAILED, _in_short(error))
            else:
                channel.send(call, Kind.EMBED, embeddings.tobytes())
    except OSError:
        os._exit(0)  # the service is gone; the main thread may be busy for ever


def _decode_ahead(batches: Batches) -> None:
    memory = PixelMemory()
    while True:
        batch = batches.get()
        with contextlib.suppress(Exception):  # it comes again where the batch is planned, and is told there
            batch.decode(memory)


class _Channel:
    """Whole messages over a blocking socket. Both directions raise OSError once the other end is closed."""

    def __init__(self, connection: socket.socket) -> None:
        self._socket = connection
        self._sending = threading.Lock()

    def receive(self) -> tuple[int, Kind, bytes]:
        length, call, kind = HEADER.unpack(self._read(HEADER.size))
        return call, Kind(kind), bytes(self._read(length))

    def send(self, call: int, kind: Kind, body: bytes) -> None:
        with self._sending:
            self._socket.sendall(message(call, kind, body))

    def _read(self, length: int) -> bytearray:
        content = bytearray(length)
        view = memoryview(content)
        while view:
            received = self._socket.recv_into(view)
            if not received:
                raise ConnectionResetError("the service is gone")
            view = view[received:]
        return content


if __name__ == "__main__":
    main()
