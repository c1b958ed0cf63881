"""The periods of a recording that is read in parts are the same as those of the whole recording."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np
import pytest

from acquisition.motion.samples import Phase
from acquisition.processing.period_table import PeriodCutter, cut_periods, running_sum
from acquisition.processing.periods import PeriodAverage, average_periods, average_table
from acquisition.recording.recording import Recording
from config.errors import DataQualityError
from tests.builders.raised_codes import raises_code

K = 50
RUN_IN = 7
PERIODS = 6


@pytest.fixture
def recording() -> Recording:
    """A run-in of 7 rows, 6 periods and a run-out of 11 rows; two answers are lost."""
    random = np.random.default_rng(2)
    rows = RUN_IN + PERIODS * K + 11
    turns = 2.0 * np.pi * (np.arange(rows) - RUN_IN) / K
    clean = np.stack([np.sin(turns), np.cos(turns)], axis=1)
    answered = np.ones((rows, 2), dtype=bool)
    answered[RUN_IN + 3, 0] = answered[RUN_IN + 2 * K + 9, 1] = False
    return Recording(
        joint_names=("a", "b"),
        time_s=np.arange(rows, dtype=np.float64) * 0.01,
        position=clean + 1e-3 * random.normal(size=clean.shape),
        torque_nm=7.0 * clean + random.normal(size=clean.shape),
        valid=np.asarray(answered.all(axis=1)),
        phase=np.repeat(
            np.array([Phase.RUN_IN, Phase.MAIN, Phase.RUN_OUT], dtype=np.uint8),
            [RUN_IN, PERIODS * K, 11],
        ),
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=0.01,
        samples_per_period=K,
        temperature_k=300.0 + random.normal(size=clean.shape),
        answered=answered,
    )


def remove_rows(recording: Recording, gone: list[int]) -> Recording:
    keep = np.delete(np.arange(len(recording)), gone)
    columns = ("time_s", "position", "torque_nm", "valid", "phase", "sample_index")
    more = ("temperature_k", "answered")
    return replace(recording, **{name: getattr(recording, name)[keep] for name in columns + more})


def split_rows(recording: Recording, rows: int) -> Iterator[Recording]:
    for first in range(0, len(recording), rows):
        yield recording.part(slice(first, first + rows))


def average_parts(recording: Recording, rows: int) -> PeriodAverage:
    cutter = PeriodCutter()
    for part in split_rows(recording, rows):
        cutter.add(part)
    return average_table(cutter.table())


@pytest.mark.parametrize("rows", [1, 13, K, 1000])
@pytest.mark.parametrize(
    "gone", [[], [RUN_IN], [RUN_IN - 1, RUN_IN + PERIODS * K], [RUN_IN, RUN_IN + 1]]
)
def test_the_average_of_parts_equals_that_of_the_whole_bit_by_bit(
    recording: Recording, rows: int, gone: list[int]
) -> None:
    whole = average_periods(remove_rows(recording, gone))
    parts = average_parts(remove_rows(recording, gone), rows)
    for field in fields(whole):
        one, other = getattr(whole, field.name), getattr(parts, field.name)
        if isinstance(one, np.ndarray):
            assert one.tobytes() == other.tobytes(), field.name
        else:
            assert one == other


def test_a_part_alone_is_cut_at_the_given_start(recording: Recording) -> None:
    begin = RUN_IN + 2 * K
    part = recording.part(slice(begin + 1, begin + 2 * K))  # the first row was lost
    values, present = cut_periods(part, begin)
    assert values.shape == (2, K, 4)
    assert not present[0, 0].any()
    np.testing.assert_array_equal(values[1, :, :2], recording.position[begin + K : begin + 2 * K])


def test_no_period_is_cut_before_the_first_one(recording: Recording) -> None:
    cutter = PeriodCutter()
    cutter.add(recording.part(slice(0, RUN_IN)))
    assert cutter.periods == 0
    with raises_code(DataQualityError, "RID-RECORDING-PERIODS"):
        cutter.table()
    cutter.add(recording.part(slice(RUN_IN, RUN_IN + K + 1)))
    assert cutter.periods == 2


@pytest.mark.parametrize("axis", [0, 1])
def test_sums_by_blocks_equal_one_sum_bit_by_bit(axis: int) -> None:
    values = np.random.default_rng(1).normal(size=(40, 30, 6))
    total = None
    for block in np.array_split(values, 7, axis=axis):
        total = running_sum(total, block, axis=axis)
    assert total is not None
    assert total.tobytes() == values.sum(axis=axis).tobytes()
