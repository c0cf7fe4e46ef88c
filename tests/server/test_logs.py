"""Log lines for people and for machines carry the same fields."""

import json
import logging

import pytest

from thinknav_proto import Overloaded, Unavailable
from thinknav_server.caller import Caller, Trace
from thinknav_server.logs import LogFormat, LogLevel, configure_logs
from thinknav_server.request_log import log_answers


@pytest.fixture(autouse=True)
def _as_it_was() -> object:
    handlers, level = logging.root.handlers[:], logging.root.level
    yield
    logging.root.handlers[:] = handlers
    logging.root.setLevel(level)


def test_a_request_is_one_json_object(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logs(LogLevel.INFO, LogFormat.JSON)
    caller = Caller("robot-7", "http", Trace("4bf92f3577b34da6a3ce929d0e0e4736"))
    log_answers(caller, [Overloaded("full"), Overloaded("full"), Unavailable("away")], 0.25)
    (line,) = capsys.readouterr().err.splitlines()
    told = json.loads(line)
    assert told.pop("time").endswith("+00:00")
    assert told == {
        "level": "info",
        "logger": "thinknav_server.requests",
        "message": "subgoals",
        "door": "http",
        "client": "robot-7",
        "requests": 3,
        "answered": 0,
        "ms": 250.0,
        "errors": {"overloaded": 2, "unavailable": 1},
        "trace_id": "4bf92f3577b34da6a3ce929d0e0e4736",
    }


def test_a_request_is_one_line_for_people(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logs(LogLevel.INFO, LogFormat.TEXT)
    log_answers(Caller("robot-7"), [Unavailable("away")], 0.25)
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(
        "INFO thinknav_server.requests: subgoals door=python client=robot-7 requests=1 answered=0 ms=250.0"
        " errors={'unavailable': 1}"
    )


def test_failures_keep_their_story(capsys: pytest.CaptureFixture[str]) -> None:
    configure_logs(LogLevel.WARNING, LogFormat.JSON)
    log_answers(Caller("robot-7"), [Unavailable("away")], 0.25)
    try:
        raise KeyError("lost")
    except KeyError:
        logging.getLogger("x").exception("it failed")
    (line,) = capsys.readouterr().err.splitlines()
    assert "KeyError: 'lost'" in json.loads(line)["exception"]
