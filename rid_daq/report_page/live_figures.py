"""`LiveFigures`: the interactive figures of a report, compressed in its page with their scripts.

A page contains BokehJS once and one item per figure, all compressed; `report.js` decompresses a
figure when it becomes visible. The page loads nothing from a network. Its content security policy
names its two scripts by their hashes, so that no injected script can run.
"""

from __future__ import annotations

import base64
import functools
import gzip
import hashlib
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

from markupsafe import Markup

from rid_daq.blocks.plot import Plot
from rid_daq.figures.palette import dark_colours

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
        from rid_daq.figures.embedding import as_item  # imported late, because Bokeh loads slowly
        from rid_daq.figures.plot_figure import plot_figure

        item = as_item(plot_figure(plot), dark=False)
        name = f"{plot.name}-{len(self._packed) + 1}"
        self._packed[name] = compress_text(json.dumps(item, allow_nan=False, separators=(",", ":")))
        return name

    @property
    def policy(self) -> str:
        """Content security policy of a page with these figures."""
        if not self._packed:
            return STILL_POLICY
        allowed = " ".join(f"'sha256-{_hash(text)}'" for text in (_library(), script()))
        return f"{STILL_POLICY} blob:; script-src {allowed}"


def dark_map() -> Markup:
    """Return the dark colour of every light colour, as JSON."""
    return Markup(json.dumps(dark_colours()))


@functools.cache
def library() -> Markup:
    """Return BokehJS, compressed."""
    return compress_text(_library())


@functools.cache
def script() -> Markup:
    """Return the page's JavaScript module, which shows each figure when it becomes visible."""
    from rid_daq.figures.embedding import figure_script

    own = Path(__file__).with_name("report.js").read_text(encoding="utf-8")
    return Markup(figure_script().read_text(encoding="utf-8") + own)


def compress_text(text: str) -> Markup:
    """Return a text, compressed with gzip and encoded in base64."""
    return Markup(base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode("ascii"))


def _library() -> str:
    from rid_daq.figures.embedding import bokeh_script

    return bokeh_script().read_text(encoding="utf-8")


def _hash(text: Any) -> str:
    return base64.b64encode(hashlib.sha256(str(text).encode()).digest()).decode("ascii")
