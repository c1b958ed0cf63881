"""`validation_blocks`: the torque errors of a model on a run that was not used for its fit."""

from __future__ import annotations

from collections.abc import Iterator

from rid_daq.blocks.block import AnyBlock, Cells, Heading, Table, Text, table
from rid_daq.report.section_blocks.verdict import doubt_texts, yes_or_no
from rid_daq.report.sections.validation import AxisError, ValidationSection


def validation_blocks(section: ValidationSection) -> Iterator[AnyBlock]:
    """Yield the errors of each axis, the reasons for poor grades, and the diagnosis."""
    yield Heading(text="Predicted and measured torque")
    yield Text(text=section.sentence)
    yield _errors(section)
    yield from doubt_texts(section.axes)
    for finding in section.diagnosis or ():
        yield Text(text=finding)


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
