"""Limits of the lateness of cycles (docs/faults.md, row 27)."""

from __future__ import annotations

import math

import pytest

from acquisition.supervision.lateness import Lateness
from acquisition.supervision.stop_reason import StopCode
from config.cell.cell import CellConfig

T = 0.008


@pytest.mark.parametrize(
    ("late_by", "stops_in"),
    [
        ([0.0] * 10, None),
        ([0.0, 1.5, 0.0] * 10, None),
        ([0.0, 0.6, 0.6, 0.6], 4),
        ([0.0, 0.6, 0.6, 0.4, 0.6, 0.6], None),
        ([0.0, 2.1], 2),
        ([0.0, math.nan], 2),
    ],
    ids=["in time", "now and then", "three in a row", "two in a row", "very late", "no number"],
)
def test_late_cycles_stop_the_motion_if_they_are_too_many_or_too_late(
    cell: CellConfig, late_by: list[float], stops_in: int | None
) -> None:
    lateness = Lateness(cell)
    reasons = [lateness.judge(periods * T) for periods in late_by]
    stops = [number for number, reason in enumerate(reasons, 1) if reason is not None]
    assert stops[:1] == ([] if stops_in is None else [stops_in])
    assert {reason.code for reason in reasons if reason is not None} <= {StopCode.LATE_CYCLE}
