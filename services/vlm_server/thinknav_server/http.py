"""The HTTP door of a planning service: routes that read a body, call the service and render what it says.

POST /v1/subgoals     frames and goals in, subgoals out (msgpack, or multipart/form-data)
POST /v1/embeddings   texts in, embeddings out (msgpack or JSON)
GET  /v1/planner      who answers
GET  /healthz         the process lives         GET /readyz   requests are answered
GET  /metrics         in Prometheus' text format  GET /         the status page, for people
GET  /openapi.json    all of these, for programs

FastAPI writes the last of them, from what stands beside each route, and has no hand in answering: resolving what an
endpoint depends on costs it more than all that is done here with a frame.
"""

import logging
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager

from fastapi import APIRouter
from fastapi.openapi.utils import get_openapi
from fastapi.routing import APIRoute
from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, Response
from starlette.routing import Route

from thinknav_proto import (
    CONTENT_TYPE,
    PROTOCOL_VERSION,
    EmbedRequest,
    InvalidRequest,
    PlannerError,
    PlannerFailed,
    decode_embed_request,
    decode_requests,
    describe,
)
from thinknav_server.authentication import Authentication, address
from thinknav_server.caller import Caller, Trace
from thinknav_server.disconnect import ClientGone, while_connected
from thinknav_server.forms import read_form
from thinknav_server.intake import Intake, IntakeLimit
from thinknav_server.metrics import CONTENT_TYPE as METRICS_TYPE
from thinknav_server.openapi import (
    embeddings_answers,
    embeddings_body,
    page_answers,
    planner_answers,
    readiness_answers,
    subgoals_answers,
    subgoals_body,
)
from thinknav_server.rendering import (
    BINARY_TYPES,
    media_type,
    render_embeddings,
    render_error,
    render_info,
    render_replies,
)
from thinknav_server.service import PlanningService
from thinknav_server.status_page import render_status
from thinknav_server.tokens import Tokens

logger = logging.getLogger(__name__)

_TITLE = "ThinkNav planning service"

routes = APIRouter()


def create_app(
    service: PlanningService, tokens: Tokens, intake: Intake, *doors: AbstractAsyncContextManager[object]
) -> Starlette:
    """The application; it opens the service and its other doors when it starts and closes them when it stops.

    tokens: of the clients that may ask; none lets everybody in.
    """

    @asynccontextmanager
    async def lifespan(_: Starlette) -> AsyncIterator[None]:
        async with service, AsyncExitStack() as stack:
            for door in doors:
                await stack.enter_async_context(door)
            yield

    documented = [route for route in routes.routes if isinstance(route, APIRoute)]
    page = get_openapi(title=_TITLE, version=str(PROTOCOL_VERSION), routes=documented)

    async def openapi(_: Request) -> Response:
        return JSONResponse(page)

    app = Starlette(
        routes=[
            *(Route(route.path, route.endpoint, methods=list(route.methods or ())) for route in documented),
            Route("/openapi.json", openapi),
        ],
        middleware=[
            Middleware(Authentication, tokens=tokens),  # the outermost: it refuses before a body is read
            Middleware(IntakeLimit, intake=intake),
        ],
        exception_handlers={
            PlannerError: _on_planner_error,
            HTTPException: _on_http_error,
            ClientGone: _on_client_gone,
            ClientDisconnect: _on_client_gone,
            Exception: _on_bug,
        },
        lifespan=lifespan,
    )
    app.state.service = service
    return app


def _service(request: Request) -> PlanningService:
    service: PlanningService = request.app.state.service
    return service


@routes.post("/v1/subgoals", openapi_extra=subgoals_body(), responses=subgoals_answers())
async def subgoals(request: Request) -> Response:
    """One answer for each request of the body, in its order."""
    service, kind = _service(request), media_type(request)
    if kind in BINARY_TYPES:
        requests = decode_requests(await request.body())
    elif kind == "multipart/form-data":
        requests = await read_form(request, service.info.limits)
    else:
        raise InvalidRequest(f"send {CONTENT_TYPE} or multipart/form-data, not {kind[:64] or 'an untyped body'}")
    return render_replies(request, await while_connected(request, service.answer_each(requests, _caller(request))))


@routes.post("/v1/embeddings", openapi_extra=embeddings_body(), responses=embeddings_answers())
async def embeddings(request: Request) -> Response:
    """The embeddings of the body's texts, in its order."""
    kind = media_type(request)
    if kind in BINARY_TYPES:
        asked = decode_embed_request(await request.body())
    elif kind == "application/json":
        try:
            asked = EmbedRequest.model_validate_json(await request.body())
        except ValidationError as error:
            raise InvalidRequest(describe(error)) from None
    else:
        raise InvalidRequest(f"send {CONTENT_TYPE} or application/json, not {kind[:64] or 'an untyped body'}")
    return render_embeddings(request, await while_connected(request, _service(request).embed(asked)))


@routes.get("/v1/planner", responses=planner_answers())
async def planner(request: Request) -> Response:
    """Who answers, and what it accepts."""
    return render_info(request, _service(request).introduce())


@routes.get("/healthz")
async def healthz(_: Request) -> Response:
    """200 while the process can answer at all."""
    return JSONResponse({"status": "ok"})


@routes.get("/readyz", responses=readiness_answers())
async def readyz(request: Request) -> Response:
    """200 while requests are answered."""
    _service(request).introduce()
    return JSONResponse({"status": "ready"})


@routes.get("/", response_class=HTMLResponse, responses=page_answers("text/html"))
async def status(request: Request) -> Response:
    """How the service is doing, for people."""
    service = _service(request)
    return HTMLResponse(render_status(service.status, service.recent))


@routes.get("/metrics", response_class=Response, responses=page_answers("text/plain"))
async def metrics(request: Request) -> Response:
    """Counts and timings, as docs/metrics.md explains them."""
    return Response(_service(request).metrics.exposition(), media_type=METRICS_TYPE)


def _caller(request: Request) -> Caller:
    """Clients are told apart by the name under which they were let in, else by their address."""
    trace = Trace.read(request.headers.get("traceparent"), request.headers.get("tracestate"))
    return Caller(request.scope["state"]["client"] or address(request.scope), "http", trace)


async def _on_planner_error(request: Request, error: Exception) -> Response:
    assert isinstance(error, PlannerError)
    return render_error(request, error)


async def _on_http_error(request: Request, error: Exception) -> Response:
    """Unknown paths, wrong methods and broken forms, which starlette finds."""
    assert isinstance(error, HTTPException)
    response = render_error(
        request, InvalidRequest(f"{request.method} {request.url.path}: {error.detail}"), error.status_code
    )
    response.headers.update(error.headers or {})
    return response


async def _on_client_gone(request: Request, _error: Exception) -> Response:
    logger.debug("a client hung up on %s", request.url.path)
    return Response(status_code=499)  # nobody reads it; the number is nginx's for this case


async def _on_bug(request: Request, _error: Exception) -> Response:
    return render_error(request, PlannerFailed("the service failed; its log says why"), 500)
