"""Effects of a bad disk on a running motion (docs/faults.md, rows 21 and 24).

The disk is simulated by the file object that the journal writes to. The test controls the time, so
that the load of the computer has no effect.
"""

from __future__ import annotations

import errno
import os
import shutil
import signal
import threading
from collections.abc import Callable, Iterator
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.journal import mcap_writer as journal_file
from acquisition.journal.cycle_row import row_struct
from acquisition.journal.cycles import read_journal
from acquisition.journal.disk_reserve import DiskReserve
from acquisition.journal.header import JournalHeader
from acquisition.journal.mcap_writer import MOST_LOST_S
from acquisition.motion.samples import MotionSamples
from acquisition.session.cycle_recorder import run_recorder
from acquisition.session.record import RING_ROWS, RING_S
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.cyclic_task import RING_LIMIT, CyclicTask
from acquisition.task.ring import Ring
from acquisition.task.set_points import PlannedMotion
from acquisition.task.states import RecorderState, TaskState
from acquisition.task.stop_orders import StopOrders
from config.cell.cell import CellConfig
from config.process.termination import TERMINATION
from config.robot.robot import RobotDescription

HEADER = JournalHeader(joint_names=("joint1", "joint2", "joint3"), sample_period_s=0.008)
PATIENCE_S = 120.0


@pytest.fixture(autouse=True)
def signals_restored() -> Iterator[None]:
    before = {number: signal.getsignal(number) for number in TERMINATION}
    yield
    for number, handler in before.items():
        signal.signal(number, handler)


class Disk:
    """A simulated disk with `room` bytes of space; if it is full, a write raises errno `error`."""

    def __init__(self, room: int, error: int) -> None:
        self.room, self.error, self.released = room, error, 0

    def open_new(self, path: Path) -> FileIO:
        disk = self

        class File(FileIO):
            def write(self, data: Any, /) -> int:
                left = disk.room - self.tell()
                if left <= 0:
                    raise OSError(disk.error, os.strerror(disk.error))
                return super().write(memoryview(data)[:left])

        return File(path, "xb")


Play = Callable[[int, int], Disk]


@pytest.fixture
def fail_disk(monkeypatch: pytest.MonkeyPatch) -> Play:
    """Return a function that limits the space for journals [bytes] and sets the errno of a full
    disk.
    """

    def begin(room: int, error: int) -> Disk:
        disk = Disk(room, error)
        release = DiskReserve.release

        def give_back(reserve: DiskReserve) -> bool:
            released = release(reserve)
            disk.room += released * (16 << 20)
            disk.released += released
            return released

        monkeypatch.setattr(journal_file, "open_new", disk.open_new)
        monkeypatch.setattr(DiskReserve, "release", give_back)
        return disk

    return begin


class Bench:
    """The cyclic task and the recorder run in one thread each.

    Simulated time passes between their steps.
    """

    def __init__(self, cell: CellConfig, robot: RobotDescription, axes: Any, clock: Any) -> None:
        self.ring, self.control = Ring.create(3, 64), ControlBlock.create()
        self.axes = axes
        self._task = CyclicTask(
            axes,
            clock,
            cell,
            robot,
            self.ring,
            self.control,
            lockstep=True,
            orders=StopOrders(self.control, lambda: False),
        )

    def run(self, motion: MotionSamples, path: Path) -> StopReason | None:
        reasons: list[StopReason | None] = []

        def move() -> None:
            while self.control.recorder.state is RecorderState.STARTING:
                os.sched_yield()
            try:
                reasons.append(self._task.run(PlannedMotion(motion)))
            finally:
                self.control.task.state = TaskState.FINISHED

        task = threading.Thread(target=move, daemon=True)
        task.start()
        run_recorder(self.ring, self.control, path, HEADER, os.getppid())
        task.join(PATIENCE_S)
        return reasons[0]


@pytest.fixture
def bench(cell: CellConfig, robot: RobotDescription, axes: Any, clock: Any) -> Bench:
    return Bench(cell, robot, axes, clock)


@pytest.mark.fault(24)
def test_a_full_disk_stops_the_motion_and_the_reserved_room_completes_the_file(
    bench: Bench,
    motion: MotionSamples,
    fail_disk: Play,
    tmp_path: Path,
    measured: Callable[[str], None],
) -> None:
    disk = fail_disk(60_000, errno.ENOSPC)
    reason = bench.run(motion, tmp_path / "r.mcap")
    assert reason is not None
    assert reason.code is StopCode.RECORDER
    assert "the disk is full" in reason.text
    assert disk.released == 1
    assert bench.control.recorder.state is RecorderState.FINISHED
    journal = read_journal(tmp_path / "r.mcap")
    assert journal.damage.notes == ()
    assert len(journal.rows) == bench.ring.written > 250
    assert len(journal.rows) < len(motion)
    assert bench.axes.calls[-2:] == ["quick_stop", "disable"]
    assert not np.any(journal.rows["velocity_command"][-1])
    measured(f"0 of {len(journal.rows)} rows lost; ramp and summary are also in the file")


