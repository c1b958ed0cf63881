"""Cycle times in microseconds, and their coding in a drive's object 60C2h."""

from __future__ import annotations

import pytest
from pydantic import TypeAdapter, ValidationError

from config.cell.cycle_time import (
    CycleTimeMs,
    as_milliseconds,
    interpolation_period,
    nearest_periods,
)
from config.load import load_cell, to_yaml

CYCLE = TypeAdapter(CycleTimeMs)


@pytest.mark.parametrize("given", [8, 8.0])
def test_whole_milliseconds_stay_whole(given: float) -> None:
    found = CYCLE.validate_python(given, strict=True)
    assert (found, type(found)) == (8, int)
    assert CYCLE.dump_json(found) == b"8"


def test_a_file_is_written_as_it_was_read() -> None:
    assert "cycle_time_ms: 8\n" in to_yaml(load_cell("ir361").config)
    cell = load_cell("ir361").config.model_copy(update={"cycle_time_ms": 6.667})
    assert "cycle_time_ms: 6.667\n" in to_yaml(cell)
    assert cell.cycle_time_s == pytest.approx(0.006667, abs=1e-15)


@pytest.mark.parametrize("given", [8.0005, 0.5, 100.5, "8", True])
def test_other_cycle_times_are_refused(given: object) -> None:
    with pytest.raises(ValidationError):
        CYCLE.validate_python(given, strict=True)


@pytest.mark.parametrize(
    ("cycle_ms", "period"),
    [
        (1, (1, -3)),
        (12, (12, -3)),
        (6.7, (67, -4)),
        (2.5, (25, -4)),
        (1.25, (125, -5)),
        (25.5, (255, -4)),
        (6.667, None),
        (30.5, None),
    ],
)
def test_a_drive_gets_eight_bits_and_a_power_of_ten(
    cycle_ms: float, period: tuple[int, int] | None
) -> None:
    assert interpolation_period(cycle_ms) == period
    if period is not None:
        mantissa, power = period
        assert mantissa * 10.0**power == pytest.approx(1e-3 * cycle_ms)


@pytest.mark.parametrize("cycle_ms", [1.003, 6.667, 25.45, 25.6, 30.5, 99.9])
def test_the_proposed_cycle_times_can_be_written(cycle_ms: float) -> None:
    below, above = nearest_periods(cycle_ms)
    assert below < cycle_ms < above
    assert interpolation_period(below) is not None
    assert interpolation_period(above) is not None


@pytest.mark.parametrize(
    ("cycle_ms", "nearest"), [(25.55, (25.5, 26)), (2.542, (2.54, 2.55)), (2.551, (2.55, 2.6))]
)
def test_no_nearer_cycle_time_can_be_written(cycle_ms: float, nearest: tuple[float, float]) -> None:
    assert nearest_periods(cycle_ms) == nearest


@pytest.mark.parametrize(("period_s", "cycle_ms"), [(0.008, 8), (0.006667, 6.667), (0.0067, 6.7)])
def test_a_period_is_stated_in_microseconds(period_s: float, cycle_ms: float) -> None:
    assert as_milliseconds(period_s) == cycle_ms
