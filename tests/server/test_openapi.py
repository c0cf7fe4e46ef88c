"""The page that describes the HTTP door: its examples work, and whatever it allows or forbids is answered as it says.

FUZZ_CASES sets how many cases there are of each kind for each route; `make fuzz` asks for many.
"""

import contextlib
import os
import threading
import time
from collections.abc import Iterator
from typing import Any

import httpx
import numpy as np
import pytest
import schemathesis
import simplejpeg
import uvicorn
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from schemathesis import APIOperation, GenerationMode
from schemathesis.checks import not_a_server_error
from schemathesis.specs.openapi.checks import (
    content_type_conformance,
    response_schema_conformance,
    status_code_conformance,
)

from thinknav_models.clip import shipped_text_encoder
from thinknav_proto import Limits
from thinknav_server.hosts import PlannerThread
from thinknav_server.http import create_app
from thinknav_server.intake import Intake
from thinknav_server.planners import ScriptedPlanner
from thinknav_server.server import bind
from thinknav_server.service import PlanningService
from thinknav_server.settings import Settings
from thinknav_server.tokens import Tokens

CASES = int(os.environ.get("FUZZ_CASES", "20"))
TIMEOUT_S = 30.0
LIMITS = Limits(max_frames=8, max_pixels=64 * 64, max_body_bytes=20_000, max_text_length=50, max_texts=8)
CHECKS = [not_a_server_error, status_code_conformance, content_type_conformance, response_schema_conformance]
ROUTES = {
    "/v1/subgoals": "post",
    "/v1/embeddings": "post",
    "/v1/planner": "get",
    "/healthz": "get",
    "/readyz": "get",
    "/metrics": "get",
    "/": "get",
}
KINDS = [
    (path, mode) for path, verb in ROUTES.items() for mode in GenerationMode if verb == "post" or not mode.is_negative
]
JPEG = simplejpeg.encode_jpeg(np.zeros((16, 16, 3), np.uint8))


@pytest.fixture(scope="module")
def url() -> Iterator[str]:
    service = PlanningService(PlannerThread(ScriptedPlanner(), shipped_text_encoder()), Settings(limits=LIMITS))
    app = create_app(service, Tokens({}), Intake(LIMITS.max_body_bytes, 10 * LIMITS.max_body_bytes, body_timeout=5.0))
    listener = bind("127.0.0.1", 0)
    server = uvicorn.Server(uvicorn.Config(app, log_config=None, timeout_graceful_shutdown=5))
    thread = threading.Thread(target=server.run, kwargs={"sockets": [listener]})
    thread.start()
    while not server.started:
        assert thread.is_alive()
        time.sleep(0.01)
    yield f"http://127.0.0.1:{listener.getsockname()[1]}"
    server.should_exit = True
    thread.join()
    listener.close()


@pytest.fixture(scope="module")
def page(url: str) -> dict[str, Any]:
    content: dict[str, Any] = httpx.get(f"{url}/openapi.json").json()
    return content


def test_it_tells_of_every_route_and_of_no_other(page: dict[str, Any]) -> None:
    assert {path: next(iter(methods)) for path, methods in page["paths"].items()} == ROUTES


def test_its_examples_work(url: str, page: dict[str, Any]) -> None:
    bodies = {
        path: page["paths"][path]["post"]["requestBody"]["content"] for path in ("/v1/subgoals", "/v1/embeddings")
    }
    form = dict(bodies["/v1/subgoals"]["multipart/form-data"]["example"])
    assert form.pop("frame").endswith(".jpg)")
    asked = httpx.post(f"{url}/v1/subgoals", data=form, files={"frame": ("view.jpg", JPEG)})
    assert asked.status_code == 200
    assert asked.json()["replies"][0]["reply"]["subgoal"]
    embedded = httpx.post(f"{url}/v1/embeddings", json=bodies["/v1/embeddings"]["application/json"]["example"])
    assert embedded.status_code == 200
    assert len(embedded.json()["embedded"]["embeddings"]) == 1


def unhurried(body: Any) -> Any:
    """A body that gives time for its answer: or being late would be what was asked for."""
    with contextlib.suppress(TypeError, ValueError, KeyError):
        if 0 < float(body["deadline"]) < TIMEOUT_S:
            return {**body, "deadline": TIMEOUT_S}
    return body


@pytest.mark.parametrize(("path", "mode"), KINDS)
def test_whatever_is_asked_the_answer_is_as_described(url: str, path: str, mode: GenerationMode) -> None:
    operation: APIOperation[Any, Any, Any, Any] = schemathesis.openapi.from_url(f"{url}/openapi.json")[path][
        ROUTES[path]
    ]

    @settings(
        max_examples=CASES,
        deadline=None,
        phases=[Phase.explicit, Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(data=st.data())
    def ask(data: st.DataObject) -> None:
        case = data.draw(operation.as_strategy(mode))
        case.body = unhurried(case.body)
        case.call_and_validate(checks=CHECKS, timeout=TIMEOUT_S)

    ask()
