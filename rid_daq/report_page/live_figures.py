"""`LiveFigures`: the interactive figures of a report, compressed in its page with their scripts.

A page contains the plot library once and one item per figure; `report.js` decompresses a figure
when it becomes visible. The page loads nothing from a network. Its content security policy names
its two scripts by their hashes, so that no injected script can run.
"""

from __future__ import annotations

import base64
import functools
import gzip
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from markupsafe import Markup

from rid_daq.blocks.plot import Plot
from rid_daq.figures.figure_item import figure_item, figure_script
from rid_daq.web.bundled_modules import bundled_modules
from rid_daq.web.script_comments import without_comments

STILL_POLICY: Final = "default-src 'none'; style-src 'unsafe-inline'; img-src data:"


class LiveFigures:
    """The interactive figures of one page, in the order in which the templates add them."""

    def __init__(self) -> None:
        self._packed: dict[str, Markup] = {}

    def __iter__(self) -> Iterator[tuple[str, Markup]]:
        """Yield name and compressed item of every figure."""
        yield from self._packed.items()

    def __len__(self) -> int:
        return len(self._packed)

    def add(self, plot: Plot) -> str:
        """Add a figure to the page and return its name there.

        Args:
            plot: Declaration of the figure.
        """
        name = f"{plot.name}-{len(self._packed) + 1}"
        text = json.dumps(figure_item(plot), allow_nan=False, separators=(",", ":"))
        self._packed[name] = compress_text(text)
        return name

    @property
    def policy(self) -> str:
        """Content security policy of a page with these figures."""
        if not self._packed:
            return STILL_POLICY
        allowed = " ".join(f"'sha256-{_hash(text)}'" for text in (library(), script()))
        return f"{STILL_POLICY}; script-src {allowed}"


@functools.cache
def library() -> Markup:
    """Return the plot library, a JavaScript module."""
    return Markup(bundled_modules()["uplot.js"].decode("utf-8"))


@functools.cache
def library_style() -> Markup:
    """Return the CSS of the plot library and of the figures."""
    own = figure_script().with_suffix(".css").read_text(encoding="utf-8")
    return Markup(bundled_modules()["uplot.css"].decode("utf-8") + own)


@functools.cache
def script() -> Markup:
    """Return the page's JavaScript module, which shows each figure when it becomes visible."""
    own = Path(__file__).with_name("report.js").read_text(encoding="utf-8")
    return Markup(without_comments(figure_script().read_text(encoding="utf-8") + own))


def compress_text(text: str) -> Markup:
    """Return a text, compressed with gzip and encoded in base64."""
    return Markup(base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode("ascii"))


def _hash(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode("ascii")
