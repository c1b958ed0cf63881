"""The picture of a path timed to its limits: phase plane, torques over time, limits reached."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rid_daq.figures.palette import FAINT, SOFT, stroke
from rid_daq.report.sections.retiming import CHANGES, RetimedWay
from rid_daq.report.sections.section import Numbers
from rid_daq.report_page.drawings.curves import MEASURED, STYLE, WRONG, as_label, as_svg

_DASHES: Any = {"dotdash": "dashdot"}
LIMIT_REACH = 1.6


class _Line(NamedTuple):
    """How far along a path a motion is over time."""

    name: str
    time_s: Numbers
    done: Numbers
    colour: str
    style: str


def retiming_figure(way: RetimedWay, joints: Sequence[str], name: str) -> Markup:
    """Draw one way from rest to rest.

    Parameters
    ----------
    way : RetimedWay
        What is drawn.
    joints : sequence of str
        The joints' names.
    name : str
        A word for the drawing's element names, different for every figure of a page.
    """
    limits = list(dict.fromkeys(part.limit for part in way.reached))
    with mpl.rc_context(STYLE):
        lines = _lines(way)
        heights = [1.6] * bool(lines) + [2.0, 2.0, 0.3 + 0.2 * len(limits)]
        figure = Figure(figsize=(9.6, 1.3 + sum(heights)), layout="constrained")
        *before, plane, torque, reached = figure.subplots(len(heights), 1, height_ratios=heights)
        for panel in before:
            _against_the_original(panel, lines)
        place, speed = np.asarray(way.place), np.asarray(way.speed)
        plane.plot(place, np.asarray(way.limit), color=WRONG, label="limit curve")
        plane.plot(place, speed, color=MEASURED, linewidth=1.4, label="speed of the path")
        plane.set_ylim(0.0, LIMIT_REACH * float(speed.max()))
        plane.set_xlim(float(place[0]), float(place[-1]))
        plane.set_xlabel("length of the path, as time at the speed limits [s]")
        plane.set_ylabel("speed, as a share of them")
        plane.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.0)
        time_s = np.asarray(way.time_s)
        for j, joint in enumerate(joints):
            share, open_too = np.asarray(way.torques[j]), np.asarray(way.margins[j])
            colour, dash = stroke(j)
            if open_too.any():
                torque.fill_between(
                    time_s, share - open_too, share + open_too, color=colour, alpha=0.2, linewidth=0
                )
            torque.plot(
                time_s,
                share,
                color=colour,
                linestyle=_DASHES.get(dash, dash) if way.measured is None else "solid",
                label=as_label(joint),
            )
            if way.measured is not None:
                torque.plot(
                    time_s, way.measured[j], color=colour, linewidth=0.8, linestyle="dotted"
                )
        for side in (-1.0, 1.0):
            torque.axhline(side, color=WRONG, linewidth=0.8)
        torque.set_ylim(-1.1, 1.1)
        torque.set_ylabel("torque over its limit")
        torque.legend(
            loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=len(joints), borderaxespad=0.0
        )
        for part in way.reached:
            colour = FAINT if part.limit == CHANGES else MEASURED
            row = limits.index(part.limit)
            reached.broken_barh(
                [(part.begin_s, part.end_s - part.begin_s)], (row - 0.4, 0.8), color=colour
            )
        reached.set_yticks(range(len(limits)), [as_label(limit) for limit in limits])
        reached.set_ylim(len(limits) - 0.5, -0.5)
        reached.set_xlabel("time [s]")
        for panel in (torque, reached):
            panel.set_xlim(0.0, float(time_s[-1]))
        return as_svg(figure, name)


def _lines(way: RetimedWay) -> list[_Line]:
    """Return how far along its path the motion is over time, before and now."""
    if way.done is None or way.original_s is None or way.original_done is None:
        return []
    return [
        _Line("original", way.original_s, way.original_done, SOFT, "dashed"),
        _Line("timed", way.time_s, way.done, MEASURED, "solid"),
    ]


def _against_the_original(panel: Axes, lines: Sequence[_Line]) -> None:
    for line in lines:
        panel.plot(
            np.asarray(line.time_s),
            100.0 * np.asarray(line.done),
            color=line.colour,
            linestyle=line.style,
            linewidth=1.4,
            label=f"{line.name}, {line.time_s[-1]:.4g} s",
        )
    panel.set_xlim(0.0, max(line.time_s[-1] for line in lines))
    panel.set_ylim(0.0, 102.0)
    panel.set_xlabel("time [s]")
    panel.set_ylabel("of the path [%]")
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.0)
