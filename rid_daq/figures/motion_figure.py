"""`motion_figure`: a planned motion against the robot's limits, and the tool's way in the cell."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np
from bokeh.models import ColumnDataSource, GridPlot
from bokeh.plotting import figure

from acquisition.motion.samples import MotionSamples, Phase
from config.arrays import FloatArray
from config.robot.bodies import Workspace
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain, forward
from rid_daq.figures.palette import BLUE, FAINT, INK, RED, SOFT, stroke
from rid_daq.figures.panel import (
    Drawn,
    add_hover,
    add_legend,
    beside,
    layout,
    limit_line,
    outline,
    panel,
    panel_to_scale,
    source,
    thinned,
)
from rid_daq.report.sections.section import units

TIME: Final = "time [s]"
AXES: Final = "xyz"
VIEWS: Final = ((0, 1), (0, 2), (1, 2))


@dataclass(frozen=True, eq=False)
class _Quantity:
    """One quantity of all joints: its values, their units, their share of the limit [%], a note."""

    name: str
    title: str
    of: str
    values: FloatArray
    units: tuple[str, ...]
    percent: FloatArray
    note: str = ""

    @property
    def peak(self) -> float:
        """The largest share [%]."""
        return float(np.abs(self.percent).max(initial=0.0))


def motion_figure(
    samples: MotionSamples,
    robot: RobotDescription,
    workspace: Workspace,
    torque_nm: FloatArray | None = None,
    condition_number: float | None = None,
    torque_note: str = "",
) -> GridPlot:
    """Return a figure of positions, speeds, accelerations and torques against their limits.

    Every quantity is drawn in percent of its limit, so that all joints share a panel: 100 % is
    the limit, and for positions ±100 % are the two ends of the range. Below, the tool's path is
    seen along each axis of the base, with the boxes of the workspace. A periodic motion is drawn
    with one of its periods.

    Args:
        samples: The motion as planned.
        robot: The limits.
        workspace: The cell's walls and boxes.
        torque_nm: Shape (rows of `samples.whole(1)`, joints). The torque that a model expects [N m
            or N].
        condition_number: Of an excitation.
        torque_note: How warm the model's friction was taken to be.
    """
    one = samples.whole(most_periods=1)
    quantities = _quantities(one, robot, torque_nm, torque_note)
    rows = thinned(len(one.position))
    time_s = one.sample_period_s * np.arange(len(one.position))
    columns: dict[str, object] = {TIME: time_s[rows]}
    for each in quantities:
        for j, joint in enumerate(robot.joint_names):
            columns[f"{joint} {each.name} [{each.units[j]}]"] = each.values[rows, j]
            columns[f"{joint} {each.name} [% of {each.of}]"] = each.percent[rows, j]
    data = source("motion", columns)
    over_time: list[figure] = []
    for each in quantities:
        time = over_time[0].x_range if over_time else None
        over_time.append(_over_time(each, robot, data, time, condition_number))
    views = _views(one, robot, workspace, rows)
    return layout("motion", [*over_time, beside(views)], [*over_time, *views])


def _quantities(
    samples: MotionSamples,
    robot: RobotDescription,
    torque_nm: FloatArray | None,
    torque_note: str,
) -> list[_Quantity]:
    limits = [joint.limits for joint in robot.joints]
    low, high = (
        np.array([getattr(limit, f"position_{end}") for limit in limits]) for end in ("min", "max")
    )
    unit, torque_unit = zip(*(units(joint) for joint in robot.joints), strict=True)
    found = [
        _Quantity(
            "position",
            "positions in their ranges",
            "range",
            samples.position,
            unit,
            100.0 * (2.0 * (samples.position - low) / (high - low) - 1.0),
        )
    ]
    rates = [
        ("speed", "speeds", samples.velocity, "velocity", tuple(f"{u}/s" for u in unit)),
        (
            "acceleration",
            "accelerations",
            samples.acceleration,
            "acceleration",
            tuple(f"{u}/s²" for u in unit),
        ),
    ]
    if torque_nm is not None:
        rates.append(("torque", "torques", torque_nm, "torque", torque_unit))
    for name, title, values, key, own in rates:
        limit = np.array([getattr(each, key) for each in limits])
        note = torque_note if name == "torque" else ""
        found.append(_Quantity(name, title, "limit", values, own, 100.0 * values / limit, note))
    return found


def _over_time(
    quantity: _Quantity,
    robot: RobotDescription,
    data: ColumnDataSource,
    time: object,
    condition_number: float | None,
) -> figure:
    first = time is None
    title = f"{quantity.title}: {quantity.peak:.0f} % of the {quantity.of} at most"
    if first and condition_number is not None:
        title += f"\ncondition number {condition_number:.4g}"
    if quantity.note:
        title += f"\n{quantity.note}"
    plot = panel(
        title,
        TIME,
        f"{quantity.name} [% of {quantity.of}]",
        height=250 if first else 200,
        x_range=time,
        y_range=(-108.0, 108.0) if quantity.peak <= 100.0 else None,
    )
    for end in (-100.0, 100.0):
        limit_line(plot, end, color=RED)
    entries: dict[str, list[Drawn]] = {}
    for j, joint in enumerate(robot.joint_names):
        color, dash = stroke(j)
        real = f"{joint} {quantity.name} [{quantity.units[j]}]"
        share = f"{joint} {quantity.name} [% of {quantity.of}]"
        line = plot.line(TIME, share, source=data, line_color=color, line_dash=dash, line_width=1.8)
        shown = {joint: TIME, f"{quantity.name} [{quantity.units[j]}]": real, "[%]": share}
        add_hover(plot, line, shown, digits=4)
        entries[joint] = [line]
    if first:
        add_legend(plot, entries)
    return plot


def _views(
    samples: MotionSamples, robot: RobotDescription, workspace: Workspace, rows: slice
) -> list[figure]:
    """Draw the tool's path along each axis of the base."""
    tool = forward(Chain.from_description(robot), samples.position[rows])
    main = (samples.phase[rows] == Phase.MAIN)[:, np.newaxis]
    time_s = samples.sample_period_s * np.arange(len(samples.position))[rows]
    columns: dict[str, object] = {TIME: time_s}
    for k, axis in enumerate(AXES):
        columns[f"tool {axis} [m]"] = tool[:, k]
        columns[f"tool {axis} in the main part [m]"] = np.where(main, tool, np.nan)[:, k]
    data = source("tool", columns)
    views = []
    for x, y in ((AXES[i], AXES[j]) for i, j in VIEWS):
        plot = panel_to_scale(
            f"tool's path, {x} and {y}",
            f"{x} of the base [m]",
            f"{y} of the base [m]",
            height=320,
        )
        whole = plot.line(
            f"tool {x} [m]", f"tool {y} [m]", source=data, line_color=FAINT, line_width=4.0
        )
        part = plot.line(
            f"tool {x} in the main part [m]",
            f"tool {y} in the main part [m]",
            source=data,
            line_color=BLUE,
            line_width=2.0,
        )
        places = {"tool at": TIME, **{axis: f"tool {axis} [m]" for axis in AXES}}
        add_hover(plot, whole, places, digits=4)
        entries: dict[str, list[Drawn]] = {"whole motion": [whole], "main part": [part]}
        boxes = _boxes(plot, workspace, (AXES.index(x), AXES.index(y)))
        base = outline({"x": [0.0], "y": [0.0]})
        entries["base"] = [
            plot.scatter(
                "x", "y", source=base, marker="square_cross", size=11, line_color=INK, fill_alpha=0
            )
        ]
        add_legend(plot, entries | boxes)
        views.append(plot)
    return views


def _boxes(plot: figure, workspace: Workspace, across: tuple[int, int]) -> dict[str, list[Drawn]]:
    """Draw what of the workspace is a rectangle in this view: red to keep out of, grey to stay in.

    Walls and floors that stand across the view are lines.
    """
    i, j = across
    drawn: dict[str, list[Drawn]] = {}
    for box in workspace.boxes:
        color, word = (RED, "keep out") if box.keep == "out" else (SOFT, "stay in")
        corners = outline(
            {
                "left": [box.min_m[i]],
                "right": [box.max_m[i]],
                "bottom": [box.min_m[j]],
                "top": [box.max_m[j]],
            }
        )
        rectangle = plot.quad(
            "left",
            "right",
            "top",
            "bottom",
            source=corners,
            fill_color=color,
            fill_alpha=0.08,
            line_color=color,
            line_width=1.5,
        )
        drawn.setdefault(word, []).append(rectangle)
    for wall in workspace.planes:
        for axis, vertical in ((i, True), (j, False)):
            if abs(wall.normal[axis]) > 1.0 - 1e-6:
                limit_line(plot, wall.offset_m / wall.normal[axis], vertical=vertical, color=RED)
    return drawn
