"""`tracking_blocks`: texts, tables and plots of the path errors before and after compensation."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from rid_daq.blocks.block import AnyBlock, Cells, Heading, Table, Text, table
from rid_daq.blocks.formats import number
from rid_daq.blocks.plot import Axis, Colour, Dash, Line, Mark, Panel, Plot
from rid_daq.report.elastic_path_entry import ElasticPathSection
from rid_daq.report.sections.tracking import (
    STILL_M,
    ErrorSize,
    FollowedMotion,
    JointUnit,
    PathCurves,
    TrackingSection,
    magnification,
)
from rid_daq.report.tool_error_entries import ToolSideSize

AXES: Final = "xyz"
LEAST_MM: Final = 1e-4
_LOOKS: Final[Mapping[str, tuple[Colour, Dash]]] = {
    "before": ("red", "dashed"),
    "after": ("blue", "solid"),
}


def tracking_blocks(section: TrackingSection) -> Iterator[AnyBlock]:
    """Yield the path errors of tool and joints, the deflection, and the plots."""
    yield Heading(text="Path errors")
    yield Text(text=section.sentence)
    yield Text(text=section.unseen)
    yield _distances(section.motions)
    streamed = any(motion.use == "streamed" for motion in section.motions)
    yield Text(
        text='"Own runs" states whether runs of this motion were used for its feedforward: never'
        " used, tuned on it, or refined from run to run."
        + (" Streamed: compensated online while the set-points arrived." if streamed else ""),
        is_note=True,
    )
    if section.tool_side:
        yield from _tool_side_blocks(section.tool_side)
        if section.contradiction:
            yield Text(text=section.contradiction)
    yield _joint_errors(section)
    yield Text(text="Largest error of each joint.", is_note=True)
    if section.with_stiffness:
        yield _deflections(section.motions)
        yield Text(
            text=f"Tool side, estimated from the deflection of the gears of"
            f" {', '.join(section.with_stiffness)}. The distances above are those of the motors:"
            " they do not contain this deflection. The tool's distance from its path is as good as"
            " the model and the stiffness; only a measurement of the tool proves it.",
            is_note=True,
        )
    for order, motion in enumerate(section.motions, start=1):
        yield Heading(text=f"{order}: {motion.sentence}", level=3)
        yield from path_plots(motion, section.joints)


def elastic_path_blocks(section: ElasticPathSection) -> Iterator[AnyBlock]:
    """Yield the errors of the tool without and with correction of the deflection."""
    yield Heading(text="Elastic gears")
    yield Text(text=section.words)
    bent = ", ".join(number(1e3 * each, 3) for each in section.largest_deflection)
    yield Text(
        text=f"The corrected motion contains deflections of the gears of up to {bent} mrad, which"
        " the encoders at the motors do not measure."
    )
    runs = (section.rigid, section.corrected)
    yield table(
        range(len(runs)),
        Cells("feedforward", lambda n: ("rigid gears", "corrected deflection")[n]),
        Cells("mean at the motors", lambda n: _mm(runs[n], "motor_mean_m"), "mm", 3),
        Cells("tool, estimated, mean", lambda n: _mm(runs[n].estimated, "tool_mean_m"), "mm", 3),
        Cells("largest", lambda n: _mm(runs[n].estimated, "tool_max_m"), "mm", 3),
        Cells("tool, measured, mean", lambda n: _mm(runs[n], "measured_mean_m"), "mm", 3),
        Cells("largest", lambda n: _mm(runs[n], "measured_max_m"), "mm", 3),
    )
    yield Text(
        text="The estimate is computed from the encoders, the model and the known stiffness. Clock"
        " and frame of the tracker are fitted to the path, so a shift or rotation of the whole path"
        " is not visible; noise and wrong lengths in the robot file are.",
        is_note=True,
    )


def _tool_side_blocks(sizes: Sequence[ToolSideSize]) -> Iterator[AnyBlock]:
    yield table(
        sizes,
        Cells("run", lambda size: size.run),
        Cells("tracker file", lambda size: size.file),
        Cells("rows", lambda size: size.rows),
        Cells("measured part", lambda size: 100.0 * size.share, "%", 3),
        Cells("mean at the motors", lambda size: 1e3 * size.motor_mean_m, "mm", 3),
        Cells("mean at the tool", lambda size: 1e3 * size.mean_m, "mm", 3),
        Cells("largest at the tool", lambda size: 1e3 * size.max_m, "mm", 3),
        Cells("clock offset", lambda size: f"{size.clock_offset_s:.4f}", "s"),
        Cells("clock rate", lambda size: size.clock_ppm, "ppm", 2, is_optional=True),
    )
    yield Text(
        text="At the tool: distance of the point that the instrument measured from the desired"
        " point, noise of the instrument included. Clock and frame of the instrument are fitted to"
        " the path by the motor encoders. Therefore a constant delay along the path, and a shift"
        " or rotation of the whole path, are not visible.",
        is_note=True,
    )


def _distances(motions: Sequence[FollowedMotion]) -> Table:
    return table(
        range(len(motions)),
        Cells("#", lambda n: n + 1),
        Cells("motion", lambda n: motions[n].sentence),
        Cells("own runs", lambda n: motions[n].use),
        Cells("mean before", lambda n: _mm(motions[n].before, "mean_m"), "mm", 3),
        Cells("mean after", lambda n: _mm(motions[n].after, "mean_m"), "mm", 3),
        Cells("reduction factor", lambda n: motions[n].mean_ratio, digits=3),
        Cells("largest before", lambda n: _mm(motions[n].before, "max_m"), "mm", 3),
        Cells("largest after", lambda n: _mm(motions[n].after, "max_m"), "mm", 3),
        Cells("reduction factor", lambda n: motions[n].max_ratio, digits=3),
    )


def _mm(size: object, key: str) -> float | None:
    value = None if size is None else getattr(size, key)
    return None if value is None else 1e3 * float(value)


def _joint_errors(section: TrackingSection) -> Table:
    def peaks(j: int, joint: JointUnit) -> Iterator[Cells[int]]:
        def peak(size: ErrorSize | None) -> float | None:
            return None if size is None else 1e3 * size.joint_peak[j]

        unit = f"m{joint.unit}"
        yield Cells(f"{joint.joint} before", lambda n: peak(section.motions[n].before), unit, 3)
        yield Cells("after", lambda n: peak(section.motions[n].after), unit, 3)

    columns = [cells for j, joint in enumerate(section.joints) for cells in peaks(j, joint)]
    return table(range(len(section.motions)), Cells("#", lambda n: n + 1), *columns)


def _deflections(motions: Sequence[FollowedMotion]) -> Table:
    def bent(size: ErrorSize | None, key: str) -> float | None:
        return None if size is None else _mm(size.bending, key)

    return table(
        range(len(motions)),
        Cells("#", lambda n: n + 1),
        Cells("deflection before, RMS", lambda n: bent(motions[n].before, "rms_m"), "mm", 2),
        Cells("largest", lambda n: bent(motions[n].before, "max_m"), "mm", 2),
        Cells("deflection after, RMS", lambda n: bent(motions[n].after, "rms_m"), "mm", 2),
        Cells("largest", lambda n: bent(motions[n].after, "max_m"), "mm", 2),
        Cells("tool before, mean", lambda n: bent(motions[n].before, "tool_mean_m"), "mm", 2),
        Cells("tool after, mean", lambda n: bent(motions[n].after, "tool_mean_m"), "mm", 2),
        Cells("largest", lambda n: bent(motions[n].after, "tool_max_m"), "mm", 2),
    )


def path_plots(motion: FollowedMotion, joints: Sequence[JointUnit]) -> tuple[Plot, ...]:
    """Return the plots of a motion: its path, the distance from it, and the errors over time.

    Args:
        joints: The joints of the robot.
    """
    runs = {"before": motion.drawn.before, "after": motion.drawn.after}
    driven = {word: curves for word, curves in runs.items() if curves is not None}
    sights = [driven, {"after": driven["after"]}] if len(driven) > 1 else [driven]
    return (
        Plot(
            name="path",
            panels=tuple(map(_path, sights)),
            caption="View along the base axis in which the path extends least, to scale; only the"
            " deviation is magnified. Of a periodic motion, the last period is drawn.",
            columns=len(sights),
        ),
        Plot(name="distance", panels=(_distance(driven),)),
        Plot(
            name="errors",
            panels=(
                *(_deviation(driven, k) for k in range(len(AXES))),
                *(_joint_error(driven, k, joint) for k, joint in enumerate(joints)),
            ),
            caption="Joint errors: desired minus reached position. Tool errors: reached minus"
            " desired position.",
            columns=len(AXES),
        ),
    )


def _path(driven: Mapping[str, PathCurves]) -> Panel:
    wanted = np.asarray(driven["after"].wanted_m, dtype=float)
    extents = np.ptp(wanted, axis=1)
    across, up = sorted(np.argsort(extents)[1:].tolist())
    pair, extent = [across, up], float(extents.max())
    off = {word: np.asarray(each.deviation_m, dtype=float)[pair] for word, each in driven.items()}
    largest = max(float(np.linalg.norm(each, axis=0).max()) for each in off.values())
    times = magnification(extent, largest)
    paths = {
        word: np.asarray(each.wanted_m, dtype=float)[pair] + times * off[word]
        for word, each in driven.items()
    }
    lines = [
        Line("desired", wanted[across].tolist(), wanted[up].tolist(), "faint", width=3.2),
        *(_line(word, path[0].tolist(), path[1].tolist()) for word, path in paths.items()),
    ]
    bar, mark = _scale_bar(np.hstack([wanted[pair], *paths.values()]), extent, times)
    return Panel(
        x=Axis(AXES[across], "m"),
        y=Axis(AXES[up], "m"),
        lines=(*lines, *bar),
        marks=mark,
        height_px=400,
        is_to_scale=True,
        title=f"deviation magnified {times:g} times",
    )


def _scale_bar(
    points: np.ndarray[tuple[int, ...], np.dtype[np.float64]], extent_m: float, times: float
) -> tuple[tuple[Line, ...], tuple[Mark, ...]]:
    """Return a scale bar below the path, and the true deviation that the bar represents."""
    if extent_m < STILL_M:
        return (), ()
    length = 0.12 * extent_m / times
    power = 10.0 ** math.floor(math.log10(length))
    length = power * max(step for step in (1.0, 2.0, 5.0) if step * power <= length)
    left, low = float(points[0].min()), float(points[1].min()) - 0.09 * extent_m
    right = left + times * length
    size = f"{1e3 * length:g} mm" if length >= 1e-3 else f"{1e6 * length:g} µm"
    bar = Line("scale", (left, right), (low, low), "ink", width=2.6, is_named=False)
    return (bar,), (Mark(right, low, f"{size} of deviation"),)


def _line(word: str, x: Sequence[float], y: Sequence[float]) -> Line:
    colour, dash = _LOOKS[word]
    return Line(word, tuple(x), tuple(y), colour, dash=dash, width=1.5)


def _distance(driven: Mapping[str, PathCurves]) -> Panel:
    return Panel(
        x=Axis("time", "s"),
        y=Axis("distance", "mm", log=True),
        lines=tuple(
            _line(word, each.time_s, [max(1e3 * value, LEAST_MM) for value in each.distance_m])
            for word, each in driven.items()
        ),
        height_px=220,
    )


def _deviation(driven: Mapping[str, PathCurves], axis: int) -> Panel:
    return Panel(
        x=Axis("time", "s"),
        y=Axis("path error", "mm"),
        lines=tuple(
            _line(word, each.time_s, [1e3 * value for value in each.deviation_m[axis]])
            for word, each in driven.items()
        ),
        height_px=180,
        title=f"{AXES[axis]}, base frame",
    )


def _joint_error(driven: Mapping[str, PathCurves], k: int, joint: JointUnit) -> Panel:
    return Panel(
        x=Axis("time", "s"),
        y=Axis("joint error", f"m{joint.unit}"),
        lines=tuple(
            _line(word, each.time_s, [1e3 * value for value in each.joint[k]])
            for word, each in driven.items()
        ),
        height_px=180,
        title=joint.joint,
    )
