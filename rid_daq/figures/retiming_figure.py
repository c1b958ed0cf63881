"""`retiming_figure`: a path timed to its limits: progress, phase plane, torques, limits reached."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from bokeh.models import FactorRange, GridPlot
from bokeh.plotting import figure

from rid_daq.figures.palette import BLUE, FAINT, INK, RED, SOFT, stroke
from rid_daq.figures.panel import Drawn, add_hover, add_legend, layout, limit_line, panel, source
from rid_daq.report.sections.retiming import CHANGES, RetimedWay

TIME: Final = "time [s]"
PLACE: Final = "length of the path, as time at the speed limits [s]"
SPEED: Final = "speed, as a share of them [1]"
DONE: Final = "of the path [%]"
LIMIT_REACH: Final = 1.6
ROW_PX: Final = 24


def retiming_figure(way: RetimedWay, joints: Sequence[str]) -> GridPlot:
    """Return a figure of one way from rest to rest.

    Parameters
    ----------
    way : RetimedWay
        What is drawn.
    joints : sequence of str
        The joints' names.
    """
    torque = _torques(way, joints)
    panels = [*_progress(way), _plane(way), torque, _reached(way, torque)]
    return layout("retiming", panels, panels)


def _progress(way: RetimedWay) -> list[figure]:
    """Draw how much of the path is done over time, before and now; nothing for older results."""
    if way.done is None or way.original_s is None or way.original_done is None:
        return []
    plot = panel("", TIME, DONE, height=200)
    entries: dict[str, list[Drawn]] = {}
    for word, time_s, done, color, dash in (
        ("original", way.original_s, way.original_done, SOFT, "dashed"),
        ("timed", way.time_s, way.done, INK, "solid"),
    ):
        rows = source(word, {TIME: time_s, DONE: 100.0 * np.asarray(done)})
        line = plot.line(TIME, DONE, source=rows, line_color=color, line_dash=dash, line_width=2.0)
        add_hover(plot, line, {word: TIME, "done [%]": DONE}, digits=4)
        entries[f"{word}, {time_s[-1]:.4g} s"] = [line]
    add_legend(plot, entries)
    return [plot]


def _plane(way: RetimedWay) -> figure:
    """Draw the speed over the path's length, below the limit curve."""
    limit = "limit curve [1]"
    rows = source("phase plane", {PLACE: way.place, SPEED: way.speed, limit: way.limit})
    highest = LIMIT_REACH * float(np.max(way.speed))
    plot = panel("", PLACE, SPEED, height=240, y_range=(0.0, highest))
    bound = plot.line(PLACE, limit, source=rows, line_color=RED, line_width=1.5)
    line = plot.line(PLACE, SPEED, source=rows, line_color=INK, line_width=2.0)
    add_hover(plot, line, {"length": PLACE, "speed": SPEED, "limit": limit}, along_x=True, digits=4)
    add_legend(plot, {"limit curve": [bound], "speed of the path": [line]})
    return plot


def _torques(way: RetimedWay, joints: Sequence[str]) -> figure:
    """Draw every joint's torque over its limit, with what is kept free of it."""
    columns: dict[str, object] = {TIME: way.time_s}
    for joint, share, margin in zip(joints, way.torques, way.margins, strict=True):
        middle, reach = np.asarray(share), np.asarray(margin)
        columns[_share(joint)] = middle
        columns[f"{joint} with its margin, least [1]"] = middle - reach
        columns[f"{joint} with its margin, most [1]"] = middle + reach
    for joint, torque in zip(joints, way.measured or (), strict=False):
        columns[_measured(joint)] = torque
    rows = source("torques", columns)
    plot = panel("", TIME, "torque over its limit [1]", height=240, y_range=(-1.1, 1.1))
    entries: dict[str, list[Drawn]] = {}
    for j, joint in enumerate(joints):
        color, dash = stroke(j)
        drawn: list[Drawn] = []
        if np.any(way.margins[j]):
            least, most = (f"{joint} with its margin, {word} [1]" for word in ("least", "most"))
            band = plot.varea(TIME, least, most, source=rows, fill_color=color, fill_alpha=0.2)
            drawn.append(band)
        name, shown = _share(joint), {joint: TIME, "over its limit": _share(joint)}
        if way.measured is not None:
            dash, found = "solid", _measured(joint)
            drawn.append(plot.line(TIME, found, source=rows, line_color=color, line_dash="dotted"))
            shown["as measured"] = found
        line = plot.line(TIME, name, source=rows, line_color=color, line_dash=dash, line_width=1.8)
        add_hover(plot, line, shown, digits=3)
        entries[joint] = [*drawn, line]
    for side in (-1.0, 1.0):
        limit_line(plot, side, color=RED)
    add_legend(plot, entries)
    return plot


def _share(joint: str) -> str:
    return f"{joint} [1]"


def _measured(joint: str) -> str:
    return f"{joint} as measured [1]"


def _reached(way: RetimedWay, torque: figure) -> figure:
    """Draw which limit is reached when."""
    limits = list(dict.fromkeys(part.limit for part in way.reached))
    rows = source(
        "limits reached",
        {
            "limit": [part.limit for part in way.reached],
            "begin [s]": [part.begin_s for part in way.reached],
            "end [s]": [part.end_s for part in way.reached],
        },
    )
    rows.add([FAINT if part.limit == CHANGES else BLUE for part in way.reached], "colour")
    plot = panel(
        "limits reached",
        TIME,
        "",
        height=100 + ROW_PX * len(limits),
        x_range=torque.x_range,
        y_range=FactorRange(factors=limits[::-1]),
    )
    bars = plot.hbar("limit", 0.7, "end [s]", "begin [s]", source=rows, color="colour")
    add_hover(
        plot, bars, {"limit": "limit", "from [s]": "begin [s]", "to [s]": "end [s]"}, digits=4
    )
    return plot
