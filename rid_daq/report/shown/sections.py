"""`SHOWN`: the function that gives the blocks of each section."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Final

from rid_daq.blocks.block import AnyBlock
from rid_daq.report.shown.average import average_blocks
from rid_daq.report.shown.curves import curves_blocks
from rid_daq.report.shown.estimate import estimate_blocks
from rid_daq.report.shown.friction import friction_blocks
from rid_daq.report.shown.friction_choice import friction_choice_blocks
from rid_daq.report.shown.loop_timing import timing_blocks
from rid_daq.report.shown.payload import payload_blocks
from rid_daq.report.shown.plate import (
    base_load_blocks,
    plate_blocks,
    plate_zero_blocks,
    reaction_blocks,
)
from rid_daq.report.shown.retiming import retiming_blocks
from rid_daq.report.shown.runs import runs_blocks
from rid_daq.report.shown.tracking import tracking_blocks
from rid_daq.report.shown.truth import truth_blocks
from rid_daq.report.shown.validation import validation_blocks
from rid_daq.report.shown.velocity_loops import loop_blocks

SHOWN: Final[dict[str, Callable[[Any], Iterator[AnyBlock]]]] = {
    "average": average_blocks,
    "base_load": base_load_blocks,
    "comparison": friction_choice_blocks,
    "curves": curves_blocks,
    "estimate": estimate_blocks,
    "friction": friction_blocks,
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
"""By the name of the section."""
