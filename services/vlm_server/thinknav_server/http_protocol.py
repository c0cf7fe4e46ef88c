"""HTTP/1.1 as uvicorn speaks it with httptools, far faster than with h11, and the one limit that httptools lacks.

Knows nothing of what is served.
"""

from uvicorn.protocols.http.httptools_impl import STATUS_LINE, HttpToolsProtocol

# As h11 has it.
MAX_HEAD_BYTES = 64 * 1024


class BoundedHttpProtocol(HttpToolsProtocol):
    """Hangs up on a request whose first line and headers do not end: httptools would read on and keep them all."""

    _in_head = False
    _head_bytes = 0

    def on_message_begin(self) -> None:
        super().on_message_begin()
        self._in_head = True
        self._head_bytes = 0

    def on_headers_complete(self) -> None:
        self._in_head = False
        super().on_headers_complete()

    def data_received(self, data: bytes) -> None:
        super().data_received(data)
        if not self._in_head:
            return
        self._head_bytes += len(data)  # at most a packet too much, where another request came before in it
        if self._head_bytes > MAX_HEAD_BYTES and not self.transport.is_closing():
            reason = f"the headers are longer than {MAX_HEAD_BYTES} bytes".encode()
            head = b"content-type: text/plain; charset=utf-8\r\ncontent-length: %d\r\nconnection: close\r\n\r\n"
            self.transport.write(STATUS_LINE[431] + head % len(reason) + reason)
            self.transport.close()
