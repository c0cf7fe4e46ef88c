"""What a service does with bodies made to break it: 4xx in the contract's form, and no memory spent on them."""

import io
import json
import socket
import struct
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from subprocess import Popen
from urllib.parse import urlsplit

import httpx
import numpy as np
import pytest
import simplejpeg
from PIL import Image

from thinknav_proto import (
    CONTENT_TYPE,
    Frame,
    InvalidRequest,
    SubgoalReply,
    SubgoalRequest,
    decode_replies,
    encode_requests,
)

StartService = Callable[..., tuple[str, "Popen[str]"]]

PNG_START = b"\x89PNG\r\n\x1a\n"
MEGABYTE = 1024 * 1024
BODY_LIMIT = 8 * MEGABYTE
# What Python and the allocator may take for themselves while they refuse; each bomb below would take 200 MB and more.
SLACK = 48 * MEGABYTE


def chunk(name: bytes, data: bytes) -> bytes:
    return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))


def header(width: int, height: int) -> bytes:
    return chunk(b"IHDR", struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0))


def png(*chunks: bytes) -> bytes:
    return b"".join((PNG_START, *chunks, chunk(b"IEND", b"")))


@cache
def zeros(megabytes: int) -> bytes:
    """That many zeros, deflated."""
    deflate = zlib.compressobj(1)
    return b"".join([deflate.compress(bytes(MEGABYTE)) for _ in range(megabytes)]) + deflate.flush()


def small_rows() -> bytes:
    return chunk(b"IDAT", zlib.compress(bytes(16 * 49)))


def jpeg_announcing(width: int, height: int) -> bytes:
    """A small JPEG file whose header tells of another size."""
    data: bytes = simplejpeg.encode_jpeg(np.zeros((16, 16, 3), np.uint8))
    start = data.index(b"\xff\xc0") + 5
    return data[:start] + struct.pack(">HH", height, width) + data[start + 4 :]


def jpeg_of_scans(count: int) -> bytes:
    file = io.BytesIO()
    Image.fromarray(np.zeros((2048, 2048, 3), np.uint8)).save(file, "JPEG", progressive=True)
    data = file.getvalue()
    return data[:-2] + data[data.rfind(b"\xff\xda") : -2] * count + data[-2:]


FILES: dict[str, Callable[[], bytes]] = {
    "PNG header of 60,000 x 60,000": lambda: png(header(60_000, 60_000)),
    "PNG that holds 9,000 x 9,000 and says so": lambda: png(header(9000, 9000), chunk(b"IDAT", zeros(244))),
    "PNG with a second header": lambda: png(header(16, 16), header(9000, 9000), chunk(b"IDAT", zeros(244))),
    "PNG with a text of 256 MB": lambda: png(header(16, 16), chunk(b"zTXt", b"k\0\0" + zeros(256)), small_rows()),
    "PNG with a profile of 256 MB": lambda: png(header(16, 16), chunk(b"iCCP", b"k\0\0" + zeros(256)), small_rows()),
    "PNG cut short": lambda: png(header(16, 16), small_rows())[:-40],
    "PNG larger than its pixels": lambda: png(header(2000, 2000), small_rows()),
    "JPEG header of 65,000 x 65,000": lambda: jpeg_announcing(65_000, 65_000),
    "JPEG larger than its pixels": lambda: jpeg_announcing(2000, 2000),
    "JPEG of 10,000 scans": lambda: jpeg_of_scans(10_000),
    "JPEG cut short": lambda: jpeg_announcing(16, 16)[:-20],
    "JPEG that is a start alone": lambda: b"\xff\xd8\xff",
    "text": lambda: b"no picture at all",
}


@pytest.fixture(scope="module")
def service(start_service: StartService) -> tuple[str, "Popen[str]"]:
    return start_service("--max-body-bytes", str(BODY_LIMIT), "--body-timeout", "1", "--max-frames", "8")


def post(url: str, body: bytes, kind: str = CONTENT_TYPE) -> httpx.Response:
    return httpx.post(
        f"{url}/v1/subgoals", content=body, headers={"Content-Type": kind}, trust_env=False, timeout=httpx.Timeout(20)
    )


