"""`BLOCKS_BY_SECTION`: the function that makes the blocks of each section."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final

from rid_daq.blocks.block import AnyBlock
from rid_daq.report.section_blocks.average import average_blocks
from rid_daq.report.section_blocks.curves import curves_blocks
from rid_daq.report.section_blocks.estimate import estimate_blocks
from rid_daq.report.section_blocks.friction import friction_blocks
from rid_daq.report.section_blocks.friction_choice import friction_choice_blocks
from rid_daq.report.section_blocks.gears import gear_blocks
from rid_daq.report.section_blocks.loop_timing import timing_blocks
from rid_daq.report.section_blocks.payload import payload_blocks
from rid_daq.report.section_blocks.plate import (
    base_load_blocks,
    plate_blocks,
    plate_zero_blocks,
    reaction_blocks,
)
from rid_daq.report.section_blocks.retiming import retiming_blocks
from rid_daq.report.section_blocks.runs import runs_blocks
from rid_daq.report.section_blocks.tracking import elastic_path_blocks, tracking_blocks
from rid_daq.report.section_blocks.validation import truth_blocks, validation_blocks
from rid_daq.report.section_blocks.velocity_loops import loop_blocks

BLOCKS_BY_SECTION: Final[dict[str, Callable[[Any], Iterator[AnyBlock]]]] = {
    "average": average_blocks,
    "base_load": base_load_blocks,
    "comparison": friction_choice_blocks,
    "curves": curves_blocks,
    "elastic_path": elastic_path_blocks,
    "estimate": estimate_blocks,
    "friction": friction_blocks,
    "gears": gear_blocks,
    "payload": payload_blocks,
    "plate": plate_blocks,
    "plate_zero": plate_zero_blocks,
    "reaction": reaction_blocks,
    "retiming": retiming_blocks,
    "runs": runs_blocks,
    "timing": timing_blocks,
    "truth": truth_blocks,
    "validation": validation_blocks,
    "tracking": tracking_blocks,
    "velocity_loops": loop_blocks,
}
"""Functions that return the blocks of a section, by the section's name."""
