"""Early stop of a running motion: the periods that the rule receives, and its verdict."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import wait
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter
from acquisition.journal.header import JournalHeader
from acquisition.motion.samples import MotionSamples, Phase, phases_of
from acquisition.session.early_stop import EarlyStop, EarlyStopRule, NewPeriods
from acquisition.task.control_block import ControlBlock

K = 20
BEFORE = 5
PERIODS = 6
APPROACH = 3
HEADER = JournalHeader(joint_names=("a",), sample_period_s=0.01, samples_per_period=K)


def motion() -> MotionSamples:
    phase = phases_of((Phase.RUN_IN, BEFORE), (Phase.MAIN, PERIODS * K), (Phase.RUN_OUT, 4))
    rest = np.zeros((len(phase), 1))
    return MotionSamples(("a",), 0.01, rest, rest, rest, phase, K, PERIODS)


def rows() -> np.ndarray:
    found = np.zeros(APPROACH + len(motion()), dtype=row_dtype(1))
    found["time_s"] = 0.01 * np.arange(len(found))
    found["sample_index"] = np.maximum(np.arange(len(found)) - APPROACH, -1)
    found["phase"][APPROACH:] = motion().phase
    found["valid"] = 1
    return found


def end_of(period: int) -> int:
    return APPROACH + BEFORE + period * K


class Bench:
    """A journal that the test writes in parts, and the periods that the stop rule has received."""

    def __init__(self, path: Path, rule: EarlyStopRule | None = None) -> None:
        self.control = ControlBlock.create()
        self.received: list[NewPeriods] = []
        self.answers = iter([False] * 100)
        self.stop = EarlyStop(path, motion(), self.control, rule or self._enough)
        self._writer = JournalWriter(path, HEADER)
        self._written = 0

    def _enough(self, new: NewPeriods) -> bool:
        self.received.append(new)
        return next(self.answers)

    def write_up_to(self, row: int) -> None:
        """Write the rows up to `row`, and wait until the stop rule has evaluated them."""
        self._writer.append(rows()[self._written : row].tobytes())
        self._writer.flush()
        self._written = row
        progress = replace(self.control.progress, sample_index=row - 1 - APPROACH)
        self.stop.update(progress)
        if self.stop.pending is not None:
            wait([self.stop.pending])

    def close(self) -> None:
        self._writer.close()
        self.stop.close()


@pytest.fixture
def bench(tmp_path: Path) -> Iterator[Bench]:
    bench = Bench(tmp_path / "recording.mcap")
    yield bench
    bench.close()


def test_the_rule_receives_every_row_once_and_in_order(bench: Bench) -> None:
    for row in (end_of(1), end_of(2) + 3, end_of(3) + 7, end_of(4) - 1, end_of(5) + 2):
        bench.write_up_to(row)
    assert [new.periods for new in bench.received] == [3, 5]
    assert [new.first_row for new in bench.received] == [BEFORE, BEFORE + 3 * K]
    received_rows = np.concatenate([new.recording.sample_index for new in bench.received])
    np.testing.assert_array_equal(received_rows, rows()["sample_index"][: end_of(5)])


def test_the_task_receives_the_verdict_of_the_rule(bench: Bench) -> None:
    bench.answers = iter([False, True])
    bench.write_up_to(end_of(3))
    assert (bench.control.program.periods_judged, bench.control.program.enough) == (3, False)
    bench.write_up_to(end_of(4))
    assert (bench.control.program.periods_judged, bench.control.program.enough) == (4, True)
    bench.write_up_to(end_of(5))
    assert len(bench.received) == 2


def test_two_periods_are_never_enough_and_the_rule_is_not_called(bench: Bench) -> None:
    bench.write_up_to(end_of(2))
    assert bench.control.program.periods_judged == 2
    assert bench.received == []


def test_an_error_of_the_rule_is_raised_after_the_motion(tmp_path: Path) -> None:
    def fail(new: NewPeriods) -> bool:
        raise ZeroDivisionError

    bench = Bench(tmp_path / "recording.mcap", fail)
    bench.write_up_to(end_of(3))
    assert bench.control.program.periods_judged == 3
    with pytest.raises(ZeroDivisionError):
        bench.close()
