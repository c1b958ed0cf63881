"""Requests that the guard refuses, and requests that it accepts."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from starlette.types import Message, Receive, Scope, Send

from rid_daq.web.access import Access
from rid_daq.web.guard import PAGE_POLICY, PLOT_POLICY, Guard

HOST = ("host", "127.0.0.1:8642")
JSON = ("content-type", "application/json")
OWN = ("x-rid-daq", "yes")
STRANGER = ("origin", "https://evil.example")


async def behind(scope: Scope, receive: Receive, send: Send) -> None:
    headers = [(b"Cache-Control", b"max-age=60")] if scope["path"] == "/kept" else []
    await send({"type": "http.response.start", "status": 200, "headers": headers})
    await send({"type": "http.response.body", "body": b"let in"})


def responses(
    *headers: tuple[str, str],
    method: str = "GET",
    kind: str = "http",
    path: str = "/",
    local: bool = False,
    policy: str = PAGE_POLICY,
) -> list[Message]:
    """Return the messages of the guard in response to a request."""
    messages: list[Message] = []

    async def send(message: Message) -> None:
        messages.append(dict(message))

    async def receive() -> Message:
        return {"type": "http.disconnect"}

    scope: dict[str, Any] = {
        "type": kind,
        "method": method,
        "path": path,
        "headers": [(name.encode("latin-1"), value.encode("latin-1")) for name, value in headers],
        "state": {"local": local},
    }
    guard = Guard(behind, Access("127.0.0.1", 8642, "t" * 40), policy)
    asyncio.run(guard(scope, receive, send))
    return messages


def status(*headers: tuple[str, str], method: str = "GET", local: bool = False) -> int:
    messages = responses(*headers, method=method, local=local)
    assert messages[1]["body"] == (b"let in" if messages[0]["status"] == 200 else b"")
    return int(messages[0]["status"])


def test_requests_with_the_own_host_and_origin_are_accepted() -> None:
    assert status(HOST) == 200
    assert status(("Host", "localhost:8642"), ("Origin", "http://localhost:8642")) == 200
    assert status(HOST, ("sec-fetch-site", "same-origin")) == 200


@pytest.mark.parametrize(
    ("headers", "refused"),
    [
        ((), 421),
        ((("host", "evil.example:8642"),), 421),
        ((HOST, STRANGER), 403),
        ((HOST, ("origin", "null")), 403),
        ((HOST, ("sec-fetch-site", "cross-site")), 403),
        ((HOST, HOST), 400),
        ((HOST, ("origin", "http://127.0.0.1:8642"), STRANGER), 400),
        ((HOST, ("sec-fetch-site", "none"), ("Sec-Fetch-Site", "cross-site")), 400),
        ((HOST, ("cookie", "a=b"), ("cookie", "a=c")), 400),
    ],
)
def test_foreign_hosts_and_origins_are_refused(
    headers: tuple[tuple[str, str], ...], refused: int
) -> None:
    for method in ("GET", "POST"):
        assert status(*headers, JSON, OWN, method=method) == refused
    kinds = responses(*headers, kind="websocket")
    assert kinds == [{"type": "websocket.close", "code": 1008}]


@pytest.mark.parametrize("method", ["POST", "PUT", "PATCH", "DELETE", "BREW"])
@pytest.mark.parametrize("local", [False, True])
def test_a_changing_request_needs_json_and_a_special_header(method: str, local: bool) -> None:
    assert status(HOST, JSON, OWN, method=method, local=local) == 200
    assert status(HOST, JSON, ("x-rid-daq", "stop"), method=method, local=local) == 200
    utf8 = ("content-type", "Application/JSON; charset=utf-8")
    assert status(HOST, utf8, OWN, method=method, local=local) == 200
    assert status(HOST, JSON, method=method, local=local) == 403
    assert status(HOST, JSON, ("x-rid-daq", ""), method=method, local=local) == 403
    for kind in ("text/plain", "application/x-www-form-urlencoded", "multipart/form-data"):
        assert status(HOST, ("content-type", kind), OWN, method=method, local=local) == 415
    assert status(HOST, OWN, method=method, local=local) == 415


def test_requests_on_a_local_socket_need_no_host_check() -> None:
    assert status(("host", "rid-daq"), local=True) == 200
    assert status(STRANGER, local=True) == 200


def test_every_answer_has_security_headers() -> None:
    for headers in ((HOST,), (HOST, STRANGER)):
        start = responses(*headers)[0]
        sent = dict(start["headers"])
        assert sent[b"content-security-policy"] == PAGE_POLICY.encode()
        assert sent[b"x-content-type-options"] == b"nosniff"
        assert sent[b"x-frame-options"] == b"DENY"
        assert sent[b"cache-control"] == b"no-store"
    assert "unsafe" not in PAGE_POLICY


def test_an_application_can_set_caching_and_a_policy_for_plots() -> None:
    start = responses(HOST, path="/kept", policy=PLOT_POLICY)[0]
    caching = [value for name, value in start["headers"] if name == b"cache-control"]
    assert caching == [b"max-age=60"]
    policy = dict(start["headers"])[b"content-security-policy"].decode()
    assert "style-src 'self' 'unsafe-inline'" in policy
    assert "img-src 'self' data: blob:" in policy
    assert "script-src 'self';" in policy
