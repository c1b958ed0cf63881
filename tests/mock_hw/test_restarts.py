"""Drives that restart between setup and start are never moved with lost settings."""

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
from drivers.servo.watchdog_test import run_watchdog_test
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


def act_at_next_write(drive: SimulatedDrive, act: Callable[[], None]) -> None:
    """Call a function once, just before the next write to a drive."""
    write = drive._sdo._write

    def act_and_write(index: int, subindex: int, data: bytes) -> None:
        drive._sdo._write = write
        act()
        write(index, subindex, data)

    drive._sdo._write = act_and_write


def test_a_restart_while_another_drive_is_set_up_is_detected(rig: Rig) -> None:
    act_at_next_write(rig.elbow, rig.restart_base)
    with raises_code(DeviceFaultError, "RID-DRIVE-RESTARTED", "(node 1)"):
        rig.cell.axes.bring_up()
    assert {s.node_id for s in rig.cell.axes.settings()} == {1, 2}, (
        "settings of all found drives must be reported"
    )
    rig.cell.axes.bring_up()
    rig.cell.axes.start()


def test_a_restart_of_a_drive_that_stores_everything_except_watchdogs_is_detected(rig: Rig) -> None:
    """After the restart, the drive answers SYNC and sends its heartbeat as before."""
    rig.cell.axes.bring_up()
    rig.base.objects.store()
    rig.base.objects._stored |= {WATCH_ON_COMPUTER: 0, od.ABORT_CONNECTION: 0}
    act_at_next_write(rig.elbow, rig.restart_base)
    with raises_code(DeviceFaultError, "RID-DRIVE-RESTARTED", "(node 1)"):
        rig.cell.axes.bring_up()
    assert rig.base.objects[WATCH_ON_COMPUTER] == 0


def test_a_restart_between_setup_and_start_is_detected(rig: Rig) -> None:
    rig.cell.axes.bring_up()
    rig.restart_base()
    rig.pass_time(0.05)
    rig.cell.axes.service.power_states()  # this call also reads the boot-up message
    with raises_code(DeviceFaultError, "RID-DRIVE-RESTARTED", "(node 1)"):
        rig.cell.axes.start()
    assert rig.elbow.nmt is NmtState.PRE_OPERATIONAL, "no drive was started"


def test_a_restart_with_an_unread_boot_up_message_is_detected(rig: Rig) -> None:
    rig.cell.axes.bring_up()
    rig.restart_base()
    rig.pass_time(0.05)
    with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "base"):
        rig.cell.axes.start()
    rig.cell.axes.bring_up()


def test_a_second_boot_up_message_before_setup_is_tolerated(rig: Rig) -> None:
    """Some drives send two boot-up messages, the second slightly later."""
    act_at_next_write(
        rig.base, lambda: rig.elbow._send(heartbeat_frame(2, NmtState.INITIALISING), 0.001)
    )
    rig.cell.axes.bring_up()
    rig.cell.axes.start()
    rig.cell.axes.enable()
    assert (rig.base.nmt, rig.elbow.nmt) == (NmtState.OPERATIONAL, NmtState.OPERATIONAL)


def test_resets_of_the_watchdog_test_are_not_restarts(rig: Rig) -> None:
    for _ in range(2):
        trials = run_watchdog_test(rig.cell.axes, rig.cell.clock, rig.config)
        assert all(trial.reacted_s <= 0.088 for trial in trials)
    rig.cell.axes.start()
