"""`stop_figure`: what a joint did in the last second before it stopped the motion."""

from __future__ import annotations

from typing import Final

from bokeh.models import GridPlot

from rid_daq.figures.palette import BLUE, RED
from rid_daq.figures.panel import add_hover, add_legend, layout, limit_line, panel, source
from rid_daq.report.sections.stop import StopCurve

TIME: Final = "time before the stop [s]"


def stop_figure(curve: StopCurve) -> GridPlot:
    """Return a figure of the quantity that was judged, between what was allowed.

    Parameters
    ----------
    curve : StopCurve
        Of a run that was stopped.
    """
    value = f"{curve.quantity} [{curve.unit}]"
    least, most = f"least allowed [{curve.unit}]", f"most allowed [{curve.unit}]"
    rows = source(
        curve.joint, {TIME: curve.time_s, value: curve.value, least: curve.low, most: curve.high}
    )
    plot = panel(f"{curve.joint}: {curve.quantity}", TIME, value, height=280)
    bounds = [
        plot.line(TIME, name, source=rows, line_color=RED, line_dash="dashed", line_width=1.5)
        for name in (least, most)
    ]
    line = plot.line(TIME, value, source=rows, line_color=BLUE, line_width=2.2)
    limit_line(plot, 0.0, vertical=True)
    shown = {"time": TIME, curve.quantity: value, "least": least, "most": most}
    add_hover(plot, line, shown, along_x=True, digits=4)
    add_legend(plot, {curve.quantity: [line], "allowed": bounds})
    return layout("stop", [plot], [plot])
