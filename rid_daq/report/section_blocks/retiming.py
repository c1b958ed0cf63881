"""`retiming_blocks`: texts, tables and plots of a path that was retimed to its limits."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from rid_daq.blocks.block import AnyBlock, Cells, Heading, Table, Text, table
from rid_daq.blocks.plot import Axis, Colour, Dash, Line, Numbers, Panel, Plot, Span
from rid_daq.report.driven_timing_entry import DrivenTiming
from rid_daq.report.sections.retiming import CHANGES, RetimedJoint, RetimedWay, RetimingSection

LIMIT_REACH: Final = 1.6
"""Height of the phase plane relative to the largest speed."""


def retiming_blocks(section: RetimingSection) -> Iterator[AnyBlock]:
    """Yield the duration, the largest values of joints and base, and the plots."""
    yield Heading(text="Retimed path")
    yield Text(text=section.sentence)
    made = f"Computed from {section.motion} and {section.model}"
    cycle_ms, averaged_ms = 1e3 * section.cycle_s, 1e3 * section.averaged_s
    times = f"cycles of {cycle_ms:.3g} ms; smoothed by averages over at most {averaged_ms:.3g} ms"
    free = f"; {100.0 * section.margin:.2g} % of each torque and base wrench limit are kept free"
    yield Text(text=f"{made} for {times}{free if section.margin else ''}.", is_note=True)
    yield _joint_table(section)
    if section.base:
        yield _base_table(section)
    if section.driven is not None:
        yield from _driven_blocks(section.driven, section.joints)
    for number, way in enumerate(section.ways, start=1):
        if len(section.ways) > 1:
            yield Heading(text=f"Part {number}, from rest to rest", level=3)
        yield way_plot(way, [joint.joint for joint in section.joints])


def _joint_table(section: RetimingSection) -> Table:
    return table(
        section.joints,
        Cells("joint", lambda joint: joint.joint),
        Cells("unit", lambda joint: joint.unit),
        Cells("torque limit", lambda joint: joint.torque_limit),
        Cells("largest torque", lambda joint: joint.torque_peak),
        Cells("its margin", lambda joint: joint.torque_margin, digits=2),
        Cells("RMS torque", lambda joint: joint.torque_rms, digits=3),
        Cells("speed / limit", lambda joint: 100.0 * joint.speed_share, "%", 3),
        Cells("acceleration / limit", lambda joint: 100.0 * joint.acceleration_share, "%", 3),
    )


def _base_table(section: RetimingSection) -> Table:
    return table(
        section.base or (),
        Cells("base wrench", lambda base: base.component),
        Cells("unit", lambda base: "N" if base.component.startswith("F") else "N m"),
        Cells("limit", lambda base: base.limit),
        Cells("largest", lambda base: base.peak),
        Cells("its margin", lambda base: base.margin, digits=2),
    )


def _driven_blocks(driven: DrivenTiming, joints: Sequence[RetimedJoint]) -> Iterator[AnyBlock]:
    before, after = driven.before, driven.after
    yield Heading(text="Measured on the robot", level=3)
    yield Text(text=driven.sentence)
    rows: list[tuple[str, str, float, float]] = [
        ("duration of the motion", "s", before.moving_s, after.moving_s)
    ]
    for j, joint in enumerate(joints):
        shares = (100.0 * before.torque_share[j], 100.0 * after.torque_share[j])
        rows.append((f"largest torque of {joint.joint} / limit", "%", *shares))
    for c, name in enumerate(driven.components):
        peaks = (before.base_peak[c], after.base_peak[c])
        first, second = (100.0 * peak / driven.limit[c] for peak in peaks)
        rows.append((f"largest {name} of the base wrench / limit", "%", first, second))
    for word, key in (("mean", "mean_m"), ("largest", "max_m")):
        first, second = (1e3 * getattr(each, key) for each in (before, after))
        rows.append((f"{word} distance from the path, at the motor encoders", "mm", first, second))
    yield table(
        rows,
        Cells("measured", lambda row: row[0]),
        Cells("unit", lambda row: row[1]),
        Cells("before", lambda row: row[2], digits=3),
        Cells("after", lambda row: row[3], digits=3),
    )


def way_plot(way: RetimedWay, joints: Sequence[str]) -> Plot:
    """Return progress, phase plane, torques and active limits.

    Args:
        joints: Names of the joints.
    """
    band = "The band is the margin for the uncertainty of the model."
    dotted = "" if way.measured is None else " Dotted: measured torques."
    return Plot(
        name="retiming",
        panels=(_progress(way), _plane(way), _torques(way, joints), _limits(way)),
        caption=f"Torques predicted by the model. {band}{dotted}",
    )


def _progress(way: RetimedWay) -> Panel:
    return Panel(
        x=Axis("time", "s"),
        y=Axis("completed path", "%", least=0.0, most=102.0),
        lines=(
            _progress_line("original", way.original_s, way.original_done, "soft", "dashed"),
            _progress_line("retimed", way.time_s, way.done, "ink", "solid"),
        ),
        height_px=200,
    )


def _progress_line(word: str, time_s: Numbers, done: Numbers, stroke: Colour, dash: Dash) -> Line:
    percent = tuple(100.0 * share for share in done)
    return Line(f"{word}, {time_s[-1]:.4g} s", time_s, percent, stroke, dash=dash)


def _plane(way: RetimedWay) -> Panel:
    return Panel(
        x=Axis("length of the path (time at the speed limits)", "s"),
        y=Axis("speed / speed limit", least=0.0, most=LIMIT_REACH * max(way.speed)),
        lines=(
            Line("limit curve", way.place, way.limit, "red"),
            Line("speed of the path", way.place, way.speed, "ink"),
        ),
    )


def _torques(way: RetimedWay, joints: Sequence[str]) -> Panel:
    lines = []
    for j, (joint, share, margin) in enumerate(zip(joints, way.torques, way.margins, strict=True)):
        dash: Dash | None = None if way.measured is None else "solid"
        lines.append(Line(joint, way.time_s, share, j, dash=dash, reach=margin))
        if way.measured is not None:
            lines.append(
                Line(
                    f"{joint}, measured",
                    way.time_s,
                    way.measured[j],
                    j,
                    dash="dotted",
                    width=1.0,
                    is_named=False,
                )
            )
    return Panel(
        x=Axis("time", "s"),
        y=Axis("torque / limit", least=-1.1, most=1.1),
        lines=tuple(lines),
        limits=(-1.0, 1.0),
    )


def _limits(way: RetimedWay) -> Panel:
    return Panel(
        x=Axis("time", "s"),
        y=Axis("active limit"),
        spans=tuple(
            Span(
                part.limit,
                part.begin_s,
                part.end_s,
                colour="faint" if part.limit == CHANGES else "blue",
            )
            for part in way.reached
        ),
        zooms_with_previous=True,
    )
