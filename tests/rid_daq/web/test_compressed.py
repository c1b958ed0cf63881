"""JSON documents of an application that are sent in gzip."""

from __future__ import annotations

import asyncio
import json

import httpx
import pytest
from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Route

from rid_daq.web.compressed import FEWEST_BYTES, CompressedJson

LARGE = {"words": "again " * FEWEST_BYTES}


def send(request: Request) -> Response:
    """Return a large or small document, a large text, or a large document in parts."""
    kinds: dict[str, Response] = {
        "large": JSONResponse(LARGE),
        "small": JSONResponse({"words": "once"}),
        "text": PlainTextResponse(LARGE["words"]),
        "parts": StreamingResponse(iter([json.dumps(LARGE)]), media_type="application/json"),
    }
    return kinds[request.path_params["kind"]]


def answer_to(method: str, kind: str, encoding: str = "gzip") -> httpx.Response:
    """Return the answer of the compressed application to a request."""

    async def ask() -> httpx.Response:
        routes = [Route("/{kind}", send, methods=["GET", "POST"])]
        transport = httpx.ASGITransport(CompressedJson(Starlette(routes=routes)))
        async with httpx.AsyncClient(transport=transport, base_url="http://test") as client:
            return await client.request(method, kind, headers={"accept-encoding": encoding})

    return asyncio.run(ask())


def test_a_large_document_is_sent_in_gzip() -> None:
    answer = answer_to("GET", "/large")
    assert answer.headers["content-encoding"] == "gzip"
    assert answer.headers["vary"] == "accept-encoding"
    assert int(answer.headers["content-length"]) < FEWEST_BYTES
    assert answer.json() == LARGE


@pytest.mark.parametrize("kind", ["small", "text", "parts"])
def test_other_answers_stay_as_they_are(kind: str) -> None:
    assert "content-encoding" not in answer_to("GET", f"/{kind}").headers


def test_an_answer_that_can_contain_a_secret_is_not_compressed() -> None:
    assert "content-encoding" not in answer_to("POST", "/large").headers


def test_a_client_without_gzip_receives_the_plain_document() -> None:
    answer = answer_to("GET", "/large", "identity")
    assert "content-encoding" not in answer.headers
    assert answer.json() == LARGE
