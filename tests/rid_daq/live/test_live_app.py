"""Permissions to view a motion in a browser and to stop it; a stop needs fewer permissions."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
import pytest
from starlette.types import Receive, Scope, Send

from rid_daq.live.live_app import live_app
from rid_daq.web.access import STOP_HEADER, Access
from rid_daq.web.feed import Feed

TOKEN = "t" * 40
HERE, ELSEWHERE = "127.0.0.1", "192.0.2.7"
ADDRESS = "http://127.0.0.1:8642"
JSON = {"Content-Type": "application/json"}
STOP = {STOP_HEADER: "stop", **JSON}
BEARER = {"Authorization": f"Bearer {TOKEN}"}


class Page:
    """The application and the number of stops that it has requested."""

    def __init__(self) -> None:
        self.access = Access("127.0.0.1", 8642, TOKEN)
        self.feed = Feed()
        self.stops = 0
        self._app = live_app(self.access, self.feed, self._stop)

    def _stop(self) -> None:
        self.stops += 1

    def ask(
        self,
        path: str,
        method: str = "GET",
        headers: dict[str, str] | None = None,
        *,
        client: str = HERE,
        local: bool = False,
    ) -> httpx.Response:
        async def served(scope: Scope, receive: Receive, send: Send) -> None:
            scope["state"] = {"local": local}
            await self._app(scope, receive, send)

        async def send_request() -> httpx.Response:
            transport: Any = httpx.ASGITransport(served, client=(client, 40000))
            async with httpx.AsyncClient(transport=transport, base_url=ADDRESS) as browser:
                return await browser.request(method, path, headers=headers)

        return asyncio.run(send_request())


@pytest.fixture
def page() -> Page:
    return Page()


def test_a_stop_from_this_computer_needs_no_token(page: Page) -> None:
    assert page.ask("/stop", "POST", STOP).status_code == 202
    assert page.stops == 1


def test_a_stop_from_another_computer_needs_the_token(page: Page) -> None:
    refused = page.ask("/stop", "POST", STOP, client=ELSEWHERE)
    assert refused.status_code == 403
    assert page.stops == 0
    session = f"/stop?s={page.access.session}"
    assert page.ask(session, "POST", STOP, client=ELSEWHERE).status_code == 202
    assert page.ask("/stop", "POST", {**STOP, **BEARER}, client=ELSEWHERE).status_code == 202
    assert page.stops == 2


def test_a_stop_over_the_local_socket_needs_no_token(page: Page) -> None:
    assert page.ask("/stop", "POST", STOP, client=ELSEWHERE, local=True).status_code == 202
    assert page.stops == 1


def test_a_form_of_another_page_is_refused(page: Page) -> None:
    form = {STOP_HEADER: "stop", "Content-Type": "application/x-www-form-urlencoded"}
    assert page.ask("/stop", "POST", form).status_code == 415
    assert page.stops == 0


@pytest.mark.parametrize("headers", [JSON, {**JSON, STOP_HEADER: "yes"}])
def test_a_request_without_the_stop_header_or_body_stops_nothing(
    page: Page, headers: dict[str, str]
) -> None:
    assert page.ask("/stop", "POST", headers).status_code == 403
    assert page.stops == 0


@pytest.mark.parametrize("method", ["GET", "PUT", "DELETE"])
def test_only_a_post_stops(page: Page, method: str) -> None:
    assert page.ask("/stop", method, {**STOP, **BEARER}).status_code == 404
    assert page.stops == 0


@pytest.mark.parametrize("path", ["/", "/?s=", "/?s=wrong", "/events", "/events?s=wrong"])
def test_viewing_needs_the_token_even_on_this_computer(page: Page, path: str) -> None:
    refused = page.ask(path)
    assert refused.status_code == 403


def test_the_token_in_the_address_is_replaced_by_the_session(
    page: Page,
) -> None:
    let_in = page.ask(f"/?t={TOKEN}")
    assert let_in.status_code == 303
    assert let_in.headers["Location"] == f"/?s={page.access.session}"
    assert "Set-Cookie" not in let_in.headers
    shown = page.ask(let_in.headers["Location"])
    assert shown.headers["Content-Type"].startswith("text/html")
    assert f'data-events="/events?s={page.access.session}"' in shown.text
    assert TOKEN not in shown.text
    assert Page().access.session != page.access.session
    assert Page().ask(let_in.headers["Location"]).status_code == 403


@pytest.mark.promise("no-cookie-without-tls")
def test_a_cookie_gives_no_access(page: Page) -> None:
    for secret in (TOKEN, page.access.session):
        for name in ("s", "t", "rid_daq_8642"):
            assert page.ask("/", headers={"Cookie": f"{name}={secret}"}).status_code == 403


def test_a_wrong_token_is_refused_even_with_the_right_session(page: Page) -> None:
    assert page.ask(f"/?t=wrong&s={page.access.session}").status_code == 403


def test_the_event_stream_contains_the_published_pictures(page: Page) -> None:
    page.feed.publish_picture(b'{"row":1}')
    page.feed.end()
    answer = page.ask("/events", headers=BEARER)
    assert answer.headers["Content-Type"].startswith("text/event-stream")
    assert 'data: {"row":1}\n\n' in answer.text
