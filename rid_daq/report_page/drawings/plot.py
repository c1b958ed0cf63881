"""`plot_svg`: a declared plot as SVG for print, drawn by matplotlib."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any, Final

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rid_daq.blocks.plot import Axis, Line, Mark, Marker, Panel, Plot
from rid_daq.figures.palette import LIGHT, line_stroke
from rid_daq.report_page.drawings.style import STYLE, as_svg, drawn_text

PX_PER_INCH: Final = 120.0
WIDTH_IN: Final = 9.6
MARGIN_IN: Final = 1.3
ROW_IN: Final = 0.2
MOST_NAMES: Final = 4
MOST_NAMES_IN_GRID: Final = 2
SMALL: Final = 7.5
_DASHES: Any = {"dotdash": "dashdot"}
_MARKERS: Final[dict[Marker, str]] = {
    "circle": "o",
    "square": "s",
    "diamond": "D",
    "triangle": "^",
    "inverted_triangle": "v",
}
_SCALE: Final = 0.75  # line width in points per px on the screen


def plot_svg(plot: Plot, name: str) -> Markup:
    """Return the drawing of a declared plot.

    Args:
        plot: Declaration of the plot.
        name: Prefix of the ids in the drawing, different for every figure of a page.
    """
    with mpl.rc_context(STYLE):
        if plot.columns > 1:
            return as_svg(_grid(plot.panels, min(plot.columns, len(plot.panels))), name)
        parts = enumerate(_drawings(plot.panels), start=1)
        return Markup().join(as_svg(_grid(part, 1), f"{name}-{i}") for i, part in parts)


class NotebookFigure(Figure):
    """A figure that a notebook shows, whether or not pyplot was imported."""

    def _repr_png_(self) -> bytes:
        buffer = io.BytesIO()
        self.savefig(buffer, format="png", dpi=PX_PER_INCH)
        return buffer.getvalue()


def matplotlib_figure(plot: Plot) -> Figure:
    """Return a declared plot as one matplotlib figure, with panels in a column or in a grid.

    Args:
        plot: Declaration of the plot.
    """
    with mpl.rc_context({**STYLE, "figure.facecolor": "white"}):
        return _grid(plot.panels, min(plot.columns, len(plot.panels)), NotebookFigure)


def svg_file(plot: Plot) -> bytes:
    """Return the drawing of a declared plot as one SVG file in the colours of light pages."""
    content = io.BytesIO()
    with mpl.rc_context(STYLE):
        matplotlib_figure(plot).savefig(content, format="svg", metadata={"Date": None})
    return content.getvalue()


def _drawings(panels: Sequence[Panel]) -> list[list[Panel]]:
    """Return the panels, grouped into drawings: each title begins a drawing."""
    drawings: list[list[Panel]] = []
    for each in panels:
        if each.title or not drawings:
            drawings.append([])
        drawings[-1].append(each)
    return drawings


def _grid(panels: Sequence[Panel], columns: int, kind: type[Figure] = Figure) -> Figure:
    rows = [panels[i : i + columns] for i in range(0, len(panels), columns)]
    heights = [max(map(_height_in, row)) for row in rows]
    size = (WIDTH_IN, MARGIN_IN * (len(rows) if columns > 1 else 1) + sum(heights))
    figure = kind(figsize=size, layout="constrained")
    axes = figure.subplots(len(rows), columns, height_ratios=heights, squeeze=False).ravel()
    for number, (each, drawing) in enumerate(zip(panels, axes, strict=False)):
        _draw(drawing, each, columns)
        if each.zooms_with_previous and number:
            drawing.set_xlim(*axes[number - 1].get_xlim())
        if columns == 1 and number and each.hides_x_of(panels[number - 1]):
            axes[number - 1].set_xlabel("")
            axes[number - 1].tick_params(labelbottom=False)
    for unused in axes[len(panels) :]:
        unused.set_visible(False)
    return figure


def _height_in(of: Panel) -> float:
    return 0.3 + ROW_IN * len(of.rows) if of.spans else of.height_px / PX_PER_INCH


def _draw(drawing: Axes, of: Panel, columns: int) -> None:
    if of.spans:
        _draw_spans(drawing, of)
    elif of.bars:
        _draw_bars(drawing, of)
    else:
        _draw_lines(drawing, of, columns)


def _draw_bars(drawing: Axes, of: Panel) -> None:
    values = [bar.value for bar in of.bars]
    bars = drawing.bar(range(len(values)), values, 0.9, color=LIGHT["blue"])
    drawing.bar_label(bars, [f"{value:g}" if value else "" for value in values], fontsize=SMALL)
    names = [drawn_text(bar.name) for bar in of.bars]
    drawing.set_xticks(range(len(names)), names, fontsize=SMALL)
    drawing.grid(visible=False, axis="x")
    _draw_axes(drawing, of)


def _draw_lines(drawing: Axes, of: Panel, columns: int) -> None:
    for line in of.lines:
        _draw_line(drawing, line)
    for at in of.limits:
        drawing.axhline(at, color=LIGHT["red"], linewidth=0.8)
    for mark in of.marks:
        _draw_mark(drawing, mark)
    named = sum(line.is_named for line in of.lines)
    if named:
        drawing.legend(
            loc="lower left",
            bbox_to_anchor=(0.0, 1.0),
            ncols=min(named, MOST_NAMES if columns == 1 else MOST_NAMES_IN_GRID),
            borderaxespad=0.0,
            columnspacing=1.0,
            fontsize=None if columns == 1 else SMALL,
            title=drawn_text(of.title) or None,
            alignment="left",
        )
    elif of.title:
        drawing.set_title(drawn_text(of.title), loc="left", fontsize=9.0)
    _draw_axes(drawing, of)


def _draw_line(drawing: Axes, line: Line) -> None:
    x, y = np.asarray(line.x), np.asarray(line.y, dtype=float)
    colour, dash = line_stroke(line)
    color = LIGHT[colour]
    label = drawn_text(line.label) if line.is_named else None
    if line.is_area:
        drawing.fill(x, y, color=color, alpha=0.2, linewidth=0.0, label=label)
        return
    if line.points:
        drawing.errorbar(
            x,
            y,
            line.reach,
            line.reach_x,
            fmt=_MARKERS[line.marker],
            color=color,
            markersize=3.5,
            capsize=2.0,
            label=label,
        )
        return
    if line.reach is not None and np.any(line.reach):
        reach = np.asarray(line.reach)
        drawing.fill_between(x, y - reach, y + reach, color=color, alpha=0.2, linewidth=0)
    style = _DASHES.get(dash, dash)
    drawing.plot(x, y, color=color, linestyle=style, linewidth=_SCALE * line.width, label=label)


def _draw_mark(drawing: Axes, mark: Mark) -> None:
    drawing.annotate(
        drawn_text(mark.text),
        (mark.x, mark.y),
        (5.0, 0.0),
        textcoords="offset points",
        va="center",
        color=LIGHT[mark.colour],
        fontsize=8.0,
    )


def _draw_spans(drawing: Axes, of: Panel) -> None:
    for span in of.spans:
        row = of.rows.index(span.name)
        place = [(span.begin, span.end - span.begin)]
        drawing.broken_barh(place, (row - 0.4, 0.8), color=LIGHT[span.colour])
    drawing.set_yticks(range(len(of.rows)), [drawn_text(row) for row in of.rows])
    drawing.set_ylim(len(of.rows) - 0.5, -0.5)
    drawing.set_xlabel(drawn_text(of.x.text))
    _draw_ends(drawing, of.x, None)


def _draw_axes(drawing: Axes, of: Panel) -> None:
    if of.x.log:
        drawing.set_xscale("log")
    if of.y.log:
        drawing.set_yscale("log")
    if of.x.counts:
        drawing.locator_params(axis="x", integer=True)
    drawing.set_xlabel(drawn_text(of.x.text))
    drawing.set_ylabel(drawn_text(of.y.text))
    if of.is_to_scale:
        drawing.set_aspect("equal", adjustable="datalim")
        drawing.margins(0.1)
    else:
        _draw_ends(drawing, of.x, of.y)


def _draw_ends(drawing: Axes, x: Axis, y: Axis | None) -> None:
    drawing.set_xlim(x.least, x.most)
    drawing.margins(x=0.0)
    if y is not None:
        drawing.set_ylim(y.least, y.most)
