"""A page with figures, served with a strict content security policy like the workbench."""

from __future__ import annotations

import contextlib
import html
import json
import threading
from collections.abc import Iterator, Mapping
from functools import partial
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from urllib.parse import parse_qs, urlsplit

from rid_daq.blocks.plot import Plot
from rid_daq.figures.figure_item import figure_item, figure_script
from rid_daq.figures.plot_tables import as_csv
from rid_daq.report_page.drawings.plot import svg_file
from rid_daq.web.bundled_modules import bundled_modules

POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:;"
    " connect-src 'self'"
)
STYLE = """
:root { color-scheme: light dark; }
body { font-family: system-ui, sans-serif; margin: 8px; background: #fff; color: #1b2530; }
@media (prefers-color-scheme: dark) { body { background: #141b22; color: #e9eef3; } }
h2 { font-size: 16px; }
"""
MODULE = """
import "/uplot.js";
import { showFigure } from "/figure.js";
for (const place of document.querySelectorAll("[data-figure]")) {
  const url = `/figures/${place.dataset.figure}`;
  const item = async () => {
    const answer = await fetch(url);
    if (!answer.ok) throw new Error(`status ${answer.status}`);
    return answer.json();
  };
  showFigure(place, { item, csv: `${url}?as=csv`, svg: `${url}?as=svg` });
}
"""


class _Handler(BaseHTTPRequestHandler):
    def __init__(self, figures: Mapping[str, Plot], *rest: object) -> None:
        self.figures = figures
        super().__init__(*rest)  # type: ignore[arg-type]

    def do_GET(self) -> None:
        url = urlsplit(self.path)
        query = parse_qs(url.query)
        name = url.path.removeprefix("/figures/")
        if url.path == "/":
            self._answer("text/html", _page(self.figures).encode())
        elif url.path == "/uplot.js":
            self._answer("text/javascript", bundled_modules()["uplot.js"])
        elif url.path == "/figure.js":
            self._answer("text/javascript", figure_script().read_bytes())
        elif url.path == "/page.js":
            self._answer("text/javascript", MODULE.encode())
        elif url.path == "/page.css":
            figure_style = figure_script().with_suffix(".css").read_bytes()
            style = bundled_modules()["uplot.css"] + figure_style + STYLE.encode()
            self._answer("text/css", style)
        elif name not in self.figures:
            body = json.dumps({"detail": f"no figure {name!r}"}).encode()
            self._answer("application/json", body, 404)
        elif query.get("as") == ["csv"]:
            self._answer("text/csv", as_csv(self.figures[name]).encode())
        elif query.get("as") == ["svg"]:
            self._answer("image/svg+xml", svg_file(self.figures[name]))
        else:
            item = figure_item(self.figures[name])
            self._answer("application/json", json.dumps(item, allow_nan=False).encode())

    def _answer(self, kind: str, body: bytes, status: int = 200) -> None:
        self.send_response(status)
        self.send_header("Content-Type", f"{kind}; charset=utf-8")
        self.send_header("Content-Length", str(len(body)))
        self.send_header("Content-Security-Policy", POLICY)
        self.end_headers()
        self.wfile.write(body)

    def log_message(self, format: str, *args: object) -> None:
        """Log nothing."""


def _page(figures: Mapping[str, Plot]) -> str:
    places = "".join(
        f'<h2>{html.escape(name)}</h2><div data-figure="{html.escape(name)}"></div>'
        for name in figures
    )
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8"><title>Figures</title>'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        '<link rel="icon" href="data:,"><link rel="stylesheet" href="/page.css">'
        '<script type="module" src="/page.js"></script>'
        f"</head><body>{places}</body></html>"
    )


@contextlib.contextmanager
def served_figures(figures: Mapping[str, Plot]) -> Iterator[str]:
    """Serve a page of figures; yield its address."""
    with ThreadingHTTPServer(("127.0.0.1", 0), partial(_Handler, figures)) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            yield f"http://127.0.0.1:{server.server_port}/"
        finally:
            server.shutdown()
            thread.join()
