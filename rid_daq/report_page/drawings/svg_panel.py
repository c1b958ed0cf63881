"""`SvgPanel`: the lines, points, bars and spans of one panel as SVG."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

import numpy as np
from markupsafe import escape
from numpy.typing import ArrayLike

from config.arrays import BoolArray, FloatArray
from rid_daq.blocks.plot import Axis, Line, Marker, Panel
from rid_daq.figures.palette import line_stroke
from rid_daq.report_page.drawings.scale import Scale, axis_ends
from rid_daq.terminal.console import make_printable

SMALL: Final = 7.5
_SCALE: Final = 0.75  # line width in points per px on the screen
_X_MARGIN: Final = 0.02
_Y_MARGIN: Final = 0.05
_EQUAL_MARGIN: Final = 0.1
_HALF_BAR: Final = 0.45
_HALF_SPAN: Final = 0.4
_CAP: Final = 2.0
_DASHES: Final = {"dashed": (3.7, 1.6), "dotdash": (6.4, 1.6, 1.0, 1.6), "dotted": (1.0, 1.65)}
"""Lengths of dashes and gaps, in line widths."""

_MARKERS: Final[dict[Marker, str]] = {
    "circle": "m-2,0a2,2 0 1,0 4,0a2,2 0 1,0 -4,0z",
    "square": "m-1.8,-1.8h3.6v3.6h-3.6z",
    "diamond": "m0,-2.6l2.6,2.6l-2.6,2.6l-2.6,-2.6z",
    "triangle": "m0,-2.3l2.2,4.4h-4.4z",
    "inverted_triangle": "m0,2.3l2.2,-4.4h-4.4z",
}


@dataclass(frozen=True)
class Area:
    """A rectangle in a drawing [pt]; y points down."""

    left: float
    top: float
    right: float
    bottom: float


@dataclass(frozen=True, eq=False)
class SvgPanel:
    """A panel in its area.

    Attributes:
        panel: The panel.
        area: Area within its axes.
        x, y: Scales of the axes; y counts the rows of a panel of spans downwards.
    """

    panel: Panel
    area: Area
    x: Scale
    y: Scale

    @classmethod
    def of(cls, panel: Panel, area: Area, x_ends: tuple[float, float] | None = None) -> SvgPanel:
        """Return a panel in an area; `x_ends` replaces the ends of x."""
        (x_low, x_high), (y_low, y_high) = _ends(panel, area)
        if x_ends is not None:
            x_low, x_high = x_ends
        y_log = panel.y.log and not panel.spans
        return cls(
            panel,
            area,
            Scale(x_low, x_high, panel.x.log and not panel.bars, area.left, area.right),
            Scale(y_low, y_high, y_log, area.bottom, area.top),
        )

    def content(self) -> Iterator[str]:
        """Yield the elements within the axes, in the order of drawing."""
        for line in self.panel.lines:
            yield from self._line(line)
        for at in self.panel.limits:
            y = float(self.y.place(np.array(at)))
            yield (
                f'<path d="M{self.area.left:.1f},{y:.1f}H{self.area.right:.1f}"'
                f' stroke="{colour("red")}" stroke-width=".8"/>'
            )
        for span in self.panel.spans:
            row = self.panel.rows.index(span.name)
            yield self._box(
                (span.begin, span.end), (row - _HALF_SPAN, row + _HALF_SPAN), span.colour
            )
        for number, bar in enumerate(self.panel.bars):
            base = self.y.low if self.y.is_log else 0.0
            if bar.value > base:
                sides = number - _HALF_BAR, number + _HALF_BAR
                yield self._box(sides, (base, bar.value), "blue")

    def texts(self) -> Iterator[str]:
        """Yield the texts, which may reach beyond the axes."""
        for mark in self.panel.marks:
            x, y = self._places([mark.x], [mark.y])
            where = x[0] + 5.0, y[0] + 3.0
            yield text(mark.text, *where, size=8.0, fill=mark.colour)
        for number, bar in enumerate(self.panel.bars):
            if bar.value:
                x, y = self._places([number], [bar.value])
                yield text(f"{bar.value:g}", x[0], y[0] - 2.5, size=SMALL, anchor="middle")

    def _places(self, x: ArrayLike, y: ArrayLike) -> tuple[FloatArray, FloatArray]:
        return self.x.place(np.asarray(x)), self.y.place(np.asarray(y))

    def _box(self, x: tuple[float, float], y: tuple[float, float], fill: str) -> str:
        (left, right), (one, other) = self._places(x, y)
        return (
            f'<rect x="{left:.1f}" y="{min(one, other):.1f}" width="{right - left:.1f}"'
            f' height="{abs(one - other):.1f}" fill="{colour(fill)}"/>'
        )

    def _line(self, line: Line) -> Iterator[str]:
        x, y = np.asarray(line.x, dtype=float), np.asarray(line.y, dtype=float)
        fill = colour(line_stroke(line).colour)
        if line.is_area:
            yield f'<path d="{_path(*self._places(x, y), closed=True)}" {_shade(fill)}/>'
            return
        if line.points:
            yield from self._points(line, x, y)
            return
        if line.reach is not None and np.any(line.reach):
            reach = np.asarray(line.reach)
            low = np.maximum(y - reach, self.y.low) if self.y.is_log else y - reach
            seen = np.isfinite(y)
            for part in np.split(np.arange(len(y)), np.flatnonzero(seen[1:] != seen[:-1]) + 1):
                if len(part) and seen[part[0]]:
                    around = np.concatenate([x[part], x[part][::-1]])
                    border = np.concatenate([low[part], (y + reach)[part][::-1]])
                    yield f'<path d="{_path(*self._places(around, border), closed=True)}"'
                    yield f" {_shade(fill)}/>"
        yield f'<path d="{_path(*self._places(x, y))}" {stroke_style(line)}/>'

    def _points(self, line: Line, x: FloatArray, y: FloatArray) -> Iterator[str]:
        fill = colour(line_stroke(line).colour)
        across, up = self._places(x, y)
        bars = []
        for reach, is_x in ((line.reach, False), (line.reach_x, True)):
            if reach is None:
                continue
            centre, scale = (x, self.x) if is_x else (y, self.y)
            low, high = centre - np.asarray(reach), centre + np.asarray(reach)
            low = np.maximum(low, scale.low) if scale.is_log else low
            places = np.column_stack([across, up, scale.place(low), scale.place(high)])
            for u, v, one, other in places[np.isfinite(places).all(axis=1)].tolist():
                if is_x:
                    caps = (f"M{each:.1f},{v - _CAP:.1f}v{2.0 * _CAP}" for each in (one, other))
                    bars.append(f"M{one:.1f},{v:.1f}H{other:.1f}{''.join(caps)}")
                else:
                    caps = (f"M{u - _CAP:.1f},{each:.1f}h{2.0 * _CAP}" for each in (one, other))
                    bars.append(f"M{u:.1f},{one:.1f}V{other:.1f}{''.join(caps)}")
        if bars:
            yield f'<path d="{"".join(bars)}" stroke="{fill}" fill="none"/>'
        shape = _MARKERS[line.marker]
        places = np.column_stack([across, up])
        seen = places[np.isfinite(places).all(axis=1)].tolist()
        marks = "".join(f"M{u:.1f},{v:.1f}{shape}" for u, v in seen)
        yield f'<path d="{marks}" fill="{fill}"/>'


def _shade(fill: str) -> str:
    return f'fill="{fill}" fill-opacity=".2"'


def colour(name: str) -> str:
    """Return a colour as a CSS variable, so that it follows the light or dark page."""
    return f"var(--{name})"


def text(
    words: str, x: float, y: float, *, size: float = 9.0, anchor: str = "start", fill: str = "ink"
) -> str:
    """Return a text whose baseline is at y; `anchor` is start, middle or end."""
    return (
        f'<text x="{x:.1f}" y="{y:.1f}" font-size="{size:g}" text-anchor="{anchor}"'
        f' fill="{colour(fill)}">{escape(make_printable(words))}</text>'
    )


def stroke_style(line: Line) -> str:
    """Return the attributes of a line's stroke."""
    name, dash = line_stroke(line)
    width = _SCALE * line.width
    parts = " ".join(f"{part * width:.3g}" for part in _DASHES.get(dash, ()))
    dashes = f' stroke-dasharray="{parts}"' if parts else ""
    return f'stroke="{colour(name)}" stroke-width="{width:.3g}"{dashes} fill="none"'