def asking(*frames: Frame, goal: str = "chair") -> bytes:
    return encode_requests([SubgoalRequest(request_id=str(i), goal=goal, frame=f) for i, f in enumerate(frames)])


def good_frame() -> Frame:
    return Frame.raw(np.zeros((16, 16, 3), np.uint8))


def peak_memory(process: "Popen[str]") -> int:
    """Bytes that the process had in memory at most since it began."""
    status = Path(f"/proc/{process.pid}/status")
    if not status.exists():
        pytest.skip("this system has no /proc to read a process's peak memory from")
    (line,) = [line for line in status.read_text().splitlines() if line.startswith("VmHWM")]
    return int(line.split()[1]) * 1024


def check_it_lives(url: str) -> None:
    assert [type(answer) for answer in decode_replies(post(url, asking(good_frame())).content)] == [SubgoalReply]


@pytest.mark.parametrize("name", FILES)
def test_a_file_made_to_break_decoders_is_refused_and_takes_no_memory(
    service: tuple[str, "Popen[str]"], name: str
) -> None:
    url, process = service
    data = FILES[name]()
    check_it_lives(url)
    before = peak_memory(process)
    response = httpx.post(
        f"{url}/v1/subgoals", data={"goal": "chair"}, files={"frame": data}, trust_env=False, timeout=20
    )
    assert response.status_code == 400, response.text[:300]
    assert response.json()["replies"][0]["error"]["code"] == "invalid_request"
    if data.startswith((PNG_START, b"\xff\xd8\xff")):
        frame = Frame(encoding="png" if data.startswith(PNG_START) else "jpeg", data=data)
        answers = decode_replies(post(url, asking(frame, good_frame())).content)
        assert [type(answer) for answer in answers] == [InvalidRequest, SubgoalReply]
    assert peak_memory(process) - before < SLACK
    check_it_lives(url)


def nested(depth: int) -> bytes:
    return b"\x82\xa7version\x01\xa8requests" + b"\x91" * depth + b"\xc0"


BODIES: dict[str, Callable[[], bytes]] = {
    "empty": lambda: b"",
    "an array said to have 4 billion items": lambda: b"\x82\xa7version\x01\xa8requests\xdd\xff\xff\xff\xff",
    "bytes said to be 4 GB": lambda: b"\x82\xa7version\x01\xa8requests\xc6\xff\xff\xff\xff",
    "arrays in arrays": lambda: nested(100_000),
    "JSON": lambda: json.dumps({"version": 1, "requests": []}).encode(),
    "no requests at all": lambda: asking()[:-1],
    "more frames than the limit": lambda: asking(*[good_frame()] * 9),
    "a goal that is a book": lambda: asking(good_frame(), goal="x" * 100_000),
    "as long as the limit and one more": lambda: bytes(BODY_LIMIT + 1),
    "ten times as long as the limit": lambda: bytes(10 * BODY_LIMIT),
}


@pytest.mark.parametrize("name", BODIES)
def test_a_body_that_breaks_the_contract_is_refused_and_takes_no_memory(
    service: tuple[str, "Popen[str]"], name: str
) -> None:
    url, process = service
    body = BODIES[name]()
    check_it_lives(url)
    before = peak_memory(process)
    response = post(url, body)
    assert response.status_code == 400
    assert response.headers["content-type"] == CONTENT_TYPE
    try:
        (answer,) = decode_replies(response.content)
    except InvalidRequest as error:
        answer = error
    assert isinstance(answer, InvalidRequest)
    assert peak_memory(process) - before < SLACK
    check_it_lives(url)


def begin(url: str, length: int, start: bytes, kind: str = CONTENT_TYPE) -> socket.socket:
    """A connection on which the start of a body of `length` bytes was sent, and no more."""
    address = urlsplit(url)
    connection = socket.create_connection((address.hostname or "", address.port or 0), timeout=20)
    head = f"POST /v1/subgoals HTTP/1.1\r\nHost: x\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n\r\n"
    connection.sendall(head.encode() + start)
    return connection


