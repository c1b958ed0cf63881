"""`validation_blocks`: the torque errors of a model on a run that it was not identified from."""

from __future__ import annotations

from collections.abc import Iterator

from rid_daq.blocks.block import AnyBlock, Cell, Column, Heading, Table, Text
from rid_daq.report.sections.validation import AxisError, ValidationSection
from rid_daq.report.shown.verdict import doubt_texts


def validation_blocks(section: ValidationSection) -> Iterator[AnyBlock]:
    """Yield the errors axis by axis, what makes a fit doubtful, and the diagnosis.

    Args:
        section: The errors.
    """
    yield Heading(text="Predicted against measured torque")
    yield Text(text=section.sentence)
    yield _errors(section)
    yield from doubt_texts(section.axes)
    for finding in section.diagnosis or ():
        yield Text(text=finding)


def _errors(section: ValidationSection) -> Table:
    columns = [
        Column(title="axis", is_text=True),
        Column(title="unit", is_text=True),
        Column(title="RMS torque"),
        Column(title="RMS error"),
        Column(title="relative error", unit="%", digits=3),
    ]
    if section.has_noise:
        columns += [Column(title="noise", digits=3), Column(title="error / noise", digits=2)]
    if section.has_floor:
        columns += [Column(title="floor (truth)"), Column(title="error / floor", digits=3)]
    if section.has_limits:
        columns += [
            Column(title="limit", unit="%"),
            Column(title="holds", is_text=True),
            Column(title="fit", is_text=True),
        ]
    columns.append(Column(title="samples"))
    return Table(
        columns=tuple(columns),
        rows=tuple(_row(axis, section) for axis in section.axes),
        failed=tuple(axis.passed is False for axis in section.axes),
    )


def _row(axis: AxisError, section: ValidationSection) -> tuple[Cell, ...]:
    row: list[Cell] = [
        axis.joint,
        axis.unit,
        axis.rms_torque,
        axis.rms_error,
        axis.relative_error_percent,
    ]
    if section.has_noise:
        row += [axis.noise, axis.over_noise]
    if section.has_floor:
        row += [axis.floor, axis.error_over_floor]
    if section.has_limits:
        row += [
            axis.limit_percent,
            {None: "–", True: "yes", False: "NO"}[axis.passed],
            axis.grade or "–",
        ]
    return (*row, axis.samples)
