"""The report's figures of paths: drawn to scale, with the deviation magnified, and over time."""

from __future__ import annotations

import math
from collections.abc import Sequence

import matplotlib as mpl
import numpy as np
from markupsafe import Markup
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from rid_daq.figures.palette import FAINT
from rid_daq.report.sections.tracking import (
    STILL_M,
    DrawnPaths,
    JointUnit,
    PathCurves,
    magnification,
)
from rid_daq.report_page.drawings.curves import MEASURED, PREDICTED, STYLE, WRONG, as_label, as_svg

AXES = "xyz"


def path_figure(drawn: DrawnPaths, name: str) -> Markup:
    """Draw a path to scale with the deviation from it magnified, before and after.

    Left both at the magnification that suits the larger error, right what is left at one of its
    own. The view is along the base axis in which the path extends least.

    Parameters
    ----------
    drawn : DrawnPaths
        The path with compensation and, where there is such a run, without.
    name : str
        A word for the drawing's element names, different for every figure of a page.
    """
    after, before = drawn.after, drawn.before
    wanted = np.asarray(after.wanted_m, dtype=float)
    extents = np.ptp(wanted, axis=1)
    across = sorted(np.argsort(extents)[1:].tolist())
    sights = [[("after", after, PREDICTED)]]
    if before is not None:
        sights.insert(0, [("before", before, WRONG), ("after", after, PREDICTED)])
    high = float(np.clip(4.4 * extents[across[1]] / max(extents[across[0]], STILL_M), 2.4, 4.8))
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 0.9 + high), layout="constrained")
        panels = figure.subplots(1, len(sights), squeeze=False).ravel()
        for panel, lines in zip(panels, sights, strict=True):
            largest = max(_largest(line[1], across) for line in lines)
            times = magnification(float(extents.max()), largest)
            panel.plot(*wanted[across], color=FAINT, linewidth=2.4, label="wanted")
            for label, curve, color in lines:
                path, off = (np.asarray(xyz)[across] for xyz in (curve.wanted_m, curve.deviation_m))
                panel.plot(*(path + times * off), color=color, linewidth=1.1, label=label)
            _scale(panel, float(extents.max()), times)
            panel.set_title(f"deviation drawn {times:g} times as large", fontsize=9.0)
            panel.set_xlabel(f"{AXES[across[0]]} [m]")
            panel.set_ylabel(f"{AXES[across[1]]} [m]")
            panel.legend(loc="upper right", fontsize=7.5, ncols=1)
        return as_svg(figure, name)


def error_figure(drawn: DrawnPaths, joints: Sequence[JointUnit], name: str) -> Markup:
    """Draw the tool point's distance from its path, and the errors of axes and joints over time.

    Parameters
    ----------
    drawn : DrawnPaths
        As for `path_figure`.
    joints : sequence of JointUnit
        The robot's joints.
    name : str
        A word for the drawing's element names, different for every figure of a page.
    """
    both = (("before", drawn.before), ("after", drawn.after))
    lines = [(label, curve) for label, curve in both if curve is not None]
    colors = {"before": WRONG, "after": PREDICTED}
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(9.6, 6.0), layout="constrained")
        top, middle, bottom = figure.subfigures(3, 1, squeeze=False)[:, 0]
        panel = top.subplots()
        for label, curve in lines:
            distance = 1e3 * np.maximum(np.asarray(curve.distance_m), 1e-7)
            panel.semilogy(curve.time_s, distance, color=colors[label], label=label)
        panel.set_ylabel("distance [mm]")
        panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderaxespad=0.0)
        panel.set_xlim(0.0, max(curve.time_s[-1] for _, curve in lines))
        base = [(f"{axis}, base frame", "path error [mm]") for axis in AXES]
        own = [
            (as_label(joint.joint), f"joint error [m{as_label(joint.unit)}]") for joint in joints
        ]
        for part, titles in ((middle, base), (bottom, own)):
            panels = part.subplots(1, len(titles), squeeze=False).ravel()
            for k, (panel, (title, words)) in enumerate(zip(panels, titles, strict=True)):
                for label, curve in lines:
                    errors = curve.joint if part is bottom else curve.deviation_m
                    values = 1e3 * np.asarray(errors[k])
                    panel.plot(curve.time_s, values, color=colors[label], linewidth=0.9)
                panel.set_title(title, fontsize=9.0)
                if k == 0:
                    panel.set_ylabel(words)
                if part is bottom:
                    panel.set_xlabel("time [s]")
        return as_svg(figure, name)


def _largest(curve: PathCurves, across: list[int]) -> float:
    return float(np.linalg.norm(np.asarray(curve.deviation_m)[across], axis=0).max())


def _scale(panel: Axes, extent_m: float, times: float) -> None:
    """Draw to scale, with a bar below a path that says what a length across it means."""
    panel.set_aspect("equal", adjustable="datalim")
    if extent_m < STILL_M:
        return
    means = 0.12 * extent_m / times
    power = 10.0 ** math.floor(math.log10(means))
    means = power * max(step for step in (1.0, 2.0, 5.0) if step * power <= means)
    left, low = panel.dataLim.x0, panel.dataLim.y0 - 0.09 * extent_m
    panel.plot([left, left + times * means], [low, low], color=MEASURED, linewidth=2.0)
    size = f"{1e3 * means:g} mm" if means >= 1e-3 else f"{1e6 * means:g} µm"
    panel.annotate(
        f"{size} of deviation",
        (left + times * means, low),
        (5.0, 0.0),
        textcoords="offset points",
        fontsize=7.5,
        va="center",
    )
