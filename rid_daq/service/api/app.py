"""`make_api`: the API as an ASGI application."""

from __future__ import annotations

import copy
import json
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

from fastapi import APIRouter, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.openapi.utils import get_openapi
from fastapi.responses import JSONResponse

from config.errors import RidDaqError
from rid_daq.service.api import (
    cells,
    files,
    jobs,
    live_socket,
    people,
    plate_zero,
    runs,
    stops,
    system,
)
from rid_daq.service.api.json_body import JsonBody
from rid_daq.service.authenticator import Authenticator
from rid_daq.service.records import Record
from rid_daq.service.refusals import http_status
from rid_daq.service.request_check import MOST_SHOWN, request_schemas
from rid_daq.service.service import CellService
from rid_daq.service.stop.stop_handler import ServiceStopHandler
from rid_daq.web.compressed import CompressedJson

API_VERSION = "1.0"
MOST_DETAILS = 10


class Problem(Record):
    """Reason of a refusal: class of the error, a sentence, and the stable code."""

    error: str
    message: str
    code: str = ""


def make_api(
    service: CellService, authenticator: Authenticator, more: Sequence[APIRouter] = ()
) -> FastAPI:
    """Return the application.

    Args:
        service: The service.
        authenticator: Identifies the senders of requests.
        more: Routes in addition to the API, for example pages.
    """
    app = FastAPI(
        title="rid-daq service",
        version=API_VERSION,
        summary="Robot cells: state, lease, jobs, runs.",
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/v1/openapi.json",
        responses={"default": {"model": Problem, "description": "Refusal with its reason."}},
    )
    app.state.service = service
    app.state.authenticator = authenticator
    app.state.stop_handler = ServiceStopHandler(service, authenticator)
    for each in (stops, cells, jobs, runs, files, plate_zero, people, system, live_socket):
        app.include_router(each.router)
    for router in more:
        app.include_router(router)
    app.add_exception_handler(RidDaqError, _answer_error)
    app.add_exception_handler(RequestValidationError, _answer_invalid_request)
    app.add_middleware(JsonBody)
    app.add_middleware(CompressedJson)
    app.openapi = lambda: openapi_of(app)  # type: ignore[method-assign]
    return app


def openapi_of(app: FastAPI) -> dict[str, object]:
    """Return the OpenAPI document, with the request of every kind of job."""
    if app.openapi_schema is None:
        document = get_openapi(
            title=app.title,
            version=app.version,
            summary=app.summary,
            routes=app.routes,
        )
        schemas = document["components"]["schemas"]
        for kind, schema in request_schemas().items():
            name = f"Request-{kind}"
            own = copy.deepcopy(schema)
            for inner, definition in own.pop("$defs", {}).items():
                schemas[f"{name}-{inner}"] = _with_component_references(definition, name)
            schemas[name] = _with_component_references(own, name)
        app.openapi_schema = document
    return app.openapi_schema


def _with_component_references(schema: Any, name: str) -> Any:
    """Return a schema whose references point to the components of the OpenAPI document."""
    if isinstance(schema, list):
        return [_with_component_references(each, name) for each in schema]
    if not isinstance(schema, dict):
        return schema
    moved = {key: _with_component_references(each, name) for key, each in schema.items()}
    reference = moved.get("$ref")
    if isinstance(reference, str):
        moved["$ref"] = reference.replace("#/$defs/", f"#/components/schemas/{name}-")
    return moved


async def _answer_error(_request: Request, error: Exception) -> JSONResponse:
    assert isinstance(error, RidDaqError)
    problem = Problem(error=type(error).__name__, message=str(error), code=error.refusal)
    return AsciiResponse(problem.model_dump(), status_code=http_status(error))


async def _answer_invalid_request(_request: Request, error: Exception) -> JSONResponse:
    """Answer an invalid request, without repeating its content."""
    assert isinstance(error, RequestValidationError)
    details = [{name: each[name] for name in ("type", "loc", "msg")} for each in error.errors()]
    where = ".".join(map(str, details[0]["loc"]))
    message = f"{where}: {details[0]['msg']}"[:MOST_SHOWN]
    problem = Problem(error="ConfigError", message=message, code="RID-REQUEST-INVALID")
    document = {**problem.model_dump(), "detail": details[:MOST_DETAILS]}
    return AsciiResponse(document, status_code=HTTPStatus.UNPROCESSABLE_ENTITY)


class AsciiResponse(JSONResponse):
    """JSON answer in ASCII, so that lone surrogates from a client do not break the answer."""

    def render(self, content: Any) -> bytes:
        """Return the content as JSON."""
        return json.dumps(content, allow_nan=False).encode("ascii")
