"""Data that a browser sends to other programs on this computer give no access."""

from __future__ import annotations

import http.server
import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from urllib.parse import urlsplit

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests.rid_daq.service.conftest import ServedProcess, serving
from tests.rid_daq.workbench.conftest import OpenPage

WHO = "/api/v1/whoami"


class Squatter(http.server.ThreadingHTTPServer):
    """Another program of this computer, which stores the headers of each request.

    Its page shows what it finds in localStorage.
    """

    allow_reuse_address = True

    def __init__(self, port: int = 0) -> None:
        self.sent: list[dict[str, str]] = []
        super().__init__(("127.0.0.1", port), _Keeper)


class _Keeper(http.server.BaseHTTPRequestHandler):
    server: Squatter

    def do_GET(self) -> None:
        self.server.sent.append(dict(self.headers.items()))
        page = b"<script>document.title = JSON.stringify({...localStorage})</script>"
        self.send_response(200)
        self.send_header("content-type", "text/html")
        self.send_header("content-length", str(len(page)))
        self.end_headers()
        self.wfile.write(page)

    do_POST = do_PUT = do_GET  # noqa: N815

    def log_message(self, format: str, *args: object) -> None:
        del format, args


@contextmanager
def squatting(port: int = 0) -> Iterator[Squatter]:
    with Squatter(port) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield server
        finally:
            server.shutdown()
            thread.join()


def status_with(service: str, headers: dict[str, str]) -> int:
    """Return the HTTP status of the service's answer to a program that repeats received headers."""
    kept = {
        name: value for name, value in headers.items() if name.lower() not in ("host", "origin")
    }
    return httpx.get(service + WHO, headers=kept).status_code


@pytest.mark.promise("nothing-automatic")
def test_another_port_receives_no_valid_secret(
    open_page: OpenPage, served_pages: ServedProcess, problems: list[str]
) -> None:
    page = open_page()
    expect(page.locator("body")).to_have_attribute("data-role", "administrator")
    service = served_pages.url.partition("/?")[0]
    with squatting() as other:
        page.context.new_page().goto(f"http://127.0.0.1:{other.server_port}/")
        assert other.sent
        assert {status_with(service, headers) for headers in other.sent} == {401}
    assert page.context.cookies() == []
    problems.clear()


@pytest.mark.promise("nothing-automatic")
def test_a_later_program_on_the_port_gets_no_secret_valid_after_a_restart(
    open_page_of: OpenPage, tmp_path: Path
) -> None:
    with serving(tmp_path, cell="exercise") as first:
        page: Page = open_page_of(first.url)
        expect(page.locator("body")).to_have_attribute("data-role", "administrator")
        port = urlsplit(first.url).port
        assert port is not None
    with squatting(port) as other:
        page.reload()
        assert other.sent
        kept = json.loads(page.title())
        assert kept  # a page of that program can read the storage of our page
    with serving(tmp_path, "--listen", f"127.0.0.1:{port}", cell="exercise") as second:
        service = second.url.partition("/?")[0]
        assert {status_with(service, headers) for headers in other.sent} <= {401, 403}
        for secret in kept.values():
            assert status_with(service, {"authorization": f"Bearer {secret}"}) == 401


def test_a_page_opens_and_downloads_data_of_the_service(
    open_page: OpenPage, served_pages: ServedProcess
) -> None:
    (served_pages.folder / "kept.json").write_text("{}")
    page = open_page()
    expect(page.locator("#lease-take")).to_be_visible()
    page.get_by_role("link", name="Settings").click()
    with page.context.expect_page() as opened:
        page.get_by_role("link", name="Metrics").click()
    expect(opened.value.locator("body")).to_contain_text("rid_daq_cell_ready")
    page.evaluate(
        """() => document.querySelector("main").insertAdjacentHTML(
            "beforeend", '<a id="save" download href="/api/v1/files/kept.json">save</a>')"""
    )
    with page.expect_download() as saved:
        page.locator("#save").click()
    assert saved.value.path().read_text() == "{}"
