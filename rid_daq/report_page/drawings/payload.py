"""The report's drawing of a payload: where its centre of gravity lies at the flange."""

from __future__ import annotations

from typing import Any, Final

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

from rid_daq.figures.centre_of_gravity import CentreOfGravity, ellipse
from rid_daq.figures.palette import BLUE, GREEN, INK, RED, SKY
from rid_daq.report.sections.payload import PayloadSection
from rid_daq.report_page.drawings.curves import STYLE, as_svg

AXES: Final = "xyz"
VIEWS: Final = ((0, 2), (1, 2), (0, 1))
AXIS_SHARE: Final = 0.3
LEAST_MM: Final = 50.0
_COLOURS: Final = (RED, GREEN, BLUE)


def centre_figure(section: PayloadSection, name: str) -> Markup:
    """Draw the centre of gravity along each axis of the flange, to scale, with its interval.

    Around it lies the ellipsoid of even density that has the payload's mass and inertia, where all
    parameters are seen: the payload is at least about as large.

    Parameters
    ----------
    section : PayloadSection
        The payload.
    name : str
        A word for the drawing's element names, different for every figure of a page.
    """
    drawn = CentreOfGravity.of_section(section)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 3.7), layout="constrained")
        named: dict[str, Any] = {}
        for panel, across in zip(figure.subplots(1, len(VIEWS)), VIEWS, strict=True):
            named |= _view(panel, drawn, list(across))
        figure.legend(named.values(), named.keys(), loc="outside upper left", ncols=2)
        return as_svg(figure, name)


def _view(panel: Axes, drawn: CentreOfGravity, pair: list[int]) -> dict[str, Any]:
    """Draw the view along the third axis; return what the legend names."""
    named: dict[str, Any] = {}
    centre, reach = drawn.centre_mm[pair], 2.0 * drawn.sigma_mm[pair]
    length = AXIS_SHARE * max(LEAST_MM, float(np.linalg.norm(np.nan_to_num(centre))))
    if np.isfinite(centre).all():
        if drawn.spread_mm2 is not None:
            edge = ellipse(centre, drawn.spread_mm2[np.ix_(pair, pair)])
            shape = Polygon(edge.T, facecolor=SKY, edgecolor="none", alpha=0.2)
            named["even density"] = panel.add_artist(shape)  # the view may cut it off
        bars: Any = {"fmt": "o", "color": INK, "markersize": 4.5, "capsize": 3.0, "zorder": 3}
        dot = panel.errorbar(centre[:1], centre[1:], yerr=reach[1:], xerr=reach[:1], **bars)
        named = {"centre ± 2σ": dot, **named}
    for place, k in enumerate(pair):
        tip = [0.0, 0.0]
        tip[place] = length
        panel.plot((0.0, tip[0]), (0.0, tip[1]), color=_COLOURS[k], linewidth=2.0)
        panel.annotate(
            AXES[k],
            (tip[0], tip[1]),
            (3.0, 3.0),
            textcoords="offset points",
            color=_COLOURS[k],
            fontweight="bold",
        )
    panel.plot([0.0], [0.0], "o", color=INK, markersize=5.0, markerfacecolor="none")
    panel.set_aspect("equal", adjustable="datalim")
    panel.margins(0.3)
    told = [_told(AXES[k], drawn.centre_mm[k], drawn.sigma_mm[k]) for k in pair]
    panel.set_title("\n".join(told), fontsize=9.0)
    panel.set_xlabel(f"{AXES[pair[0]]} of the flange [mm]")
    panel.set_ylabel(f"{AXES[pair[1]]} of the flange [mm]")
    return named


def _told(axis: str, centre_mm: float, sigma_mm: float) -> str:
    if not np.isfinite(centre_mm):
        return f"{axis} not shown by the motion"
    return f"{axis} {centre_mm:.1f} ± {2.0 * sigma_mm:.1f} mm (2σ)"
