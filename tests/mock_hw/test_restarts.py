"""Drives that restart between their setup and the start: never moved with what they then hold."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass

import pytest

from config.cell.cell import CellConfig
from config.cell.servo_profile import ServoProfile
from config.errors import DeviceFaultError
from drivers.canopen.heartbeat import heartbeat_frame
from drivers.canopen.nmt import NmtState
from drivers.cell import Cell
from drivers.servo.watchdog_test import try_watches
from mock_hw.drive import objects as od
from mock_hw.drive.drive import SimulatedDrive
from tests.builders.raised_codes import raises_code
from tests.mock_hw.test_families import cell_of, opened

WATCH_ON_COMPUTER = (0x1016, 1)


@dataclass
class Rig:
    config: CellConfig
    cell: Cell
    base: SimulatedDrive
    elbow: SimulatedDrive

    def restart_base(self) -> None:
        now_s = self.cell.clock.now_s()
        self.base.lose_supply(now_s)
        self.base.restore_supply(now_s)

    def pass_time(self, time_s: float) -> None:
        self.cell.clock.sleep_until(self.cell.clock.now_s() + time_s)


@pytest.fixture
def rig() -> Iterator[Rig]:
    config = cell_of(ServoProfile(), ServoProfile())
    with opened(config) as (cell, bus):
        yield Rig(config, cell, *bus.drives)


def once_written_to(drive: SimulatedDrive, act: Callable[[], None]) -> None:
    """Let something happen once, when a drive is written to next."""
    write = drive._sdo._write

    def act_and_write(index: int, subindex: int, data: bytes) -> None:
        drive._sdo._write = write
        act()
        write(index, subindex, data)

    drive._sdo._write = act_and_write


def test_while_another_drive_is_set_up(rig: Rig) -> None:
    once_written_to(rig.elbow, rig.restart_base)
    with raises_code(DeviceFaultError, "RID-DRIVE-RESTARTED", "(node 1)"):
        rig.cell.axes.bring_up()
    assert {s.node_id for s in rig.cell.axes.settings()} == {1, 2}, "found drives are reported too"
    rig.cell.axes.bring_up()
    rig.cell.axes.start()


def test_with_everything_stored_in_it_but_its_watches(rig: Rig) -> None:
    """Then it would answer SYNC and send its heartbeat as if nothing had been."""
    rig.cell.axes.bring_up()
    rig.base.objects.store()
    rig.base.objects._stored |= {WATCH_ON_COMPUTER: 0, od.ABORT_CONNECTION: 0}
    once_written_to(rig.elbow, rig.restart_base)
    with raises_code(DeviceFaultError, "RID-DRIVE-RESTARTED", "(node 1)"):
        rig.cell.axes.bring_up()
    assert rig.base.objects[WATCH_ON_COMPUTER] == 0


def test_after_all_are_set_up_and_before_they_are_started(rig: Rig) -> None:
    rig.cell.axes.bring_up()
    rig.restart_base()
    rig.pass_time(0.05)
    rig.cell.axes.service.power_states()  # reads on past the boot-up
    with raises_code(DeviceFaultError, "RID-DRIVE-RESTARTED", "(node 1)"):
        rig.cell.axes.start()
    assert rig.elbow.nmt is NmtState.PRE_OPERATIONAL, "no drive was started"


def test_with_its_boot_up_still_unread_when_they_are_started(rig: Rig) -> None:
    rig.cell.axes.bring_up()
    rig.restart_base()
    rig.pass_time(0.05)
    with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "base"):
        rig.cell.axes.start()
    rig.cell.axes.bring_up()


def test_a_second_boot_up_before_its_setup_takes_nothing_away(rig: Rig) -> None:
    """As of a drive that tells twice that it has booted, the second time a little late."""
    once_written_to(
        rig.base, lambda: rig.elbow._send(heartbeat_frame(2, NmtState.INITIALISING), 0.001)
    )
    rig.cell.axes.bring_up()
    rig.cell.axes.start()
    rig.cell.axes.enable()
    assert (rig.base.nmt, rig.elbow.nmt) == (NmtState.OPERATIONAL, NmtState.OPERATIONAL)


def test_the_resets_of_a_watch_trial_are_no_restarts(rig: Rig) -> None:
    for _ in range(2):
        trials = try_watches(rig.cell.axes, rig.cell.clock, rig.config)
        assert all(trial.acted_s <= 0.088 for trial in trials)
    rig.cell.axes.start()
