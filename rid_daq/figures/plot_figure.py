"""`plot_figure`: a declared plot as a Bokeh figure that can be zoomed."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from typing import Final

import numpy as np
from bokeh.models import ColumnDataSource, FactorRange, GridPlot
from bokeh.plotting import figure

from rid_daq.blocks.plot import Axis, Dash, Line, Mark, Panel, Plot
from rid_daq.figures.palette import NAMED, RED, joint_stroke
from rid_daq.figures.panel import (
    Drawn,
    Ranges,
    add_hover,
    add_legend,
    add_limit_line,
    csv_source,
    figure_layout,
    panel,
    panel_to_scale,
    row_of_panels,
    source_outside_csv,
)

MOST_HOVER_LINES: Final = 6
ROW_PX: Final = 24
SPANS_MARGIN_PX: Final = 100


def plot_figure(plot: Plot) -> GridPlot:
    """Return the Bokeh figure of a declared plot."""
    drawn: list[figure] = []
    title = ""
    for number, each in enumerate(plot.panels):
        title = each.title or title
        shared = drawn[-1].x_range if each.zooms_with_previous and drawn else None
        if plot.columns == 1 and number and each.hides_x_of(plot.panels[number - 1]):
            drawn[-1].xaxis.visible = False
        draw = _spans if each.spans else _bars if each.bars else _lines
        drawn.append(draw(each, shared, title))
    return figure_layout(plot.name, [row_of_panels(drawn)] if plot.columns > 1 else drawn, drawn)


def line_stroke(line: Line) -> tuple[str, Dash]:
    """Return colour and dash of a line."""
    if isinstance(line.stroke, int):
        own = joint_stroke(line.stroke)
        return own.color, line.dash or own.dash
    return NAMED[line.stroke], line.dash or "solid"


def _lines(of: Panel, shared: Ranges, title: str) -> figure:
    drawing = _empty(of, shared)
    entries: dict[str, list[Drawn]] = defaultdict(list)
    for line in of.lines:
        if line.is_area:
            entries[line.label].append(_area(drawing, line))
    own: dict[str, Drawn] = {}
    for line, rows in _sources(of, title):
        name, (color, dash) = f"{line.label} [{of.y.unit}]", line_stroke(line)
        drawn: list[Drawn] = []
        if line.reach is not None and np.any(line.reach):
            least, most = _bounds(line, of.y.unit)
            if line.points:
                drawn.append(
                    drawing.segment(
                        of.x.text, least, of.x.text, most, source=rows, line_color=color
                    )
                )
            else:
                drawn.append(
                    drawing.varea(
                        of.x.text, least, most, source=rows, fill_color=color, fill_alpha=0.2
                    )
                )
        if line.reach_x is not None and np.any(line.reach_x):
            least, most = _bounds_x(line, of.x.unit)
            drawn.append(drawing.segment(least, name, most, name, source=rows, line_color=color))
        if line.points:
            own[line.label] = drawing.scatter(
                of.x.text, name, source=rows, marker=line.marker, color=color, size=6
            )
        else:
            own[line.label] = drawing.line(
                of.x.text,
                name,
                source=rows,
                line_color=color,
                line_dash=dash,
                line_width=line.width,
            )
        if line.is_named:
            entries[line.label] += [*drawn, own[line.label]]
    _add_hovers(drawing, of, own)
    for at in of.limits:
        add_limit_line(drawing, at, RED)
    for mark in of.marks:
        _draw_mark(drawing, mark)
    if entries:
        add_legend(drawing, entries)
    return drawing


def _empty(of: Panel, shared: Ranges) -> figure:
    if of.is_to_scale:
        return panel_to_scale(of.title, of.x.text, of.y.text, of.height_px)
    return panel(
        of.title,
        of.x.text,
        of.y.text,
        height=of.height_px,
        x_range=shared if shared is not None else _ends(of.x),
        y_range=_ends(of.y),
        x_scale="log" if of.x.log else "auto",
        y_scale="log" if of.y.log else "auto",
    )


def _area(drawing: figure, line: Line) -> Drawn:
    edge = source_outside_csv({"x": line.x, "y": line.y})
    color, _ = line_stroke(line)
    return drawing.patch("x", "y", source=edge, color=color, fill_alpha=0.2, line_alpha=0.0)


def _draw_mark(drawing: figure, mark: Mark) -> None:
    drawing.text(
        "x",
        "y",
        "text",
        source=source_outside_csv({"x": [mark.x], "y": [mark.y], "text": [mark.text]}),
        x_offset=6,
        text_baseline="middle",
        text_font_size="12px",
        text_color=NAMED[mark.colour],
    )


def _add_hovers(drawing: figure, of: Panel, own: Mapping[str, Drawn]) -> None:
    """Show values of all lines at the pointer if they are few and share their x values."""
    lines = [line for line in of.lines if not line.is_area]
    names = {line.label: f"{line.label} [{of.y.unit}]" for line in lines}
    if len({line.x for line in lines}) == 1 and len(names) <= MOST_HOVER_LINES:
        whole = next((line for line in lines if None not in line.y), lines[0])
        shown = {of.x.label: of.x.text, **names}
        add_hover(drawing, own[whole.label], shown, along_x=True, digits=4)
        return
    for label, name in names.items():
        add_hover(drawing, own[label], {of.x.label: of.x.text, label: name}, digits=4)


def _sources(of: Panel, title: str) -> Iterator[tuple[Line, ColumnDataSource]]:
    """Yield each line with its data source; lines with the same x values share one."""
    tables: dict[tuple[float, ...], list[Line]] = defaultdict(list)
    for line in of.lines:
        if not line.is_area:
            tables[line.x].append(line)
    made = {}
    for x, lines in tables.items():
        columns: dict[str, object] = {of.x.text: x}
        for line in lines:
            columns[f"{line.label} [{of.y.unit}]"] = np.asarray(line.y, dtype=float)
            if line.reach is not None and np.any(line.reach):
                y, reach = np.asarray(line.y, dtype=float), np.asarray(line.reach)
                least, most = _bounds(line, of.y.unit)
                columns |= {least: y - reach, most: y + reach}
            if line.reach_x is not None and np.any(line.reach_x):
                reach = np.asarray(line.reach_x)
                least, most = _bounds_x(line, of.x.unit)
                columns |= {least: np.asarray(x) - reach, most: np.asarray(x) + reach}
        name = lines[0].label if len(tables) > 1 else of.y.label
        made[x] = csv_source(f"{title} {name}".lstrip(), columns)
    for line in of.lines:
        if not line.is_area:
            yield line, made[line.x]


def _bounds(line: Line, unit: str) -> tuple[str, str]:
    return f"{line.label}, least [{unit}]", f"{line.label}, most [{unit}]"


def _bounds_x(line: Line, unit: str) -> tuple[str, str]:
    return f"{line.label}, x least [{unit}]", f"{line.label}, x most [{unit}]"


def _ends(axis: Axis) -> Ranges:
    return None if axis.least is None or axis.most is None else (axis.least, axis.most)


def _bars(of: Panel, _shared: Ranges, title: str) -> figure:
    name, value = of.x.label, of.y.text
    names = [bar.name for bar in of.bars]
    columns = {name: names, value: [bar.value for bar in of.bars]}
    rows = csv_source(f"{title} {of.y.label}".lstrip(), columns)
    drawing = panel(
        of.title,
        of.x.text,
        value,
        height=of.height_px,
        x_range=FactorRange(factors=names),
        y_range=_ends(of.y),
        y_scale="log" if of.y.log else "auto",
    )
    drawing.xaxis.major_label_orientation = 0.6
    bars = drawing.vbar(name, 0.8, value, of.y.least or 0.0, source=rows, color=NAMED["blue"])
    add_hover(drawing, bars, {name: name, of.y.label: value}, digits=9)
    return drawing


def _spans(of: Panel, shared: Ranges, title: str) -> figure:
    begin, end = f"begin [{of.x.unit}]", f"end [{of.x.unit}]"
    columns = {
        of.y.label: [span.name for span in of.spans],
        begin: [span.begin for span in of.spans],
        end: [span.end for span in of.spans],
    }
    rows = csv_source(f"{title} {of.y.label}".lstrip(), columns)
    rows.add([NAMED[span.colour] for span in of.spans], "colour")
    drawing = panel(
        of.y.label,
        of.x.text,
        "",
        height=SPANS_MARGIN_PX + ROW_PX * len(of.rows),
        x_range=shared if shared is not None else _ends(of.x),
        y_range=FactorRange(factors=list(of.rows)[::-1]),
    )
    bars = drawing.hbar(of.y.label, 0.7, end, begin, source=rows, color="colour")
    shown = {of.y.label: of.y.label, f"from [{of.x.unit}]": begin, f"to [{of.x.unit}]": end}
    add_hover(drawing, bars, shown, digits=4)
    return drawing
