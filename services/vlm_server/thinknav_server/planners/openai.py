"""Any OpenAI-compatible server as a planner: vLLM, SGLang, `transformers serve`, a hosted model.

Each request is a call of its own, many at once: such servers make their own batches.
"""

import asyncio
import base64
import hashlib
import json
import logging
import os
import re
from contextlib import suppress
from typing import Any, Self

import numpy as np
import simplejpeg
from numpy.typing import NDArray

from thinknav_proto import InvalidRequest, PlannerError, Unavailable
from thinknav_server.caller import Trace
from thinknav_server.planners.base import Plan, PlanItem, PlannerIdentity
from thinknav_server.planners.options import OpenAIOptions
from thinknav_server.planners.prompt import PLAN_LENGTH, load_prompt, plan_from_text
from thinknav_server.planners.snapshot import model_name
from thinknav_server.planners.upstream import Refused, Upstream

logger = logging.getLogger(__name__)

_JPEG_QUALITY = 95
_LOOK_AGAIN_S = 1.0
# What a string in JSON holds, whether or not it ends.
_STRING = re.compile(r'"((?:[^"\\]|\\.)*)"?')


class OpenAIPlanner:
    """An async context manager that plans item by item. Asks at once who is served; raises ValueError if nobody is."""

    def __init__(self, options: OpenAIOptions) -> None:
        self._options = options
        self._prompt = load_prompt(options.prompt)
        key = os.environ.get(options.key_env, "")
        self._upstream = Upstream(options.url, key, options.concurrency, options.timeout)
        self._model = asyncio.run(self._served())
        revision = hashlib.sha256(json.dumps(self._model, sort_keys=True, default=str).encode()).hexdigest()[:12]
        self.identity = PlannerIdentity(f"openai/{model_name(str(self._model['id']))}", revision, self._prompt.hash)
        self._guided = options.guided
        self.reachable = True

    async def __aenter__(self) -> Self:
        await self._upstream.__aenter__()
        self._watch = asyncio.create_task(self._look_for_server(), name="upstream")
        return self

    async def __aexit__(self, *error: object) -> None:
        self._watch.cancel()
        await asyncio.gather(self._watch, return_exceptions=True)
        await self._upstream.__aexit__(*error)

    async def plan(self, item: PlanItem, trace: Trace | None = None) -> Plan | PlannerError:
        """The answer to one item. Raises Unavailable, Overloaded or PlannerFailed."""
        try:
            text = await self._ask(item, trace)
        except Unavailable:
            self.reachable = False
            raise
        return plan_from_text(_unwrapped(text), item)

    async def _ask(self, item: PlanItem, trace: Trace | None) -> str:
        body = self._body(item)
        headers = trace.headers() if trace else {}
        if not self._guided:
            return await self._upstream.complete(body, headers)
        try:
            return await self._upstream.complete({**body, "response_format": _schema(item)}, headers)
        except Refused as refusal:
            if refusal.status not in (400, 422, 501):
                raise
        text = await self._upstream.complete(body, headers)
        logger.warning("%s has no guided output; it is asked without from now on", self._options.url)
        self._guided = False
        return text

    def _body(self, item: PlanItem) -> dict[str, object]:
        content = [
            {"type": "text", "text": part}
            if isinstance(part, str)
            else {"type": "image_url", "image_url": {"url": _data_uri(part)}}
            for part in self._prompt.parts(item)
        ]
        return {
            "model": self._model["id"],
            "messages": [{"role": "system", "content": self._prompt.system}, {"role": "user", "content": content}],
            "max_tokens": self._options.max_new_tokens * (PLAN_LENGTH if item.mode == "plan" else 1),
            "temperature": item.temperature,
        }

    async def _served(self) -> dict[str, Any]:
        """What is stable of the entry of the wanted model, or of the only one. Raises ValueError."""
        wanted, url = self._options.model, self._options.url
        async with self._upstream:
            try:
                served = {str(model["id"]): model for model in await self._upstream.models()}
            except PlannerError as error:
                raise ValueError(f"{error}; give --upstream-url up to and with /v1") from None
            names = ", ".join(served) or "nothing"
            if not wanted and len(served) != 1:
                raise ValueError(f"{url} serves {names}; choose one by --upstream-model")
            if wanted and wanted not in served:
                await self._try_unlisted(wanted, names)
        model = served.get(wanted, {"id": wanted}) if wanted else next(iter(served.values()))
        return {key: model[key] for key in ("id", "root", "parent") if key in model}

    async def _try_unlisted(self, model: str, names: str) -> None:
        """Some servers list less than they serve: `transformers serve` loads a folder when it is first asked for."""
        greeting = {"model": model, "messages": [{"role": "user", "content": "Hello"}], "max_tokens": 1}
        try:
            await self._upstream.complete(greeting, {})
        except PlannerError as error:
            raise ValueError(
                f"{self._options.url} does not serve {model!r} but {names}; see --upstream-model ({error})"
            ) from None

    async def _look_for_server(self) -> None:
        """Notices when a server that was gone is back."""
        while True:
            await asyncio.sleep(_LOOK_AGAIN_S)
            if self.reachable:
                continue
            with suppress(PlannerError):
                await self._upstream.models()
                self.reachable = True


def _schema(item: PlanItem) -> dict[str, object]:
    """Answers in JSON, so that the server cannot ramble: one string, or a list of them."""
    instruction = {"type": "string", "minLength": 1}
    several = {"type": "array", "items": instruction, "minItems": 1, "maxItems": PLAN_LENGTH}
    properties = {"instructions": several if item.mode == "plan" else {**several, "maxItems": 1}}
    schema = {"type": "object", "properties": properties, "required": ["instructions"], "additionalProperties": False}
    return {"type": "json_schema", "json_schema": {"name": "instructions", "schema": schema, "strict": True}}


def _unwrapped(text: str) -> str:
    """The lines in an answer in JSON, even one that was cut off at its last token; any other text as it is.

    JSON that holds no instruction is nothing: its brackets are not to be followed.
    """
    if not text.lstrip().startswith("{"):
        return text
    try:
        answer = json.loads(text)
    except ValueError:
        instructions: object = [_unescaped(string) for string in _STRING.findall(text.partition("[")[2])]
    else:
        instructions = answer.get("instructions")
    several = instructions if isinstance(instructions, list) else [instructions]
    return "\n".join(line for line in several if isinstance(line, str))


def _unescaped(string: str) -> str:
    try:
        return str(json.loads(f'"{string}"'))
    except ValueError:  # cut off within an escape
        return string


def _data_uri(frame: NDArray[np.uint8]) -> str:
    try:
        jpeg = simplejpeg.encode_jpeg(np.ascontiguousarray(frame), quality=_JPEG_QUALITY)
    except ValueError as error:  # a side longer than JPEG knows
        raise InvalidRequest(f"the frame cannot be sent as JPEG: {error}") from None
    return f"data:image/jpeg;base64,{base64.b64encode(jpeg).decode()}"
