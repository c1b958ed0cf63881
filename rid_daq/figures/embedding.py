"""A figure in a page: its JSON, its CSV, and the scripts that show it.

A page loads `bokeh_script()` as an ordinary script and imports `showFigure` of `figure_script()`,
which is a module; both come from the page's own server, nothing from the internet. What BokehJS
needs of a Content-Security-Policy, found by trying in Chromium:

    script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self'

There is no `unsafe-eval`, since no figure holds code, and no `unsafe-inline` for scripts. Styles
need it: BokehJS writes style elements into the shadow tree of each of its views.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import bokeh
import numpy as np
from bokeh.embed import json_item
from bokeh.models import ColumnDataSource
from bokeh.models.ui import UIElement
from bokeh.themes import Theme

from rid_daq.figures.palette import GRID, INK, SOFT, darkened

CSV_DIGITS: Final = 7
FONT: Final = "system-ui, sans-serif"

_TEXT: Final = {"text_color": INK, "text_font": FONT, "text_font_size": "12px"}
_THEME: Final = Theme(
    json={
        "attrs": {
            "Plot": {
                "background_fill_color": None,
                "border_fill_color": None,
                "outline_line_color": None,
                "min_border_left": 4,
                "min_border_right": 14,
            },
            "Axis": {
                "axis_line_color": SOFT,
                "major_tick_line_color": SOFT,
                "minor_tick_line_color": None,
                "major_label_text_color": INK,
                "major_label_text_font": FONT,
                "major_label_text_font_size": "11px",
                "axis_label_text_color": INK,
                "axis_label_text_font": FONT,
                "axis_label_text_font_size": "12px",
                "axis_label_text_font_style": "normal",
                "axis_label_standoff": 6,
            },
            "Grid": {"grid_line_color": GRID},
            "Title": {**_TEXT, "text_font_style": "bold"},
            "Legend": {
                "label_text_color": INK,
                "label_text_font": FONT,
                "label_text_font_size": "11px",
                "background_fill_color": None,
                "border_line_color": None,
                "inactive_fill_color": GRID,
                "inactive_fill_alpha": 0.7,
                "padding": 0,
                "margin": 2,
                "spacing": 8,
                "glyph_width": 24,
                "glyph_height": 14,
            },
            "LabelSet": _TEXT,
        }
    }
)


def as_item(figure: UIElement, dark: bool) -> dict[str, object]:
    """Return what `Bokeh.embed.embed_item` of a page takes, as values of JSON.

    Args:
        figure: A layout of this room.
        dark: Whether the page is dark.
    """
    item: dict[str, object] = renumbered(dict(json_item(figure, theme=_THEME)), {})
    recoloured: dict[str, object] = darkened(item) if dark else item
    return recoloured


def renumbered(value: Any, known: dict[str, str]) -> Any:
    """Return an item whose models are numbered from 1, so that a figure has always the same bytes.

    Args:
        value: The item, or a value in it.
        known: New numbers by old ones; what is met first is numbered first.
    """
    if isinstance(value, dict):
        return {
            key: known.setdefault(child, f"p{len(known) + 1}")
            if key in ("id", "root_id")
            else renumbered(child, known)
            for key, child in value.items()
        }
    if isinstance(value, (list, tuple)):
        return [renumbered(child, known) for child in value]
    return value


def as_csv(figure: UIElement) -> str:
    """Return the data that a figure draws as one table, its names in the first line.

    Columns of different length stand side by side, empty where they end; where a figure holds
    several tables, each column says of which it is: "measured: frequency [Hz]".

    Args:
        figure: A layout of this room.
    """
    tables = list(_tables(figure))
    columns: dict[str, list[str]] = {}
    for table in tables:
        for name, values in table.data.items():
            title = f"{table.name}: {name}" if len(tables) > 1 else str(name)
            if title in columns:
                raise ValueError(f"two columns of a figure are called {title!r}")
            columns[title] = [_cell(value) for value in values]
    rows = max((len(column) for column in columns.values()), default=0)
    padded = [column + [""] * (rows - len(column)) for column in columns.values()]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*padded, strict=True))
    return text.getvalue()


def bokeh_script() -> Path:
    """Return BokehJS, which the server serves as it is: 1.3 MB, 0.35 MB compressed."""
    return Path(bokeh.__file__).parent / "server" / "static" / "js" / "bokeh.min.js"


def figure_script() -> Path:
    """Return the module that exports `showFigure(element, url)`."""
    return Path(__file__).with_name("figure.js")


def _tables(figure: UIElement) -> Iterator[ColumnDataSource]:
    """Yield the named data of a figure, in the order of drawing, each once."""
    found = [m for m in figure.references() if isinstance(m, ColumnDataSource) and m.name]
    yield from sorted(found, key=lambda table: int(table.id.removeprefix("p")))


def _cell(value: Any) -> str:
    if isinstance(value, (float, np.floating)):
        return f"{value:.{CSV_DIGITS}g}" if math.isfinite(value) else ""
    return str(value)
