"""`validation_blocks`: the torque errors of a model on a run that was not used for its fit.

`truth_blocks`: estimates of simulated robots compared with their true parameters.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from rid_daq.blocks.block import AnyBlock, Cells, Heading, Table, Text, table
from rid_daq.blocks.plot import Axis, Colour, Line, Marker, Panel, Plot
from rid_daq.report.section_blocks.verdict import doubt_texts, yes_or_no
from rid_daq.report.sections.validation import AxisError, RunErrors, TruthCase, ValidationSection

INSIDE: Final = 2.0
LEAST_REACH: Final = 4.0


def validation_blocks(section: ValidationSection) -> Iterator[AnyBlock]:
    """Yield the errors of each axis, the reasons for poor grades, and the diagnosis."""
    yield Heading(text="Predicted and measured torque")
    yield Text(text=section.sentence)
    yield _errors(section)
    yield from doubt_texts(section.axes)
    for finding in section.diagnosis or ():
        yield Text(text=finding)


def run_errors_table(runs: Sequence[RunErrors]) -> Table:
    """Return the errors of several runs, one line for each run and axis."""
    return table(
        [(run.run, axis) for run in runs for axis in run.axes],
        Cells("run", lambda line: line[0]),
        Cells("axis", lambda line: line[1].joint),
        Cells("unit", lambda line: line[1].unit),
        Cells("RMS torque", lambda line: line[1].rms_torque),
        Cells("RMS error", lambda line: line[1].rms_error),
        Cells("relative error", lambda line: line[1].relative_error_percent, "%", 3),
        Cells("samples", lambda line: line[1].samples),
    )


def _errors(section: ValidationSection) -> Table:
    columns: list[Cells[AxisError]] = [
        Cells("axis", lambda axis: axis.joint),
        Cells("unit", lambda axis: axis.unit),
        Cells("RMS torque", lambda axis: axis.rms_torque),
        Cells("RMS error", lambda axis: axis.rms_error),
        Cells("relative error", lambda axis: axis.relative_error_percent, "%", 3),
    ]
    if section.has_noise:
        columns.extend(
            [
                Cells("noise", lambda axis: axis.noise, digits=3),
                Cells("error / noise", lambda axis: axis.over_noise, digits=2),
            ]
        )
    if section.has_floor:
        columns.extend(
            [
                Cells("floor (truth)", lambda axis: axis.floor),
                Cells("error / floor", lambda axis: axis.error_over_floor, digits=3),
            ]
        )
    if section.has_limits:
        columns.extend(
            [
                Cells("limit", lambda axis: axis.limit_percent, "%"),
                Cells("holds", lambda axis: yes_or_no(axis.passed)),
                Cells("fit", lambda axis: axis.grade or "–"),
            ]
        )
    return table(
        section.axes,
        *columns,
        Cells("samples", lambda axis: axis.samples),
        failed=lambda axis: axis.passed is False,
    )


def truth_blocks(cases: Sequence[TruthCase]) -> Iterator[AnyBlock]:
    """Yield the number of parameters inside their intervals, and the deviation of each.

    Args:
        cases: One entry per simulated robot.
    """
    yield Heading(text="Estimated and true parameters", level=3)
    for case in cases:
        yield Text(text=case.sentence)
    yield truth_plot(cases)


def truth_plot(cases: Sequence[TruthCase]) -> Plot:
    """Return the deviations in standard deviations, one panel per simulated robot.

    Args:
        cases: One entry per simulated robot.
    """
    panels = tuple(_panel(case) for case in cases)
    return Plot(name="truth", panels=panels, columns=max(2, len(panels)))


def _panel(case: TruthCase) -> Panel:
    numbered = list(enumerate(map(float, case.deviation_sigmas), start=1))
    reach = max([LEAST_REACH, *(1.2 * abs(value) for _, value in numbered)])
    kinds: tuple[tuple[str, bool, Colour, Marker], ...] = (
        ("inside 2σ", True, "blue", "circle"),
        ("outside", False, "red", "diamond"),
    )
    lines = []
    for label, is_inside, colour, marker in kinds:
        own = [(i, value) for i, value in numbered if (abs(value) <= INSIDE) is is_inside]
        if own:
            lines.append(
                Line(
                    label,
                    tuple(float(i) for i, _ in own),
                    tuple(value for _, value in own),
                    colour,
                    points=True,
                    marker=marker,
                )
            )
    return Panel(
        title=case.title,
        x=Axis("parameter number", counts=True),
        y=Axis("(estimate - truth) / σ", least=-reach, most=reach),
        lines=tuple(lines),
        limits=(-INSIDE, INSIDE),
    )
