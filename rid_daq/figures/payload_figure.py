"""`payload_figure`: where a payload's centre of gravity lies at the flange, in three views."""

from __future__ import annotations

from typing import Final

import numpy as np
from bokeh.models import ColumnDataSource, GridPlot
from bokeh.plotting import figure

from rid_daq.figures.centre_of_gravity import CentreOfGravity, ellipse
from rid_daq.figures.palette import BLUE, GREEN, INK, ORANGE, RED, SKY
from rid_daq.figures.panel import (
    Drawn,
    add_hover,
    add_legend,
    beside,
    layout,
    outline,
    panel_to_scale,
    source,
)

AXES: Final = "xyz"
VIEWS: Final = ((0, 2), (1, 2), (0, 1))
AXIS_SHARE: Final = 0.3
PADDING: Final = 0.3
_COLORS: Final = (RED, GREEN, BLUE)


def payload_figure(drawn: CentreOfGravity) -> GridPlot:
    """Return a figure of the centre of gravity seen along each axis of the flange, to scale.

    Drawn are the flange's axes, the centre with its interval (2σ each way) and its ellipse (2σ,
    both coordinates together), and the ellipsoid of even density that has the payload's mass and
    inertia, where all parameters are seen: the payload is at least about as large.

    Parameters
    ----------
    drawn : CentreOfGravity
        Of a payload; without a covariance there is no ellipse.
    """
    data = _table(drawn)
    views = [_view(drawn, data, across) for across in VIEWS]
    return layout("payload", [beside(views)], views)


def _table(drawn: CentreOfGravity) -> ColumnDataSource:
    columns = {}
    for axis, centre, sigma in zip(AXES, drawn.centre_mm, drawn.sigma_mm, strict=True):
        columns[f"{axis} of the centre [mm]"] = [centre]
        columns[f"{axis} 2σ [mm]"] = [2.0 * sigma]
        columns[f"{axis} - 2σ [mm]"] = [centre - 2.0 * sigma]
        columns[f"{axis} + 2σ [mm]"] = [centre + 2.0 * sigma]
    return source("centre of gravity", columns)


def _view(drawn: CentreOfGravity, data: ColumnDataSource, across: tuple[int, int]) -> figure:
    """Draw the view along the third axis."""
    pair = list(across)
    centre = drawn.centre_mm[pair]
    x, y = (AXES[k] for k in across)
    told = "".join(
        f"\n{AXES[k]} {drawn.centre_mm[k]:.1f} ± {2.0 * drawn.sigma_mm[k]:.1f} mm (2σ)"
        if np.isfinite(drawn.centre_mm[k])
        else f"\n{AXES[k]} not shown"
        for k in across
    )
    plot = panel_to_scale(
        f"{x} and {y}{told}",
        f"{x} of the flange [mm]",
        f"{y} of the flange [mm]",
        height=320,
    )
    entries: dict[str, list[Drawn]] = {}
    sizes = [float(np.linalg.norm(np.nan_to_num(centre))), 50.0]
    if drawn.spread_mm2 is not None and np.isfinite(centre).all():
        edge = ellipse(centre, drawn.spread_mm2[np.ix_(pair, pair)])
        shape = outline({"x": edge[0], "y": edge[1]})
        entries["even density"] = [
            plot.patch(
                "x", "y", source=shape, fill_color=SKY, fill_alpha=0.2, line_color=SKY, line_width=1
            )
        ]
    framed = _draw_flange(plot, across, AXIS_SHARE * max(sizes))
    if np.isfinite(centre).all():
        names, low, high = (
            [f"{axis} {word} [mm]" for axis in (x, y)] for word in ("of the centre", "- 2σ", "+ 2σ")
        )
        sure = [f"{axis} 2σ [mm]" for axis in (x, y)]
        dot = plot.scatter(names[0], names[1], source=data, size=8, color=INK)
        entries = {
            "centre ± 2σ": [
                dot,
                plot.segment(low[0], names[1], high[0], names[1], source=data, line_color=INK),
                plot.segment(names[0], low[1], names[0], high[1], source=data, line_color=INK),
            ],
            **entries,
        }
        framed += entries["centre ± 2σ"]
        if drawn.covariance_mm2 is not None:
            edge = ellipse(centre, 4.0 * drawn.covariance_mm2[np.ix_(pair, pair)])
            around = outline({"x": edge[0], "y": edge[1]})
            line = plot.line("x", "y", source=around, line_color=ORANGE, line_width=2.5)
            entries["ellipse 2σ"] = [line]
            framed.append(line)
        add_hover(plot, dot, {x: names[0], f"{x} ± 2σ": sure[0], y: names[1], f"{y} ± 2σ": sure[1]})
        add_legend(plot, entries)
    for bounds in (plot.x_range, plot.y_range):
        bounds.update(renderers=framed, range_padding=PADDING)
    return plot


def _draw_flange(plot: figure, across: tuple[int, int], length: float) -> list[Drawn]:
    """Draw the axes of the flange's frame from its origin, with their names."""
    lines: list[Drawn] = []
    for k, color in enumerate(_COLORS):
        if k not in across:
            continue
        tip = [length if k == axis else 0.0 for axis in across]
        arrow = outline({"x": [0.0, tip[0]], "y": [0.0, tip[1]]})
        name = outline({"x": tip[:1], "y": tip[1:], "text": [AXES[k]]})
        lines.append(plot.line("x", "y", source=arrow, line_color=color, line_width=3.0))
        plot.text(
            "x",
            "y",
            "text",
            source=name,
            x_offset=4,
            y_offset=-2,
            text_font_size="13px",
            text_font_style="bold",
            text_color=color,
        )
    origin = outline({"x": [0.0], "y": [0.0]})
    plot.scatter(
        "x", "y", source=origin, marker="circle_cross", size=10, line_color=INK, fill_alpha=0
    )
    return lines
