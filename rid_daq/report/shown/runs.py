"""`runs_blocks`: the runs of a result, and the curve of a joint that stopped one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rid_daq.blocks.block import AnyBlock, Column, Heading, Table, Text, Verdict
from rid_daq.blocks.plot import Axis, Colour, Dash, Line, Numbers, Panel, Plot
from rid_daq.report.sections.runs import BadRows, RunSection
from rid_daq.report.sections.stop import StopCurve


def runs_blocks(section: Sequence[RunSection]) -> Iterator[AnyBlock]:
    """Yield what was run, why it stopped, the extremes of each axis, and rows that are left out.

    Args:
        section: The runs.
    """
    yield Heading(text="What was run")
    for run in section:
        yield Heading(text=run.role, level=3)
        yield Text(text=run.sentence)
        if run.stop:
            yield Verdict(passed=False, text=run.stop)
        if run.stop_curve is not None:
            yield Text(text=run.stop_curve.caption, is_note=True)
            yield stop_plot(run.stop_curve)
        if run.axes:
            yield _extremes(run)
        for finding in run.findings or ():
            yield Verdict(passed=False, text=f"{finding}.")
        if run.left_out:
            reasons = ", ".join(f"{count} {reason}" for reason, count in run.left_out.items())
            yield Text(text=f"Left out: {reasons}.")
        if run.bad_rows:
            yield _bad_rows(run.bad_rows)


def _extremes(run: RunSection) -> Table:
    return Table(
        columns=(
            Column(title="axis", is_text=True),
            Column(title="unit", is_text=True),
            Column(title="lowest position", digits=3),
            Column(title="highest position", digits=3),
            Column(title="max speed per s", digits=3),
            Column(title="max following error", digits=3),
            Column(title="unit", is_text=True),
            Column(title="max torque", digits=3),
            Column(title="of its limit", unit="%", digits=3),
        ),
        rows=tuple(
            (
                axis.joint,
                axis.unit,
                axis.position_min,
                axis.position_max,
                axis.max_velocity,
                axis.max_following_error,
                axis.torque_unit,
                axis.max_torque,
                axis.max_torque_percent,
            )
            for axis in run.axes
        ),
    )


def _bad_rows(bad_rows: Sequence[BadRows]) -> Table:
    return Table(
        columns=(
            Column(title="rows left out", is_text=True),
            Column(title="count"),
            Column(title="reason", is_text=True),
        ),
        rows=tuple((rows.rows, rows.count, rows.reason) for rows in bad_rows),
    )


def stop_plot(curve: StopCurve) -> Plot:
    """Return the judged quantity in the last second before a stop, and its limits.

    Args:
        curve: The curve of the joint that stopped the motion.
    """
    lines: tuple[tuple[str, Numbers, Colour, Dash], ...] = (
        ("least allowed", curve.low, "red", "dashed"),
        ("most allowed", curve.high, "red", "dashed"),
        (curve.quantity, curve.value, "blue", "solid"),
    )
    panel = Panel(
        title=f"{curve.joint}: {curve.quantity}",
        x=Axis(label="time before the stop", unit="s"),
        y=Axis(label=curve.quantity, unit=curve.unit),
        lines=tuple(
            Line(label=label, x=curve.time_s, y=values, stroke=stroke, dash=dash)
            for label, values, stroke, dash in lines
        ),
        height_px=280,
    )
    return Plot(name="stop", panels=(panel,))
