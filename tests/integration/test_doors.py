"""Tokens, TLS and settings of the real service, asked by the real client over both doors."""

import socket
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trustme

from thinknav_trainer.planner import (
    PlannerClient,
    SubgoalReply,
    SubgoalRequest,
    Unauthenticated,
    Unavailable,
    connect,
    encode_frame,
)

StartService = Callable[..., tuple[str, "subprocess.Popen[str]"]]

TOKEN = "0123456789abcdef0123456789abcdef"
ROBOTS = f"robots:{TOKEN}"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """tokens, and a certificate for this machine signed by an authority of the test's own; ca.pem and other.pem."""
    folder = tmp_path_factory.mktemp("doors")
    (folder / "tokens").write_text(f"# who may ask\n{ROBOTS}\nvisitor:{TOKEN[::-1]}\n")
    authority = trustme.CA()
    certificate = authority.issue_cert("127.0.0.1", "localhost")
    certificate.private_key_pem.write_to_path(folder / "key.pem")
    certificate.cert_chain_pems[0].write_to_path(folder / "cert.pem")
    authority.cert_pem.write_to_path(folder / "ca.pem")
    trustme.CA().cert_pem.write_to_path(folder / "other.pem")
    return folder


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        port: int = listener.getsockname()[1]
        return port


@pytest.fixture(scope="module")
def guarded(start_service: StartService, folder: Path) -> tuple[str, str]:
    """URLs of both doors of a service with tokens and TLS."""
    port = free_port()
    url, _ = start_service(
        *("--token-file", str(folder / "tokens")),
        *("--tls-cert", str(folder / "cert.pem"), "--tls-key", str(folder / "key.pem")),
        *("--zenoh", f"127.0.0.1:{port}"),
    )
    return url, f"zenohs://127.0.0.1:{port}"


def check_it_answers(client: PlannerClient) -> None:
    frame = encode_frame(np.zeros((16, 16, 3), np.uint8))
    (answer,) = client.ask([SubgoalRequest(request_id="0", goal="chair", frame=frame)])
    assert isinstance(answer, SubgoalReply), repr(answer)
    assert client.embed(["find a chair"]).shape == (1, 512)


@pytest.mark.parametrize("door", [0, 1], ids=["http", "zenoh"])
@pytest.mark.parametrize("token", [ROBOTS, f"visitor:{TOKEN[::-1]}"])
def test_who_has_a_token_and_knows_the_authority_is_answered(
    guarded: tuple[str, str], folder: Path, door: int, token: str
) -> None:
    with connect(guarded[door], token=token, tls_ca=folder / "ca.pem") as client:
        check_it_answers(client)


@pytest.mark.parametrize("token", ["", "robots:wrong-wrong-wrong-wrong", TOKEN[:-1]])
def test_a_wrong_token_is_refused_over_http_with_what_to_do(guarded: tuple[str, str], folder: Path, token: str) -> None:
    with pytest.raises(Unauthenticated, match=r"planner\.token_file or THINKNAV_PLANNER_TOKEN") as raised:
        connect(guarded[0], token=token, tls_ca=folder / "ca.pem")
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("token", "authority", "hint"),
    [
        ("", "ca.pem", "it asks for a token"),
        ("robots:wrong-wrong-wrong-wrong", "ca.pem", "it does not know this client's name and token"),
        (f"stranger:{TOKEN}", "ca.pem", "it does not know this client's name and token"),
        (ROBOTS, "other.pem", r"its certificate is not signed by planner\.tls_ca"),
    ],
)
def test_a_stranger_finds_no_replica_over_zenoh_and_is_told_what_may_be_wrong(
    guarded: tuple[str, str], folder: Path, token: str, authority: str, hint: str
) -> None:
    with pytest.raises(Unavailable, match=hint):
        connect(guarded[1], token=token, tls_ca=folder / authority, handshake=2.0)


def test_over_zenoh_a_token_needs_a_name(guarded: tuple[str, str], folder: Path) -> None:
    with pytest.raises(Unavailable, match="name:token"):
        connect(guarded[1], token=TOKEN, tls_ca=folder / "ca.pem")


@pytest.mark.parametrize("authority", ["other.pem", None])
def test_an_unknown_authority_is_refused_with_what_to_do(
    guarded: tuple[str, str], folder: Path, authority: str | None
) -> None:
    with pytest.raises(Unavailable, match=r"is not trusted .* by planner\.tls_ca"):
        connect(guarded[0], token=ROBOTS, tls_ca=folder / authority if authority else None)


def test_the_wrong_scheme_is_told(guarded: tuple[str, str], planning_service: str, folder: Path) -> None:
    with pytest.raises(Unavailable):
        connect(guarded[0].replace("https", "http"), token=ROBOTS)
    with pytest.raises(Unavailable, match="speaks no TLS"):
        connect(planning_service.replace("http", "https"), tls_ca=folder / "ca.pem")
    with pytest.raises(Unavailable, match="it speaks TLS"):
        connect(guarded[1].replace("zenohs", "zenoh"), token=ROBOTS, handshake=1.0)


def test_tokens_and_every_option_may_come_from_the_environment_or_a_file(
    start_service: StartService, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (folder / "settings.yaml").write_text("max-text-length: 7\nmax_frames: 3\nqueue_size: 9\n")
    monkeypatch.setenv("THINKNAV_SERVER_TOKENS", ROBOTS)
    monkeypatch.setenv("THINKNAV_SERVER_SERVE_MAX_FRAMES", "4")
    monkeypatch.setenv("THINKNAV_SERVER_SERVE_MAX_PIXELS", "4000")
    url, _ = start_service("--config", str(folder / "settings.yaml"), "--max-pixels", "5000")
    with pytest.raises(Unauthenticated):
        connect(url)
    with connect(url, token=TOKEN) as client:
        limits = client.info.limits
        assert (limits.max_text_length, limits.max_frames, limits.max_pixels) == (7, 4, 5000)


def test_what_cannot_be_followed_is_one_clear_line(guarded: tuple[str, str]) -> None:
    for options, message in (
        (["--host", "0.0.0.0"], "with --token-file, or say --insecure"),
        (["--zenoh", guarded[1].removeprefix("zenohs://")], "cannot listen on zenoh 127.0.0.1:"),
    ):
        command = [
            str(Path(sys.executable).with_name("thinknav-server")),
            "serve",
            "--port",
            "0",
            "--planner",
            "scripted",
            *options,
        ]
        ended = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False)
        assert ended.returncode == 1
        assert message in ended.stderr
        assert ended.stderr.startswith("thinknav-server: ")
        assert ended.stderr.count("\n") == 1
