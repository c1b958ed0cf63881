"""`warm_up_figure`: what friction takes in one period after the other, as motors warm up."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from bokeh.models import GridPlot

from config.arrays import FloatArray
from identification.payload.warm_up import FEWEST_PERIODS, power_change_percent
from rid_daq.figures.palette import stroke
from rid_daq.figures.panel import Drawn, add_hover, add_legend, layout, limit_line, panel, source

PERIOD: Final = "period"


def warm_up_figure(
    joint_names: Sequence[str], power_w: FloatArray, settled_percent: float
) -> GridPlot:
    """Return a figure of each joint's friction power, and of its change in a period.

    Args:
        joint_names: Base to flange.
        power_w: Shape (periods, joints). Mean mechanical power of each joint in each whole period
            [W], as `period_powers` tells it.
        settled_percent: The change of a period that counts as warm [%].
    """
    power = np.asarray(power_w, dtype=np.float64).reshape(-1, len(joint_names))
    share = 100.0 * power / np.where(power[:1] != 0.0, power[:1], np.nan)
    change = np.full_like(power, np.nan)
    for last in range(FEWEST_PERIODS, len(power) + 1):
        change[last - 1] = power_change_percent(power[:last])
    columns: dict[str, FloatArray] = {PERIOD: np.arange(1.0, len(power) + 1.0)}
    for j, joint in enumerate(joint_names):
        columns[f"{joint} friction [W]"] = power[:, j]
        columns[f"{joint} friction [% of the first period]"] = share[:, j]
        columns[f"{joint} change of a period [%]"] = change[:, j]
    data = source("warm-up", columns)
    top = panel("friction of each period", PERIOD, "friction [% of the first]", height=260)
    below = panel(
        f"change of a period, settled at {settled_percent:g} %",
        PERIOD,
        "change [%]",
        height=200,
        x_range=top.x_range,
        y_range=None if np.isfinite(change).any() else (-2 * settled_percent, 2 * settled_percent),
    )
    entries: dict[str, list[Drawn]] = {}
    for j, joint in enumerate(joint_names):
        color, dash = stroke(j)
        own = [f"{joint} friction [% of the first period]", f"{joint} change of a period [%]"]
        lines = [
            plot.line(PERIOD, name, source=data, line_color=color, line_dash=dash, line_width=2.0)
            for plot, name in zip((top, below), own, strict=True)
        ]
        dots = [
            plot.scatter(PERIOD, name, source=data, size=4, color=color)
            for plot, name in zip((top, below), own, strict=True)
        ]
        power_name = f"{joint} friction [W]"
        for plot, dot in zip((top, below), dots, strict=True):
            add_hover(
                plot,
                dot,
                {joint: PERIOD, "friction [W]": power_name, "change [%]": own[1]},
                digits=4,
            )
        entries[joint] = [*lines, *dots]
    limit_line(below, settled_percent)
    limit_line(below, -settled_percent)
    add_legend(top, entries)
    return layout("warm_up", [top, below], [top, below])
