"""`figure_item`: a declared plot as the JSON values from which `figure.js` draws it.

A page loads the plot library uPlot, which the build bundles, and the module `figure_script()`,
whose function `showFigure` draws an item. Nothing is loaded from the internet. The scripts need
this Content-Security-Policy (tested in Chromium): `script-src 'self'; style-src 'self'`.
"""

from __future__ import annotations

import base64
import itertools
from pathlib import Path

import numpy as np

from rid_daq.blocks.plot import Axis, Gapped, Line, Numbers, Panel, Plot
from rid_daq.figures.palette import DARK, LIGHT, line_stroke
from rid_daq.terminal.console import make_printable


def figure_item(plot: Plot) -> dict[str, object]:
    """Return a plot as JSON values; equal plots give equal values.

    Columns of numbers are 32-bit floating-point numbers in little-endian order, encoded in base64;
    a gap is NaN. Lines refer to a column by its number, because many lines share their x values.
    """
    columns = _Columns()
    panels = [_panel(each, columns) for each in plot.panels]
    for drawn, (above, below) in zip(panels, itertools.pairwise(plot.panels), strict=False):
        drawn["hidesX"] = plot.columns == 1 and below.hides_x_of(above)
    return {
        "name": plot.name,
        "isGrid": plot.columns > 1,
        "themes": {"light": dict(LIGHT), "dark": dict(DARK)},
        "panels": panels,
        "columns": columns.encoded,
    }


def figure_script() -> Path:
    """Return the path of the module that exports `showFigure(element, source)`."""
    return Path(__file__).with_name("figure.js")


class _Columns:
    """Columns of numbers, each stored once."""

    def __init__(self) -> None:
        self._numbers: dict[Gapped, int] = {}
        self.encoded: list[str] = []

    def number(self, values: Gapped) -> int:
        """Return the number of a column, which is added if it is new."""
        if values not in self._numbers:
            self._numbers[values] = len(self.encoded)
            content = np.array(values, dtype="<f4").tobytes()
            self.encoded.append(base64.b64encode(content).decode("ascii"))
        return self._numbers[values]

    def reach(self, values: Numbers | None) -> int | None:
        """Return the number of a column of half widths; None if all are zero."""
        return self.number(values) if values is not None and any(values) else None


def _panel(of: Panel, columns: _Columns) -> dict[str, object]:
    return {
        "title": make_printable(of.title),
        "x": _axis(of.x),
        "y": _axis(of.y),
        "height": of.height_px,
        "isToScale": of.is_to_scale,
        "zoomsWithPrevious": of.zooms_with_previous,
        "limits": list(of.limits),
        "lines": [_line(line, columns) for line in of.lines],
        "marks": [
            {"x": mark.x, "y": mark.y, "text": make_printable(mark.text), "colour": mark.colour}
            for mark in of.marks
        ],
        "rows": [make_printable(row) for row in of.rows],
        "spans": [
            {
                "row": of.rows.index(span.name),
                "from": span.begin,
                "to": span.end,
                "colour": span.colour,
            }
            for span in of.spans
        ],
        "bars": [{"name": make_printable(bar.name), "value": bar.value} for bar in of.bars],
    }


def _axis(of: Axis) -> dict[str, object]:
    return {
        "label": make_printable(of.label),
        "text": make_printable(of.text),
        "unit": make_printable(of.unit),
        "isLog": of.log,
        "isCount": of.counts,
        "ends": None if of.least is None or of.most is None else [of.least, of.most],
    }


def _line(of: Line, columns: _Columns) -> dict[str, object]:
    stroke = line_stroke(of)
    return {
        "label": make_printable(of.label),
        "isNamed": of.is_named,
        "x": columns.number(of.x),
        "y": columns.number(of.y),
        "reach": columns.reach(of.reach),
        "reachX": columns.reach(of.reach_x),
        "colour": stroke.colour,
        "dash": stroke.dash,
        "width": of.width,
        "marker": of.marker if of.points else None,
        "isArea": of.is_area,
    }
