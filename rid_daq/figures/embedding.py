"""Embedding of a figure in a page: its JSON, its CSV, and the scripts that show it.

A page loads `bokeh_script()` as an ordinary script and imports `showFigure` from the module
`figure_script()`. The page's own server provides both scripts; nothing is loaded from the internet.
BokehJS needs this Content-Security-Policy (tested in Chromium):

    script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data:; connect-src 'self'

`unsafe-eval` is not needed, because no figure contains code; scripts need no `unsafe-inline`.
Styles need it, because BokehJS writes style elements into the shadow tree of each of its views.
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

from rid_daq.figures.palette import GRID, INK, SOFT, to_dark

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
    """Return the argument of `Bokeh.embed.embed_item` as JSON values.

    Args:
        figure: A layout made by this package.
        dark: True for a dark page.
    """
    item: dict[str, object] = renumber_models(dict(json_item(figure, theme=_THEME)), {})
    recoloured: dict[str, object] = to_dark(item) if dark else item
    return recoloured


def renumber_models(value: Any, known: dict[str, str]) -> Any:
    """Return a Bokeh item with ids counted from 1, so that equal figures have equal bytes.

    Args:
        value: The item, or a value in it.
        known: New ids by old ids, in the order of first occurrence; extended by this function.
    """
    if isinstance(value, dict):
        return {
            key: known.setdefault(child, f"p{len(known) + 1}")
            if key in ("id", "root_id")
            else renumber_models(child, known)
            for key, child in value.items()
        }
    if isinstance(value, (list, tuple)):
        return [renumber_models(child, known) for child in value]
    return value


def as_csv(figure: UIElement) -> str:
    """Return the data of a figure as one CSV table with the names in the first line.

    Columns of different length are next to each other; the shorter ones have empty cells at the
    end. If a figure has several tables, each column name begins with the name of its table:
    "measured: frequency [Hz]".

    Args:
        figure: A layout made by this package.
    """
    tables = list(_tables(figure))
    columns: dict[str, list[str]] = {}
    for table in tables:
        for name, values in table.data.items():
            title = f"{table.name}: {name}" if len(tables) > 1 else str(name)
            if title in columns:
                raise ValueError(f"two columns of a figure have the same name {title!r}")
            columns[title] = [_cell(value) for value in values]
    rows = max((len(column) for column in columns.values()), default=0)
    padded = [column + [""] * (rows - len(column)) for column in columns.values()]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(zip(*padded, strict=True))
    return text.getvalue()


def bokeh_script() -> Path:
    """Return the path of BokehJS, which the server sends unchanged: 1.3 MB, 0.35 MB compressed."""
    return Path(bokeh.__file__).parent / "server" / "static" / "js" / "bokeh.min.js"


def figure_script() -> Path:
    """Return the path of the module that exports `showFigure(element, url)`."""
    return Path(__file__).with_name("figure.js")


def _tables(figure: UIElement) -> Iterator[ColumnDataSource]:
    """Yield each named data source of a figure once, in the order of drawing."""
    found = [m for m in figure.references() if isinstance(m, ColumnDataSource) and m.name]
    yield from sorted(found, key=lambda table: int(table.id.removeprefix("p")))


def _cell(value: Any) -> str:
    if isinstance(value, (float, np.floating)):
        return f"{value:.{CSV_DIGITS}g}" if math.isfinite(value) else ""
    return str(value)
