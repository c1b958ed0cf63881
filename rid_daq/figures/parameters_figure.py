"""`parameters_figure`: a robot's parameters with their intervals, unit by unit."""

from __future__ import annotations

from typing import Final

import numpy as np
from bokeh.models import FactorRange, GridPlot
from bokeh.plotting import figure

from rid_daq.figures.palette import BLUE, INK, ORANGE, SOFT
from rid_daq.figures.panel import (
    Drawn,
    add_hover,
    add_legend,
    beside,
    layout,
    limit_line,
    panel,
    source,
)
from rid_daq.report.sections.estimate import EstimateSection, ParameterEntry

NAME: Final = "parameter"
NUMBER: Final = "number"
PERCENT: Final = "2σ [% of the value]"
ROW_PX: Final = 20
FRAME_PX: Final = 120


def parameters_figure(section: EstimateSection) -> GridPlot:
    """Return a figure of estimates ± 2σ, and of 2σ in percent of the estimate.

    Parameters of one unit share a panel. Where the robot is simulated, true values are drawn.

    Args:
        section: The parameters.
    """
    numbered = list(enumerate(section.parameters, start=1))
    rows, panels = [], []
    for unit in dict.fromkeys(each.unit for each in section.parameters):
        own = [(i, each) for i, each in numbered if each.unit == unit]
        pair = _panels(unit, own)
        panels += pair
        rows.append(beside(pair))
    return layout("parameters", rows, panels)


def _panels(unit: str, own: list[tuple[int, ParameterEntry]]) -> list[figure]:
    label = unit or "no unit"
    names = [f"{i} {each.name}" for i, each in own]
    values = np.array([each.value for _, each in own])
    reach = 2.0 * np.array([each.std for _, each in own])
    truth = np.array([np.nan if each.truth is None else each.truth for _, each in own])
    share = np.where(values != 0.0, 100.0 * reach / np.abs(values), np.nan)
    value, low, high = f"estimate [{label}]", f"estimate - 2σ [{label}]", f"estimate + 2σ [{label}]"
    columns: dict[str, object] = {
        NAME: names,
        "in words": [each.words for _, each in own],
        value: values,
        low: values - reach,
        high: values + reach,
        f"2σ [{label}]": reach,
        PERCENT: share,
    }
    true = f"true value [{label}]"
    if np.isfinite(truth).any():
        columns[true] = truth
    data = source(f"parameters in {label}", columns)
    height = FRAME_PX + ROW_PX * len(own)
    bounds = FactorRange(factors=names[::-1])
    left = panel(f"estimates ± 2σ [{label}]", value, "", height=height, y_range=bounds)
    limit_line(left, 0.0, vertical=True)
    bars = left.segment(low, NAME, high, NAME, source=data, line_color=SOFT, line_width=3.0)
    dots = left.scatter(value, NAME, source=data, size=7, color=INK)
    entries: dict[str, list[Drawn]] = {"estimate ± 2σ": [dots, bars]}
    if true in columns:
        entries["true value"] = [
            left.scatter(
                true,
                NAME,
                source=data,
                marker="diamond",
                size=11,
                fill_alpha=0.0,
                line_color=ORANGE,
                line_width=2.0,
            )
        ]
    shown = {"parameter": NAME, "": "in words", "estimate": value, "± 2σ": f"2σ [{label}]"}
    add_hover(left, dots, shown)
    add_legend(left, entries)
    right = panel(
        "how sure: 2σ in % of the value",
        PERCENT,
        "",
        height=height,
        x_scale="log",
        y_range=bounds,
        x_range=_decades(share),
    )
    limit_line(right, 100.0, vertical=True)
    marks = right.scatter(PERCENT, NAME, source=data, marker="square", size=7, color=BLUE)
    add_hover(right, marks, {"parameter": NAME, "2σ [%]": PERCENT}, digits=3)
    return [left, right]


def _decades(share: np.ndarray) -> tuple[float, float]:
    """Return whole powers of ten around some shares, and around 100 %."""
    found = share[np.isfinite(share) & (share > 0.0)]
    least, most = (found.min(), found.max()) if len(found) else (1.0, 1.0)
    return (
        float(10.0 ** np.floor(np.log10(min(least, 1.0)))),
        float(10.0 ** np.ceil(np.log10(max(most, 200.0)))),
    )
