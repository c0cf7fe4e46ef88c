"""HTTP/1.1 as uvicorn speaks it with httptools, far faster than with h11, and the one limit that httptools lacks.

Knows nothing of what is served.
"""

from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

# As h11 has it.
MAX_HEAD_BYTES = 64 * 1024


class BoundedHttpProtocol(HttpToolsProtocol):
    """Hangs up on a request whose first line and headers, or trailers, do not end: httptools would keep them all."""

    _in_head = False
    _came_to_something = False  # a head, a part of a body or a request that ended, in what was received last
    _fruitless_bytes = 0  # since then

    def on_message_begin(self) -> None:
        self._in_head, self._fruitless_bytes = True, 0
        super().on_message_begin()

    def on_headers_complete(self) -> None:
        self._in_head, self._came_to_something = False, True
        super().on_headers_complete()

    def on_body(self, body: bytes) -> None:
        self._came_to_something = True
        super().on_body(body)

    def on_message_complete(self) -> None:
        self._came_to_something = True
        super().on_message_complete()

    def data_received(self, data: bytes) -> None:
        self._came_to_something = False
        super().data_received(data)
        self._fruitless_bytes = 0 if self._came_to_something else self._fruitless_bytes + len(data)
        if self._fruitless_bytes > MAX_HEAD_BYTES and not self.transport.is_closing():
            self._hang_up()

    def _hang_up(self) -> None:
        if self._in_head:  # otherwise there may have been an answer already
            reason = f"the headers are longer than {MAX_HEAD_BYTES} bytes".encode()
            head = b"content-type: text/plain; charset=utf-8\r\ncontent-length: %d\r\nconnection: close\r\n\r\n"
            self.transport.write(STATUS_LINE[431] + head % len(reason) + reason)
        self.transport.close()
