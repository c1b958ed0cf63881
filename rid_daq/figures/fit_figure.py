"""`fit_figure`: measured torque over predicted torque, joint by joint, and what is left."""

from __future__ import annotations

from typing import Final

import numpy as np
from bokeh.models import GridPlot, Range1d
from bokeh.plotting import figure

from rid_daq.figures.palette import FAINT, INK, ORANGE, RED
from rid_daq.figures.panel import Drawn, add_hover, add_legend, layout, limit_line, panel, source
from rid_daq.report.sections.curves import TorqueCurve, TorqueCurves

TIME: Final = "time [s]"
RESIDUAL_SHARE: Final = 1.2


def fit_figure(curves: TorqueCurves) -> GridPlot:
    """Return a figure of measured and predicted torque, all joints zoomed together in time.

    Prediction is a wide line, the measurement a thin one on it; the residual has a panel of its
    own, as high as what counts. What does not count (standstill, friction
    that is not known yet) is drawn pale.

    Parameters
    ----------
    curves : TorqueCurves
        Of a validation, or of the mean period that a model was fitted to.
    """
    panels: list[figure] = []
    for axis in curves.axes:
        panels += _panels(axis, curves, panels[0].x_range if panels else None)
    return layout("fit", panels, panels)


def _panels(axis: TorqueCurve, curves: TorqueCurves, time: object) -> list[figure]:
    measured, predicted = np.asarray(axis.measured), np.asarray(axis.predicted)
    counted = np.asarray(axis.counted, dtype=bool)
    left = measured - predicted
    unit, joint = axis.unit, axis.joint
    names = [f"{joint} {word} [{unit}]" for word in ("measured", "predicted", "residual")]
    still, pale = f"{joint} predicted, not counted [{unit}]", f"{joint} residual there [{unit}]"
    rows = source(
        joint,
        {
            TIME: curves.time_s,
            names[0]: measured,
            names[1]: np.where(counted, predicted, np.nan),
            names[2]: np.where(counted, left, np.nan),
            still: np.where(counted, np.nan, predicted),
            pale: np.where(counted, np.nan, left),
        },
    )
    top = panel(f"{joint}\n{axis.caption}", "", f"torque [{unit}]", height=230, x_range=time)
    below = panel("", TIME, f"residual [{unit}]", height=150, x_range=top.x_range)
    top.xaxis.visible = False
    entries: dict[str, list[Drawn]] = {
        "predicted": [top.line(TIME, names[1], source=rows, line_color=ORANGE, line_width=4.5)]
    }
    if not counted.all():
        entries["not counted"] = [
            top.line(TIME, still, source=rows, line_color=FAINT, line_width=4.5),
            below.line(TIME, pale, source=rows, line_color=FAINT, line_width=1.2),
        ]
    line = top.line(TIME, names[0], source=rows, line_color=INK, line_width=1.2)
    entries = {"measured": [line], **entries}
    below.line(TIME, names[2], source=rows, line_color=RED, line_width=1.2)
    limit_line(below, 0.0)
    reach = RESIDUAL_SHARE * float(np.max(np.abs(left[counted]), initial=0.0))
    if reach > 0.0:
        below.y_range = Range1d(start=-reach, end=reach)
    shown = {"time": TIME, "measured": names[0], "predicted": names[1], "residual": names[2]}
    add_hover(top, line, shown, along_x=True)
    add_legend(top, entries)
    return [top, below]