def marker(line: Line, x: float, y: float) -> str:
    """Return one marker of a line's points, with an error bar if the points have them."""
    fill = colour(line_stroke(line).colour)
    has_bar = line.reach is not None and any(line.reach)
    bar = f'<path d="M{x:.1f},{y - 4.5:.1f}v9" stroke="{fill}"/>' if has_bar else ""
    return f'<path d="M{x:.1f},{y:.1f}{_MARKERS[line.marker]}" fill="{fill}"/>{bar}'


def _path(x: FloatArray, y: FloatArray, *, closed: bool = False) -> str:
    """Return a path, to a tenth of a point and without equal neighbours; NaN is a gap."""
    points = np.asarray(np.round(np.column_stack([x, y]), 1), dtype=np.float64)
    seen: BoolArray = np.asarray(np.isfinite(points).all(axis=1))
    again = np.zeros(len(points), dtype=bool)
    again[1:] = ~np.any(np.diff(points, axis=0), axis=1)
    kept = seen & ~again
    begins = np.ones(len(points), dtype=bool)
    begins[1:] = ~seen[:-1]
    parts = [
        f"{'M' if begin else ' '}{u:g},{v:g}"
        for begin, (u, v) in zip(begins[kept].tolist(), points[kept].tolist(), strict=True)
    ]
    return "".join(parts) + ("z" if closed else "")