@pytest.mark.fault(24)
def test_a_failing_disk_stops_the_motion_and_the_written_rows_are_kept(
    bench: Bench,
    motion: MotionSamples,
    fail_disk: Play,
    tmp_path: Path,
    measured: Callable[[str], None],
) -> None:
    disk = fail_disk(60_000, errno.EIO)
    reason = bench.run(motion, tmp_path / "r.mcap")
    assert reason is not None
    assert reason.code is StopCode.RECORDER
    assert "cannot be written: Input/output error" in reason.text
    assert disk.room == 60_000 + 16 * disk.released * (1 << 20)
    journal = read_journal(tmp_path / "r.mcap")
    assert not journal.damage.finished
    assert journal.damage.gaps == ()
    size = (tmp_path / "r.mcap").stat().st_size
    assert (
        len(journal.rows) * (row_struct(3).size + 35) > size - 2 * journal_file.CHUNK_BYTES - 4000
    )
    assert bench.axes.calls[-2:] == ["quick_stop", "disable"]
    measured("EIO: quick stop in the next cycle, every complete block before the error kept")


class Recording:
    """The recorder alone.

    Its clock advances only while it waits, and new rows arrive as time passes.
    """

    def __init__(self, ring: Ring, period_s: float, rows: int) -> None:
        self.ring, self.period_s, self.rows = ring, period_s, rows
        self.control = ControlBlock.create()
        self.now_s = 0.0
        self.fullest = 0.0
        self.refused = 0
        self.looks: list[Callable[[], None]] = []

    def pass_time(self, duration_s: float) -> None:
        self.now_s += duration_s
        while self.ring.written < min(self.now_s / self.period_s, self.rows):
            cycle = self.ring.written
            floats = [cycle * self.period_s, *[0.0] * 17]
            self.refused += not self.ring.write(
                (*floats, *[0] * 3, cycle, -1, *[0] * 6, 1, 1, 1, 3)
            )
            if self.refused:
                break
        self.fullest = max(self.fullest, self.ring.fill)
        if self.ring.written >= self.rows:
            self.control.task.state = TaskState.FINISHED

    def sleep(self, duration_s: float) -> None:
        self.pass_time(duration_s)
        for look in self.looks:
            look()

    def run(self, path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("acquisition.session.cycle_recorder.time.monotonic", lambda: self.now_s)
        monkeypatch.setattr("acquisition.session.cycle_recorder.time.sleep", self.sleep)
        run_recorder(self.ring, self.control, path, HEADER, os.getppid())


@pytest.mark.fault(24)
def test_short_stalls_of_the_disk_lose_no_row(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]
) -> None:
    period_s, rows = 0.001, 30_000
    bench = Recording(Ring.create(3, max(RING_ROWS, int(RING_S / period_s))), period_s, rows)
    stalls_s = {100: 5.0, **dict.fromkeys(range(200, 2000, 120), 0.5)}
    writes = iter(range(1 << 30))

    class Slow(FileIO):
        def write(self, data: Any, /) -> int:
            bench.pass_time(stalls_s.get(next(writes), 0.0))
            return super().write(data)

    monkeypatch.setattr(journal_file, "open_new", lambda path: Slow(path, "xb"))
    bench.run(tmp_path / "r.mcap", monkeypatch)
    assert next(writes) > 500
    journal = read_journal(tmp_path / "r.mcap")
    assert journal.rows["cycle"].tolist() == list(range(rows))
    assert bench.refused == 0
    assert 0.4 < bench.fullest < RING_LIMIT
    measured(f"0 of {rows} rows lost at 1 kHz; ring {bench.fullest:.0%} full after a stall of 5 s")


@pytest.mark.fault(21)
def test_a_killed_recorder_loses_at_most_a_tenth_of_a_second(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, measured: Callable[[str], None]
) -> None:
    bench = Recording(Ring.create(3, 4096), 0.002, 2000)
    path, snapshot = tmp_path / "r.mcap", tmp_path / "as-killed.mcap"
    lost_s: list[float] = []

    def look() -> None:
        if bench.now_s < 0.2:
            return
        shutil.copy(path, snapshot)  # the file that would remain if the process were killed now
        newest_s = float(read_journal(snapshot).rows["time_s"][-1])
        lost_s.append((bench.ring.written - 1) * bench.period_s - newest_s)

    bench.looks.append(look)
    bench.run(path, monkeypatch)
    assert len(lost_s) > 350
    assert max(lost_s) <= MOST_LOST_S
    measured(f"at most {max(lost_s) * 1e3:.0f} ms lost, whenever it is killed")
