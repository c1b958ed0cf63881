"""`plot_svg`: a declared plot as inline SVG for print, without a plot library.

matplotlib needs 0.5 s of processor time for its import, and 0.3 s for a plot of six lines. It draws
the figures of notebooks and the files that a user saves (`plot.py`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from markupsafe import Markup

from rid_daq.blocks.plot import Line, Panel, Plot
from rid_daq.report_page.drawings.scale import Tick
from rid_daq.report_page.drawings.svg_panel import (
    SMALL,
    Area,
    SvgPanel,
    colour,
    marker,
    stroke_style,
    text,
)

WIDTH: Final = 691.2
"""Width of a drawing [pt]."""

_PT_PER_PX: Final = 0.6
_ROW_HEIGHT: Final = 14.4
_SPANS_HEIGHT: Final = 21.6
_SIZE: Final = 9.0
_EM: Final = 0.56
"""Width of a character in font sizes, on average; the font of the page is unknown."""

_MOST_NAMES: Final = 4
_MOST_NAMES_IN_GRID: Final = 2
_LINE_HEIGHT: Final = 13.0
_HANDLE: Final = 26.0
_GAP: Final = 10.0
_X_SPACING: Final = 36.0
_Y_SPACING: Final = 19.0
_TICK: Final = 3.5
_MINOR_TICK: Final = 2.0


def plot_svg(plot: Plot, name: str) -> Markup:
    """Return the drawing of a declared plot; panels in a column are separate SVG elements.

    Args:
        plot: Declaration of the plot.
        name: Prefix of the ids in the drawing, different for every figure of a page.
    """
    columns = min(plot.columns, len(plot.panels))
    if plot.columns > 1:
        return _drawing(plot.panels, columns, name)
    parts = enumerate(_drawings(plot.panels), start=1)
    return Markup().join(_drawing(part, 1, f"{name}-{number}") for number, part in parts)


def _drawings(panels: Sequence[Panel]) -> list[list[Panel]]:
    """Return the panels, grouped into drawings: each title begins a drawing."""
    drawings: list[list[Panel]] = []
    for each in panels:
        if each.title or not drawings:
            drawings.append([])
        drawings[-1].append(each)
    return drawings


@dataclass(frozen=True)
class _Legend:
    """Names of lines above a panel.

    Attributes:
        lines: The lines, column by column.
        columns: Number of columns.
        size: Font size [pt].
    """

    lines: tuple[Line, ...]
    columns: int
    size: float

    @classmethod
    def of(cls, panel: Panel, width: float, *, in_grid: bool) -> _Legend:
        """Return the legend with the most columns that fit into a width [pt]."""
        lines = tuple(line for line in panel.lines if line.is_named)
        most = _MOST_NAMES_IN_GRID if in_grid else _MOST_NAMES
        found = cls(lines, max(1, min(len(lines), most)), SMALL if in_grid else _SIZE)
        while found.columns > 1 and sum(found.widths) > width:
            found = replace(found, columns=found.columns - 1)
        return found

    @property
    def rows(self) -> int:
        """Number of rows."""
        return math.ceil(len(self.lines) / self.columns)

    @property
    def widths(self) -> list[float]:
        """Width of each column [pt]."""
        parts = [self.lines[i : i + self.rows] for i in range(0, len(self.lines), self.rows or 1)]
        return [
            _HANDLE + _GAP + max(_width(line.label, self.size) for line in part) for part in parts
        ]

    def elements(self, left: float, top: float) -> Iterator[str]:
        """Yield the elements of the legend."""
        widths = self.widths
        for number, line in enumerate(self.lines):
            column, row = divmod(number, self.rows)
            x, y = left + sum(widths[:column]), top + _LINE_HEIGHT * (row + 0.5)
            if line.points:
                yield marker(line, x + 0.4 * _HANDLE, y)
            elif line.is_area:
                fill = stroke_style(line).partition('"')[2].partition('"')[0]
                yield f'<rect x="{x:.1f}" y="{y - 3.0:.1f}" width="18" height="6" fill="{fill}"'
                yield ' fill-opacity=".2"/>'
            else:
                yield f'<path d="M{x:.1f},{y:.1f}h20" {stroke_style(line)}/>'
            yield text(line.label, x + _HANDLE, y + 0.35 * self.size, size=self.size)


@dataclass(frozen=True, eq=False)
class _Cell:
    """A panel with the space around its axes.

    Attributes:
        panel: The panel.
        left, width: Place and width of the cell [pt].
        in_grid: True if cells are side by side.
        hides_x: True to leave out the labels of x, which the panel below has.
    """

    panel: Panel
    left: float
    width: float
    in_grid: bool
    hides_x: bool

    @property
    def height(self) -> float:
        """Height of the area within the axes [pt]."""
        if self.panel.spans:
            return _SPANS_HEIGHT + _ROW_HEIGHT * len(self.panel.rows)
        return _PT_PER_PX * self.panel.height_px

    @property
    def legend(self) -> _Legend:
        """The legend."""
        return _Legend.of(self.panel, self.width, in_grid=self.in_grid)

    @property
    def head(self) -> float:
        """Height of title and legend [pt]."""
        rows = self.legend.rows + bool(self.panel.title)
        return _LINE_HEIGHT * rows + 8.0

    @property
    def foot(self) -> float:
        """Height of the labels of x [pt]."""
        return 6.0 if self.hides_x else 30.0

    def scales(self) -> SvgPanel:
        """Return the panel over the whole width of the cell, which has nearly the same scales."""
        return SvgPanel.of(self.panel, Area(self.left, 0.0, self.left + self.width, self.height))

    def margin(self) -> float:
        """Return the width of the labels of y [pt]."""
        if self.panel.spans:
            return 12.0 + max(_width(row, _SIZE) for row in self.panel.rows)
        widths = (_width(tick.label, _SIZE) for tick in self.scales().y.ticks(_Y_SPACING))
        return 27.0 + max(widths, default=0.0)


def _width(words: str, size: float) -> float:
    return _EM * size * len(words)


def _drawing(panels: Sequence[Panel], columns: int, name: str) -> Markup:
    """Return panels as one SVG element."""
    width = WIDTH / columns
    cells = [
        _Cell(
            panel,
            width * (number % columns),
            width,
            columns > 1,
            columns == 1 and number + 1 < len(panels) and panels[number + 1].hides_x_of(panel),
        )
        for number, panel in enumerate(panels)
    ]
    margins = [max(cell.margin() for cell in cells[column::columns]) for column in range(columns)]
    top, parts = 0.0, list[str]()
    x_ends = _common_x(cells)
    for first in range(0, len(cells), columns):
        row = cells[first : first + columns]
        head, height = max(cell.head for cell in row), max(cell.height for cell in row)
        for column, cell in enumerate(row):
            area = Area(
                cell.left + margins[column],
                top + head,
                cell.left + cell.width - 8.0,
                top + head + height,
            )
            drawn = SvgPanel.of(cell.panel, area, x_ends[first + column])
            parts.append(f'<g id="{name}-axes_{first + column + 1}">')
            parts.extend(_axes(cell, drawn, f"{name}-clip_{first + column + 1}"))
            parts.append("</g>")
        top += head + height + max(cell.foot for cell in row)
    return Markup(
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH:g} {top:.1f}" fill="none"'
        f' font-family="DejaVu Sans, sans-serif" stroke-linejoin="round">{"".join(parts)}</svg>'
    )


def _common_x(cells: Sequence[_Cell]) -> list[tuple[float, float] | None]:
    """Return the ends of x of each cell; panels that zoom together have the same ends.

    None leaves a panel to itself: it is to scale, or has another kind of scale than the previous.
    """
    ends: list[tuple[float, float] | None] = []
    group: list[int] = []
    for number, cell in enumerate(cells):
        panel = cell.panel
        own = cell.scales().x
        ends.append(None if panel.is_to_scale else (own.low, own.high))
        joins = panel.zooms_with_previous and group
        if joins and cells[number - 1].panel.x.log == panel.x.log:
            group.append(number)
        else:
            group = [number]
        known = [each for each in (ends[member] for member in group) if each is not None]
        if len(known) > 1:
            lows, highs = zip(*known, strict=True)
            for member in group:
                ends[member] = min(lows), max(highs)
    return ends


def _axes(cell: _Cell, drawn: SvgPanel, clip: str) -> Iterator[str]:
    """Yield a panel with its axes, title and legend."""
    area, panel = drawn.area, cell.panel
    middle_x, middle_y = 0.5 * (area.left + area.right), 0.5 * (area.top + area.bottom)
    yield from _x_ticks(cell, drawn)
    yield from _y_ticks(drawn)
    yield (
        f'<clipPath id="{clip}"><rect x="{area.left:.1f}" y="{area.top:.1f}"'
        f' width="{area.right - area.left:.1f}" height="{area.bottom - area.top:.1f}"/></clipPath>'
        f'<g clip-path="url(#{clip})">'
    )
    yield from drawn.content()
    yield (
        f'</g><path d="M{area.left:.1f},{area.top:.1f}V{area.bottom:.1f}H{area.right:.1f}"'
        f' stroke="{colour("soft")}" stroke-width=".8"/>'
    )
    yield from drawn.texts()
    if not cell.hides_x:
        yield text(panel.x.text, middle_x, area.bottom + 25.0, anchor="middle")
    if not panel.spans:
        at = area.left - cell.margin() + 9.0
        turned = f'<g transform="rotate(-90 {at:.1f} {middle_y:.1f})">'
        yield f"{turned}{text(panel.y.text, at, middle_y, anchor='middle')}</g>"
    top = area.top - _LINE_HEIGHT * cell.legend.rows - 3.0
    if panel.title:
        yield text(panel.title, area.left, top - 4.0)
    yield from cell.legend.elements(area.left, top)


def _x_ticks(cell: _Cell, drawn: SvgPanel) -> Iterator[str]:
    """Yield ticks, grid lines and labels of x."""
    area, is_named = drawn.area, bool(drawn.panel.bars)
    ticks = drawn.x.ticks(_X_SPACING)
    widest = max((_width(tick.label, _SIZE) for tick in ticks), default=0.0)
    ticks = drawn.x.ticks(max(_X_SPACING, widest + _GAP))
    if is_named:
        ticks = tuple(Tick(number, bar.name) for number, bar in enumerate(drawn.panel.bars))
    places = drawn.x.place(np.array([tick.value for tick in ticks]))
    for tick, x in zip(ticks, places.tolist(), strict=True):
        if tick.label and not is_named:
            yield _grid_line(f"M{x:.1f},{area.bottom:.1f}V{area.top:.1f}")
        length = _TICK if tick.label else _MINOR_TICK
        yield _tick_line(f"M{x:.1f},{area.bottom:.1f}v{length}")
        if tick.label and not cell.hides_x:
            size = SMALL if is_named else _SIZE
            yield text(tick.label, x, area.bottom + 13.0, size=size, anchor="middle")


def _y_ticks(drawn: SvgPanel) -> Iterator[str]:
    """Yield ticks, grid lines and labels of y."""
    area = drawn.area
    if drawn.panel.spans:
        ticks = tuple(Tick(number, row) for number, row in enumerate(drawn.panel.rows))
    else:
        ticks = drawn.y.ticks(_Y_SPACING)
    places = drawn.y.place(np.array([tick.value for tick in ticks]))
    for tick, y in zip(ticks, places.tolist(), strict=True):
        if tick.label:
            yield _grid_line(f"M{area.left:.1f},{y:.1f}H{area.right:.1f}")
            yield text(tick.label, area.left - 6.0, y + 3.2, anchor="end")
        yield _tick_line(f"M{area.left:.1f},{y:.1f}h-{_TICK if tick.label else _MINOR_TICK}")


def _grid_line(path: str) -> str:
    return f'<path d="{path}" stroke="{colour("grid")}" stroke-width=".6"/>'


def _tick_line(path: str) -> str:
    return f'<path d="{path}" stroke="{colour("soft")}" stroke-width=".8"/>'
