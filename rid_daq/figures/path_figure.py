"""`path_figure`: a tool point's path as wanted and as driven, its deviation magnified."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

import numpy as np
from bokeh.models import ColumnDataSource, GridPlot
from bokeh.plotting import figure

from config.arrays import FloatArray
from rid_daq.figures.palette import BLUE, FAINT, INK, RED
from rid_daq.figures.panel import (
    Drawn,
    add_hover,
    add_legend,
    beside,
    layout,
    outline,
    panel,
    panel_to_scale,
    source,
)
from rid_daq.report.sections.tracking import (
    STILL_M,
    FollowedMotion,
    JointUnit,
    PathCurves,
    magnification,
)

AXES: Final = "xyz"
TIME: Final = "time [s]"
DISTANCE: Final = "distance [mm]"
LEAST_MM: Final = 1e-4
_LOOKS: Final = {"before": (RED, "dashed"), "after": (BLUE, "solid")}
Driven = Mapping[str, PathCurves]


def path_figure(motion: FollowedMotion, joints: Sequence[JointUnit]) -> GridPlot:
    """Return a figure of a path, before and after compensation where both were driven.

    The path is drawn to scale, along the base axis in which it extends least, with the deviation
    magnified: once as suits the larger one, and once as suits what is left. Below stand the tool
    point's distance from its path and the joints' errors over time.

    Parameters
    ----------
    motion : FollowedMotion
        The motion.
    joints : sequence of JointUnit
        The robot's joints.
    """
    runs = {"before": motion.drawn.before, "after": motion.drawn.after}
    driven = {word: curves for word, curves in runs.items() if curves is not None}
    tables = {word: _table(word, curves, joints) for word, curves in driven.items()}
    groups = [list(driven), ["after"]] if len(driven) > 1 else [["after"]]
    paths = [_path({word: driven[word] for word in group}) for group in groups]
    distance = panel("distance from the path", TIME, DISTANCE, height=220, y_scale="log")
    _over_time(distance, tables, DISTANCE)
    errors = []
    for joint in joints:
        plot = panel(
            f"{joint.joint}: wanted minus reached",
            TIME,
            f"error [m{joint.unit}]",
            height=180,
            x_range=distance.x_range,
        )
        _over_time(plot, tables, _error(joint))
        errors.append(plot)
    return layout("path", [beside(paths), distance, beside(errors)], [*paths, distance, *errors])


def _table(word: str, curves: PathCurves, joints: Sequence[JointUnit]) -> ColumnDataSource:
    wanted, off = np.asarray(curves.wanted_m), 1e3 * np.asarray(curves.deviation_m)
    errors = 1e3 * np.asarray(curves.joint)
    return source(
        word,
        {
            TIME: curves.time_s,
            **{f"{axis} wanted [m]": wanted[k] for k, axis in enumerate(AXES)},
            **{f"{axis} deviation [mm]": off[k] for k, axis in enumerate(AXES)},
            DISTANCE: np.maximum(1e3 * np.asarray(curves.distance_m), LEAST_MM),
            **{_error(joint): errors[k] for k, joint in enumerate(joints)},
        },
    )


def _error(joint: JointUnit) -> str:
    return f"{joint.joint} error [m{joint.unit}]"


def _over_time(plot: figure, tables: Mapping[str, ColumnDataSource], column: str) -> None:
    """Draw one column of every run over time."""
    entries: dict[str, list[Drawn]] = {}
    for word, rows in tables.items():
        color, dash = _LOOKS[word]
        line = plot.line(
            TIME, column, source=rows, line_color=color, line_dash=dash, line_width=1.5
        )
        add_hover(plot, line, {word: TIME, "error": column}, digits=4)
        entries[word] = [line]
    add_legend(plot, entries)


def _path(driven: Driven) -> figure:
    """Draw a path to scale, the deviations from it magnified by one factor."""
    wanted = np.asarray(next(iter(driven.values())).wanted_m)
    extents = np.ptp(wanted, axis=1)
    across = sorted(np.argsort(extents)[1:].tolist())
    largest = max(_largest(curves, across) for curves in driven.values())
    times = magnification(float(extents.max()), largest)
    x, y = (AXES[k] for k in across)
    plot = panel_to_scale(
        f"{' and '.join(driven)}\ndeviation drawn {times:g} times as large",
        f"{x} [m]",
        f"{y} [m]",
        height=360,
    )
    ideal = outline({"x": wanted[across[0]], "y": wanted[across[1]]})
    entries = {
        "wanted": [plot.line("x", "y", source=ideal, line_color=FAINT, line_width=5.0)],
    }
    for word, curves in driven.items():
        color, dash = _LOOKS[word]
        rows = _magnified(curves, across, times)
        line = plot.line("x", "y", source=rows, line_color=color, line_width=1.8, line_dash=dash)
        add_hover(plot, line, {word: "time", "off by [mm]": "off"}, digits=4)
        entries[word] = [line]
    _scale(plot, wanted[across], float(extents.max()), times)
    add_legend(plot, entries)
    return plot


def _magnified(curves: PathCurves, across: list[int], times: float) -> ColumnDataSource:
    wanted, off = (np.asarray(xyz)[across] for xyz in (curves.wanted_m, curves.deviation_m))
    x, y = wanted + times * off
    distance_mm = 1e3 * np.asarray(curves.distance_m)
    return outline({"x": x, "y": y, "time": curves.time_s, "off": distance_mm})


def _largest(curves: PathCurves, across: list[int]) -> float:
    return float(np.linalg.norm(np.asarray(curves.deviation_m)[across], axis=0).max())


def _scale(plot: figure, path: FloatArray, extent_m: float, times: float) -> None:
    """Draw a bar below a path that says what a length across it means."""
    if extent_m < STILL_M:
        return
    means = _round_down(0.2 * extent_m / times)
    low = float(path[1].min()) - 0.12 * extent_m
    left = float(path[0].min())
    size = f"{1e3 * means:g} mm" if means >= 1e-3 else f"{1e6 * means:g} µm"
    bar = outline(
        {
            "x": [left],
            "end": [left + times * means],
            "y": [low],
            "text": [f"{size} of deviation"],
        }
    )
    plot.segment("x", "y", "end", "y", source=bar, line_color=INK, line_width=3.0)
    plot.text(
        "end",
        "y",
        "text",
        source=bar,
        x_offset=6,
        text_baseline="middle",
        text_font_size="12px",
        text_color=INK,
    )


def _round_down(value: float) -> float:
    """Return 1, 2 or 5 times a power of ten, at most a value."""
    power = 10.0 ** np.floor(np.log10(value))
    return float(power * max(step for step in (1.0, 2.0, 5.0) if step * power <= value))
