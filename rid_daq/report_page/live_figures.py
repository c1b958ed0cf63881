"""`LiveFigures`: the figures of a report that are zoomed, packed into its page with their scripts.

A page has BokehJS once and each figure's item, all compressed; `report.js` unpacks what comes into
view. Nothing is loaded from anywhere, and the page's policy names the two scripts that may run by
their hashes: a script that got into the page otherwise does not run.
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
    """The figures of one page, in the order in which its templates ask for them."""

    def __init__(self) -> None:
        self._packed: dict[str, Markup] = {}

    def __iter__(self) -> Iterator[tuple[str, Markup]]:
        """Yield every figure's name and its packed item."""
        yield from self._packed.items()

    def __len__(self) -> int:
        return len(self._packed)

    def keep(self, plot: Plot) -> str:
        """Put a figure into the page; return its name there.

        Args:
            plot: The declaration of the figure.
        """
        from rid_daq.figures.embedding import as_item  # they load what draws
        from rid_daq.figures.plot_figure import plot_figure

        item = as_item(plot_figure(plot), dark=False)
        name = f"{plot.name}-{len(self._packed) + 1}"
        self._packed[name] = packed(json.dumps(item, allow_nan=False, separators=(",", ":")))
        return name

    @property
    def policy(self) -> str:
        """The content security policy of a page with these figures."""
        if not self._packed:
            return STILL_POLICY
        allowed = " ".join(f"'sha256-{_hash(text)}'" for text in (_library(), script()))
        return f"{STILL_POLICY} blob:; script-src {allowed}"


def dark_map() -> Markup:
    """Return the dark colour of every light one, as JSON."""
    return Markup(json.dumps(dark_colours()))


@functools.cache
def library() -> Markup:
    """Return BokehJS, packed."""
    return packed(_library())


@functools.cache
def script() -> Markup:
    """Return the page's own module: what shows a figure, and when."""
    from rid_daq.figures.embedding import figure_script

    own = Path(__file__).with_name("report.js").read_text(encoding="utf-8")
    return Markup(figure_script().read_text(encoding="utf-8") + own)


def packed(text: str) -> Markup:
    """Return a text compressed, as letters that mean nothing in HTML."""
    return Markup(base64.b64encode(gzip.compress(text.encode(), 9, mtime=0)).decode("ascii"))


def _library() -> str:
    from rid_daq.figures.embedding import bokeh_script

    return bokeh_script().read_text(encoding="utf-8")


def _hash(text: Any) -> str:
    return base64.b64encode(hashlib.sha256(str(text).encode()).digest()).decode("ascii")
