"""`average_blocks`: the averaged periods of a run and their noise."""

from __future__ import annotations

from collections.abc import Iterator

from rid_daq.blocks.block import AnyBlock, Cells, Heading, Text, table
from rid_daq.report.sections.average import AverageSection


def average_blocks(section: AverageSection) -> Iterator[AnyBlock]:
    """Yield averaged and rejected periods, and the noise of one sample."""
    yield Heading(text="Periods")
    yield Text(text=section.sentence)
    if section.rejected:
        yield table(
            section.rejected,
            Cells("rejected period", lambda period: period.index + 1),
            Cells("reason", lambda period: period.reason),
        )
    else:
        yield Text(text="No period was rejected.")
    yield table(
        section.axes,
        Cells("joint", lambda axis: axis.joint),
        Cells("torque noise of one sample", lambda axis: axis.torque_noise, digits=3),
        Cells("unit", lambda axis: axis.torque_unit),
        Cells("position noise of one sample", lambda axis: axis.position_noise, digits=3),
        Cells("unit", lambda axis: axis.unit),
    )
