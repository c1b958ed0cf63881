"""`history_figure`: one quantity of many runs over the days: drift of a robot, a plate, a drive."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import Final

import numpy as np
from bokeh.models import GridPlot

from config.errors import ConfigError
from rid_daq.figures.palette import INK, SKY, SOFT
from rid_daq.figures.panel import add_hover, add_legend, layout, panel, source

WHEN: Final = "milliseconds since 1970"


@dataclass(frozen=True)
class PastValue:
    """A quantity of one run.

    Attributes:
        run_id, label: Of which run.
        when: With its time zone.
        value, two_sigma: The estimate and its interval; `two_sigma` is 0 where it is not known.
    """

    run_id: str
    label: str
    when: datetime
    value: float
    two_sigma: float = 0.0

    def __post_init__(self) -> None:
        if self.when.tzinfo is None:
            raise ConfigError(
                f"run {self.run_id}: its time has no time zone", code="RID-INTERNAL-ERROR"
            )
        if not (math.isfinite(self.value) and math.isfinite(self.two_sigma)):
            raise ConfigError(
                f"run {self.run_id}: its value is not a finite number", code="RID-INTERNAL-ERROR"
            )


def history_figure(quantity: str, unit: str, values: Sequence[PastValue]) -> GridPlot:
    """Return a figure of a quantity run by run, with intervals.

    Args:
        quantity, unit: What it is, such as "Coulomb friction of axis2", and its unit.
        values: In any order.
    """
    ordered = sorted(values, key=lambda each: each.when)
    value, low, high = (f"{quantity}{part} [{unit}]" for part in ("", " - 2σ", " + 2σ"))
    size = np.array([each.value for each in ordered])
    reach = np.array([each.two_sigma for each in ordered])
    data = source(
        quantity,
        {
            "run": [each.run_id for each in ordered],
            "label": [each.label for each in ordered],
            "time": [each.when.isoformat(timespec="seconds") for each in ordered],
            value: size,
            low: size - reach,
            high: size + reach,
        },
    )
    data.add([1e3 * each.when.timestamp() for each in ordered], WHEN)
    plot = panel(quantity, "", f"{quantity} [{unit}]", height=280, x_scale="datetime")
    plot.line(WHEN, value, source=data, line_color=SKY, line_width=1.5)
    bars = plot.segment(WHEN, low, WHEN, high, source=data, line_color=SOFT, line_width=2.5)
    dots = plot.scatter(WHEN, value, source=data, size=8, color=INK)
    shown = {"run": "run", "label": "label", "time": "time", quantity: value}
    add_hover(plot, dots, shown | {"- 2σ": low, "+ 2σ": high})
    add_legend(plot, {"estimate": [dots], "± 2σ": [bars]})
    return layout("history", [plot], [plot])
