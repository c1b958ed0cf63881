"""`average_blocks`: the periods of a run and their noise."""

from __future__ import annotations

from collections.abc import Iterator

from rid_daq.blocks.block import AnyBlock, Column, Heading, Table, Text
from rid_daq.report.sections.average import AverageSection


def average_blocks(section: AverageSection) -> Iterator[AnyBlock]:
    """Yield which periods were averaged, and the noise of one sample.

    Args:
        section: The averaged periods.
    """
    yield Heading(text="Periods")
    yield Text(text=section.sentence)
    if section.rejected:
        yield Table(
            columns=(
                Column(title="rejected period"),
                Column(title="reason", is_text=True),
            ),
            rows=tuple((period.index + 1, period.reason) for period in section.rejected),
        )
    else:
        yield Text(text="No period was rejected.")
    yield Table(
        columns=(
            Column(title="joint", is_text=True),
            Column(title="torque noise of one sample", digits=3),
            Column(title="unit", is_text=True),
            Column(title="position noise of one sample", digits=3),
            Column(title="unit", is_text=True),
        ),
        rows=tuple(
            (axis.joint, axis.torque_noise, axis.torque_unit, axis.position_noise, axis.unit)
            for axis in section.axes
        ),
    )
