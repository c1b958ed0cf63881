"""Rows of a motion in shared memory become bins with the time of day."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.journal.cycle_row import CycleRow
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import MonitorState, Pace
from config.errors import RecordingError
from rid_daq.service.signals.signal_bins import SignalBins
from rid_daq.service.signals.signal_reader import SignalReader
from tests.builders.clock import Clock
from tests.builders.raised_codes import raises_code

CYCLE_S = 0.01
JOINTS = ("axis1", "axis2")
WALL_S = 1.7e9


def write(ring: Ring, time_s: float) -> None:
    still, counts = [0.0, 0.0], [0, 0]
    row = CycleRow(
        time_s=time_s,
        lateness_s=0.0,
        exchange_s=0.001,
        target_position=still,
        target_velocity=still,
        velocity_command=still,
        position=[time_s, -time_s],
        torque_nm=[1.0, 2.0],
        position_counts=counts,
        cycle=0,
        sample_index=0,
        torque_raw=counts,
        statusword=counts,
        valid=[1, 1],
        phase=3,
    )
    assert ring.write(row.values())


class Motion:
    """A motion in this process: its memory, a clock, and the reader."""

    def __init__(self, pace: Pace, capacity: int = 512) -> None:
        self.clock = Clock(100.003)
        self.ring, self.control = Ring.create(2, capacity), ControlBlock.create()
        self.control.task.pace = pace
        self.reader = SignalReader(
            self.ring,
            self.control,
            JOINTS,
            CYCLE_S,
            monotonic_s=self.clock,
            wall_s=lambda: self.clock.now_s + WALL_S,
        )

    def run(self, cycles: int, per_cycle_s: float = CYCLE_S) -> SignalBins:
        """Write rows while the clock proceeds, and read them."""
        begin_s = self.clock.now_s
        for i in range(cycles):
            write(self.ring, begin_s + i * CYCLE_S)
        self.clock.now_s += cycles * per_cycle_s
        return self.reader.read()


def test_rows_of_a_real_cell_have_the_time_of_their_sync() -> None:
    motion = Motion(Pace.REAL_TIME)
    bins = motion.run(20)
    assert bins.end_s - WALL_S == pytest.approx([100.043, 100.093, 100.143], abs=1e-6)
    last = motion.reader.finish()
    assert last.end_s - WALL_S == pytest.approx([100.193], abs=1e-6)


def test_rows_of_a_fast_simulation_are_spread_over_real_time() -> None:
    motion = Motion(Pace.LOCKSTEP)
    bins = motion.run(200, per_cycle_s=0.001)
    assert bins.end_s[0] > WALL_S + 100.0
    assert bins.end_s[-1] <= WALL_S + 100.203 + 1e-6
    assert np.diff(bins.end_s) == pytest.approx(0.05, abs=0.005)
    assert not bins.after_gap[1:].any()


def test_rows_that_were_overwritten_leave_a_gap() -> None:
    motion = Motion(Pace.REAL_TIME, capacity=64)
    before = motion.run(20)
    for _ in range(20):
        motion.ring.read()
        for i in range(8):
            write(motion.ring, motion.clock.now_s + i * CYCLE_S)
        motion.clock.now_s += 8 * CYCLE_S
    bins = motion.reader.read()
    assert before.after_gap.tolist() == [True, False, False]
    assert bins.after_gap.sum() == 1


def test_temperatures_are_known_while_the_drive_monitor_works() -> None:
    motion = Motion(Pace.REAL_TIME)
    motion.control.program.announce_monitor(2)
    motion.control.monitor.state = MonitorState.POLLING
    motion.control.monitor.show_temperatures([300.15, 310.15], ())
    assert motion.run(20).values[:, -2:] == pytest.approx(np.tile((27.0, 37.0), (3, 1)))
    motion.control.monitor.state = MonitorState.FINISHED
    assert np.isnan(motion.run(20).values[:, -2:]).all()


def test_names_that_do_not_fit_the_rows_are_refused() -> None:
    with raises_code(RecordingError, "RID-CELL-JOINTS"):
        SignalReader(Ring.create(3, 64), ControlBlock.create(), JOINTS, CYCLE_S)
