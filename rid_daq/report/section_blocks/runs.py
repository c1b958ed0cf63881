"""`runs_blocks`: the runs of a result, and the quantity that stopped a run, in its last second."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rid_daq.blocks.block import AnyBlock, Cells, Heading, Table, Text, Verdict, table
from rid_daq.blocks.plot import Axis, Colour, Dash, Line, Numbers, Panel, Plot
from rid_daq.report.section_blocks.curves import traces_plot
from rid_daq.report.sections.runs import BadRows, RunSection
from rid_daq.report.sections.stop import StopCurve


def runs_blocks(section: Sequence[RunSection]) -> Iterator[AnyBlock]:
    """Yield each run, its stop reason, the extremes of each axis, and rows that are left out."""
    yield Heading(text="Runs")
    for run in section:
        yield Heading(text=run.role, level=3)
        yield Text(text=run.sentence)
        if run.imported:
            yield Verdict(passed=None, text=run.imported)
        if run.stop:
            yield Verdict(passed=False, text=run.stop)
        if run.stop_curve is not None:
            yield Text(text=run.stop_curve.caption, is_note=True)
            yield stop_plot(run.stop_curve)
        if run.axes:
            yield _extremes(run)
        if run.traces is not None:
            yield traces_plot(run.traces)
        for finding in run.findings or ():
            yield Verdict(passed=False, text=f"{finding}.")
        if run.left_out:
            reasons = ", ".join(f"{count} {reason}" for reason, count in run.left_out.items())
            yield Text(text=f"Left out: {reasons}.")
        if run.bad_rows:
            yield _bad_rows(run.bad_rows)


def _extremes(run: RunSection) -> Table:
    return table(
        run.axes,
        Cells("axis", lambda axis: axis.joint),
        Cells("unit", lambda axis: axis.unit),
        Cells("lowest position", lambda axis: axis.position_min, digits=3),
        Cells("highest position", lambda axis: axis.position_max, digits=3),
        Cells("max speed per s", lambda axis: axis.max_velocity, digits=3),
        Cells("max following error", lambda axis: axis.max_following_error, digits=3),
        Cells("unit", lambda axis: axis.torque_unit),
        Cells("max torque", lambda axis: axis.max_torque, digits=3),
        Cells("max torque / limit", lambda axis: axis.max_torque_percent, "%", 3),
    )


def _bad_rows(bad_rows: Sequence[BadRows]) -> Table:
    return table(
        bad_rows,
        Cells("rows left out", lambda rows: rows.rows),
        Cells("count", lambda rows: rows.count),
        Cells("reason", lambda rows: rows.reason),
    )


def stop_plot(curve: StopCurve) -> Plot:
    """Return a plot of the last second of the quantity that stopped a motion, with its limits."""
    lines: tuple[tuple[str, Numbers, Colour, Dash], ...] = (
        ("lowest allowed", curve.low, "red", "dashed"),
        ("highest allowed", curve.high, "red", "dashed"),
        (curve.quantity, curve.value, "blue", "solid"),
    )
    panel = Panel(
        title=f"{curve.joint}: {curve.quantity}",
        x=Axis("time before the stop", "s"),
        y=Axis(curve.quantity, curve.unit),
        lines=tuple(
            Line(label, curve.time_s, values, stroke, dash=dash)
            for label, values, stroke, dash in lines
        ),
        height_px=280,
    )
    return Plot(name="stop", panels=(panel,))
