"""Requests written as HTML forms (`multipart/form-data`), for people with curl.

    curl -F goal=chair -F frame=@view.jpg http://127.0.0.1:8765/v1/subgoals

`frame` may be given several times; the other fields hold for all of them.
"""

from contextlib import AsyncExitStack

from pydantic import ValidationError
from starlette.datastructures import FormData, UploadFile
from starlette.requests import Request

from thinknav_proto import InvalidRequest, Limits, PlannerError, SubgoalRequest, describe
from thinknav_server.images import frame_of_file

_TEXT_FIELDS = ("goal", "mode")
_NUMBER_FIELDS = ("temperature", "deadline")


async def read_form(request: Request, limits: Limits) -> list[SubgoalRequest | PlannerError]:
    """One request for each frame of the form, in order. Raises InvalidRequest for a form it cannot read."""
    async with AsyncExitStack() as opened:
        try:
            form = await opened.enter_async_context(
                request.form(
                    max_files=limits.max_frames, max_fields=16, max_part_size=4 * limits.max_text_length + 1024
                )
            )
        except UnicodeError:
            raise InvalidRequest("the form's text is not in the encoding that it names; use UTF-8") from None
        files = [value for value in form.getlist("frame") if isinstance(value, UploadFile)]
        if not files:
            raise InvalidRequest("the form needs at least one file 'frame' (curl: -F frame=@view.jpg)")
        fields = _fields(form)
        return [_request(str(index), await file.read(), fields) for index, file in enumerate(files)]


def _fields(form: FormData) -> dict[str, object]:
    fields: dict[str, object] = {}
    for name, value in form.multi_items():
        if name in _TEXT_FIELDS and isinstance(value, str):
            fields[name] = value
        elif name in _NUMBER_FIELDS and isinstance(value, str):
            try:
                fields[name] = float(value)
            except ValueError:
                raise InvalidRequest(f"the form's field '{name}' must be a number") from None
        elif name != "frame" or not isinstance(value, UploadFile):
            raise InvalidRequest(
                f"the form's field {name[:64]!r} is not understood; give the file 'frame' and the fields "
                f"{', '.join((*_TEXT_FIELDS, *_NUMBER_FIELDS))}"
            )
    if "goal" not in fields:
        raise InvalidRequest("the form needs the field 'goal' (curl: -F goal=chair)")
    return fields


def _request(request_id: str, data: bytes, fields: dict[str, object]) -> SubgoalRequest | PlannerError:
    try:
        return SubgoalRequest.model_validate({"request_id": request_id, "frame": frame_of_file(data), **fields})
    except ValidationError as error:
        return InvalidRequest(describe(error))
    except PlannerError as error:
        return error.as_value()
