"""`lateness_figure`: how late the cycles of a run began, as a histogram."""

from __future__ import annotations

from typing import Final

import numpy as np
from bokeh.models import FactorRange, GridPlot

from rid_daq.figures.palette import BLUE
from rid_daq.figures.panel import add_hover, layout, panel, source
from rid_daq.report.sections.timing import LoopTiming, bin_names

LATENESS: Final = "lateness"
CYCLES: Final = "cycles"
LEAST: Final = 0.5


def lateness_figure(timing: LoopTiming) -> GridPlot:
    """Return a figure of cycles by how late they began, counts on a logarithmic scale.

    Parameters
    ----------
    timing : LoopTiming
        Of one run.
    """
    counts = np.asarray(timing.counts, dtype=float)
    names = bin_names(timing.edges_us)
    rows = source(
        timing.role, {LATENESS: names, CYCLES: counts, "from": np.full(len(names), LEAST)}
    )
    plot = panel(
        timing.role,
        "lateness of the cycle [µs]",
        "cycles [1]",
        height=240,
        x_range=FactorRange(factors=names),
        y_range=(LEAST, 4.0 * max(1.0, float(counts.max(initial=0.0)))),
        y_scale="log",
    )
    plot.xaxis.major_label_orientation = 0.6
    bars = plot.vbar(LATENESS, 0.8, CYCLES, LEAST, source=rows, color=BLUE)
    add_hover(plot, bars, {LATENESS: LATENESS, CYCLES: CYCLES}, digits=9)
    return layout("lateness", [plot], [plot])
