"""Settings of the doors that cannot be followed are found before anything is served."""

import logging
from pathlib import Path

import pytest
import trustme
from pydantic import ValidationError

from thinknav_models.clip import shipped_text_encoder
from thinknav_server.doors import open_doors
from thinknav_server.hosts import PlannerThread
from thinknav_server.planners import ScriptedPlanner
from thinknav_server.service import PlanningService
from thinknav_server.settings import DoorSettings, Settings


@pytest.fixture(autouse=True)
def _in_a_folder_of_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    certificate = trustme.CA().issue_cert("127.0.0.1")
    certificate.cert_chain_pems[0].write_to_path("cert.pem")
    certificate.private_key_pem.write_to_path("key.pem")
    trustme.CA().issue_cert("127.0.0.1").private_key_pem.write_to_path("other-key.pem")
    Path("tokens").write_text("robots:0123456789abcdef")


def attempt(**settings: object) -> None:
    service = PlanningService(PlannerThread(ScriptedPlanner(), shipped_text_encoder()), Settings())
    open_doors(service, DoorSettings.model_validate({"port": 0, **settings})).listener.close()


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"host": "0.0.0.0"}, "with --token-file, or say --insecure"),
        ({"host": "::"}, "with --token-file, or say --insecure"),
        ({"zenoh": "0.0.0.0:7447"}, "with --token-file, or say --insecure"),
        ({"zenoh": "7447"}, "--zenoh takes HOST:PORT such as 127.0.0.1:7447, not '7447'"),
        ({"zenoh": "127.0.0.1:0"}, "--zenoh takes HOST:PORT"),
        ({"zenoh": "no such host:7447"}, "cannot listen on zenoh host no such host"),
        ({"zenoh": "127.0.0.1:7447", "zenoh_connect": "one:1,two"}, "--zenoh-connect takes HOST:PORT .* not 'two'"),
        ({"tls_cert": "none.pem"}, "cannot read the certificate none.pem: No such file"),
        ({"tls_cert": "tokens"}, "cannot use the certificate tokens: .*PEM form"),
        ({"tls_cert": "cert.pem"}, "cannot use the certificate cert.pem: .*PEM form"),
        ({"tls_cert": "cert.pem", "tls_key": "other-key.pem"}, "key values mismatch; both must be .* belong together"),
        ({"token_file": "none"}, "cannot read the tokens in none: No such file"),
        ({"tokens": "robots:short"}, "fewer than 16"),
        ({"zenoh": "127.0.0.1:7447", "zenoh_connect": "router:7447"}, "reaches router .* or say --insecure"),
        ({"max_held_bytes": 1000}, "--max-held-bytes .* may not be less than --max-body-bytes"),
    ],
)
def test_what_cannot_be_followed_is_told_in_one_line(settings: dict[str, object], message: str) -> None:
    with pytest.raises((ValueError, OSError), match=message) as raised:
        attempt(**settings)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"tls_key": "key.pem"}, "--tls-key needs --tls-cert"),
        ({"replica": "a/b"}, "replica"),
        ({"port": -1}, "port"),
        ({"replica": "one"}, "--replica needs --zenoh"),
        ({"zenoh_connect": "127.0.0.1:7447"}, "--zenoh-connect needs --zenoh"),
    ],
)
def test_what_contradicts_itself_is_no_setting(settings: dict[str, object], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        attempt(**settings)


def test_beyond_this_machine_one_listens_with_a_warning(caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.WARNING):
        attempt(host="0.0.0.0", insecure=True)
        attempt(host="0.0.0.0", token_file="tokens")
        attempt(host="0.0.0.0", token_file="tokens", tls_cert="cert.pem", tls_key="key.pem")
        attempt(host="127.0.0.1")
    whoever, clear = [record.getMessage() for record in caplog.records]
    assert "whoever reaches it may ask" in whoever
    assert "in the clear" in clear


def test_tokens_do_not_show_when_settings_are_printed() -> None:
    assert "0123456789abcdef" not in repr(DoorSettings(tokens="robots:0123456789abcdef"))