def _ends(panel: Panel, area: Area) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the ends of both axes."""
    if panel.spans:
        times = np.array([[span.begin, span.end] for span in panel.spans])
        return axis_ends(panel.x, times, 0.0), (len(panel.rows) - 0.5, -0.5)
    if panel.bars:
        values = np.array([bar.value for bar in panel.bars])
        x_axis = Axis(panel.x.label, panel.x.unit, least=-0.7, most=len(panel.bars) - 0.3)
        base = () if panel.y.log else (np.zeros(1),)
        low, high = axis_ends(panel.y, (values, *base), 2.0 * _Y_MARGIN)
        is_up = panel.y.least is None and not panel.y.log and values.min() >= 0.0
        return axis_ends(x_axis, (), 0.0), (0.0 if is_up else low, high)
    x_values = [np.asarray(line.x, dtype=float) for line in panel.lines]
    y_values = [np.asarray(line.y, dtype=float) for line in panel.lines]
    for line in panel.lines:
        for centre, reach, onto in (
            (line.x, line.reach_x, x_values),
            (line.y, line.reach, y_values),
        ):
            if reach is not None:
                middle = np.asarray(centre, dtype=float)
                onto += [middle - np.asarray(reach), middle + np.asarray(reach)]
    x_values.append(np.array([mark.x for mark in panel.marks]))
    y_values += [np.array([mark.y for mark in panel.marks]), np.asarray(panel.limits)]
    if not panel.is_to_scale:
        return axis_ends(panel.x, x_values, _X_MARGIN), axis_ends(panel.y, y_values, _Y_MARGIN)
    x_ends = axis_ends(panel.x, x_values, _EQUAL_MARGIN)
    y_ends = axis_ends(panel.y, y_values, _EQUAL_MARGIN)
    wide, high = area.right - area.left, area.bottom - area.top
    per_pt = max((x_ends[1] - x_ends[0]) / wide, (y_ends[1] - y_ends[0]) / high)
    return _around(x_ends, per_pt * wide), _around(y_ends, per_pt * high)


def _around(ends: tuple[float, float], length: float) -> tuple[float, float]:
    middle = 0.5 * (ends[0] + ends[1])
    return middle - 0.5 * length, middle + 0.5 * length