def test_a_body_that_never_ends_is_not_waited_for(service: tuple[str, "Popen[str]"]) -> None:
    url, _ = service
    with begin(url, 1000, b"ab") as connection:
        told = b"".join(iter(lambda: connection.recv(65536), b""))
    assert told.startswith(b"HTTP/1.1 400 ")
    assert b"did not arrive within 1 s" in told


def test_clients_that_hang_up_while_they_send_leave_no_trace_in_the_log(start_service: StartService) -> None:
    url, process = start_service()
    for kind in (CONTENT_TYPE, "multipart/form-data; boundary=x"):
        begin(url, 1000, b"ab", kind).close()
    check_it_lives(url)
    process.terminate()
    _, log = process.communicate(timeout=30)
    assert "Traceback" not in log
    assert process.returncode == 0


def test_all_bodies_together_have_a_limit(start_service: StartService) -> None:
    url, _ = start_service("--max-body-bytes", "100000", "--max-held-bytes", "100000")
    with begin(url, 100_000, bytes(60_000)):
        body = asking(Frame.raw(np.zeros((128, 128, 3), np.uint8)))
        while (response := post(url, body)).status_code == 200:
            pass  # until the other body's bytes have arrived
        assert response.status_code == 429
        assert int(response.headers["retry-after"]) >= 1
    while post(url, body).status_code != 200:
        pass  # until it is noticed that the other client has hung up


def test_headers_without_an_end_are_cut_short_and_take_no_memory(start_service: StartService) -> None:
    url, process = start_service()
    before = peak_memory(process)
    address = urlsplit(url)
    with socket.create_connection((address.hostname, address.port), timeout=10) as connection:
        connection.sendall(b"POST /v1/subgoals HTTP/1.1\r\nHost: service\r\nX-Long: ")
        with pytest.raises(OSError, match=r"reset|pipe"):
            connection.sendall(128 * MEGABYTE * b"a")
    assert peak_memory(process) - before < SLACK
    assert httpx.get(f"{url}/healthz", trust_env=False).status_code == 200


def test_trailers_without_an_end_are_cut_short_and_take_no_memory(start_service: StartService) -> None:
    url, process = start_service()
    before = peak_memory(process)
    address = urlsplit(url)
    for kind in (b"x: " + 1000 * b"y" + b"\r\n", 1000 * b"y"):
        with socket.create_connection((address.hostname, address.port), timeout=10) as connection:
            connection.sendall(b"POST /v1/subgoals HTTP/1.1\r\nHost: a\r\nTransfer-Encoding: chunked\r\n\r\n0\r\nx: y")
            with pytest.raises(OSError, match=r"reset|pipe"):
                connection.sendall(128 * 1000 * kind)
    assert peak_memory(process) - before < SLACK


def test_a_body_in_chunks_may_be_long_and_have_a_trailer(start_service: StartService) -> None:
    url, _ = start_service()
    address = urlsplit(url)
    body = asking(Frame.raw(np.zeros((200, 200, 3), np.uint8)))
    chunks = b"".join(b"%x\r\n%b\r\n" % (len(part), part) for part in (body[:90_000], body[90_000:]))
    with socket.create_connection((address.hostname, address.port), timeout=10) as connection:
        head = f"POST /v1/subgoals HTTP/1.1\r\nHost: a\r\nContent-Type: {CONTENT_TYPE}\r\n"
        connection.sendall(f"{head}Transfer-Encoding: chunked\r\n\r\n".encode() + chunks + b"0\r\nx: y\r\n\r\n")
        assert b" 200 " in connection.recv(100)


def test_headers_that_are_too_long_are_told_so(start_service: StartService) -> None:
    url, _ = start_service()
    with httpx.Client(trust_env=False, base_url=url) as client:
        assert client.get("/healthz", headers={"X-Long": 60_000 * "a"}).status_code == 200
        address = urlsplit(url)
        with socket.create_connection((address.hostname, address.port), timeout=10) as connection:
            connection.sendall(b"GET /healthz HTTP/1.1\r\nX-Long: " + 70_000 * b"a")
            assert b" 431 " in connection.recv(100)
