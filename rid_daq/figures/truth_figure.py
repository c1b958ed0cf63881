"""`truth_figure`: how far estimates of simulated robots lie from the truth."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from bokeh.models import GridPlot
from bokeh.models.annotations import BoxAnnotation
from bokeh.plotting import figure

from rid_daq.figures.palette import BLUE, RED, SKY
from rid_daq.figures.panel import add_hover, add_legend, beside, layout, panel, source
from rid_daq.report.sections.validation import TruthCase

NUMBER: Final = "parameter number"
OFF: Final = "(estimate - truth) / σ [1]"
INSIDE: Final = 2.0
LEAST_REACH: Final = 4.0


def truth_figure(cases: Sequence[TruthCase]) -> GridPlot:
    """Return a figure of deviations in standard deviations, one panel a simulated robot.

    Parameters
    ----------
    cases : sequence of TruthCase
        One a robot.
    """
    panels = [_panel(case) for case in cases]
    return layout("truth", [beside(panels)], panels)


def _panel(case: TruthCase) -> figure:
    off = np.asarray(case.deviation_sigmas, dtype=float)
    number = np.arange(1, len(off) + 1)
    inside = np.abs(off) <= INSIDE
    reach = max(LEAST_REACH, 1.2 * float(np.max(np.abs(off), initial=0.0)))
    plot = panel(case.title, NUMBER, OFF, height=260, y_range=(-reach, reach))
    plot.add_layout(
        BoxAnnotation(bottom=-INSIDE, top=INSIDE, fill_color=SKY, fill_alpha=0.15, line_alpha=0.0)
    )
    marks = {}
    for word, kept, marker, color in (
        ("inside 2σ", inside, "circle", BLUE),
        ("outside", ~inside, "diamond", RED),
    ):
        if not kept.any():
            continue
        rows = source(f"{case.title}, {word}", {NUMBER: number[kept], OFF: off[kept]})
        dots = plot.scatter(NUMBER, OFF, source=rows, marker=marker, size=8, color=color)
        add_hover(plot, dots, {"parameter": NUMBER, "off by σ": OFF}, digits=3)
        marks[word] = [dots]
    add_legend(plot, marks)
    return plot
