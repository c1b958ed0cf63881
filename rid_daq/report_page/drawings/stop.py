"""The report's drawing of a stop: what a joint did in the last second before it."""

from __future__ import annotations

import matplotlib as mpl
from markupsafe import Markup
from matplotlib.figure import Figure

from rid_daq.report.sections.stop import StopCurve
from rid_daq.report_page.drawings.style import PREDICTED, STYLE, WRONG, as_label, as_svg


def stop_figure(curve: StopCurve, name: str) -> Markup:
    """Draw the quantity that was judged, between what was allowed.

    Parameters
    ----------
    curve : StopCurve
        What is drawn.
    name : str
        A word for the drawing's element names, different for every figure of a page.
    """
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 2.8), layout="constrained")
        panel = figure.subplots()
        for bound, label in ((curve.low, None), (curve.high, "allowed")):
            panel.plot(curve.time_s, bound, color=WRONG, linestyle="dashed", label=label)
        panel.plot(
            curve.time_s,
            curve.value,
            color=PREDICTED,
            linewidth=1.6,
            label=f"{as_label(curve.joint)}: {curve.quantity}",
        )
        panel.plot(curve.time_s[-1:], curve.value[-1:], "o", color=PREDICTED, markersize=5.0)
        panel.set_xlabel("time before the stop [s]")
        panel.set_ylabel(f"{curve.quantity} [{as_label(curve.unit)}]")
        panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.0)
        return as_svg(figure, name)
