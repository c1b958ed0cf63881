"""The watchdog test accepts only reactions and resets only faults that the silence has caused."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest

from config.cell.cell import CellConfig
from config.cell.servo_profile import ServoProfile
from config.errors import DeviceFaultError, PreflightError
from drivers.cell import Cell
from drivers.servo.cia402 import PowerState
from drivers.servo.watchdog_test import WatchdogResult, require_watchdogs, run_watchdog_test
from mock_hw.drive import objects as od
from mock_hw.drive.drive import SimulatedDrive
from tests.builders.obedient_cell import ObedientCell
from tests.builders.raised_codes import raises_code
from tests.mock_hw.test_families import GUARDED, WITHOUT_REACTIONS, cell_of, opened

OVERVOLTAGE = 0x3210
HEARTBEAT_LOST = 0x8130
MAKERS_CODE = 0xFF01
FAILING = {"abort_connection": 1}


def fail_once_powered(
    bus: ObedientCell,
    cell: CellConfig,
    fail: Callable[[SimulatedDrive, float], None],
    after_s: float,
) -> None:
    """Call `fail` for the first drive at each step from `after_s` after its first enabling on.

    It is called only while the drive is enabled.
    """
    drive, cycle = bus.drives[0], bus.run_until
    enabled_s: list[float] = []

    def run_until(time_s: float) -> None:
        cycle(time_s)
        if drive.power.following:
            enabled_s.append(bus.now_s)
        if enabled_s and enabled_s[0] + after_s <= bus.now_s < math.inf and drive.power.following:
            fail(drive, bus.now_s)

    bus.run_until = run_until  # type: ignore[method-assign]


def resets(bus: ObedientCell) -> list[int]:
    """Return the node IDs of the drives that are not in the fault state."""
    return [drive.node_id for drive in bus.drives if drive.power.state is not PowerState.FAULT]


def try_it(opened_cell: Cell, cell: CellConfig) -> tuple[WatchdogResult, ...]:
    return run_watchdog_test(opened_cell.axes, opened_cell.clock, cell)


@pytest.mark.parametrize("check", [run_watchdog_test, require_watchdogs])
@pytest.mark.parametrize("after_s", [0.01, 0.06])
def test_another_fault_is_no_reaction_and_is_not_reset(
    check: Callable[..., object], after_s: float
) -> None:
    cell = cell_of(WITHOUT_REACTIONS, ServoProfile())
    with opened(cell) as (open_cell, bus):
        open_cell.axes.bring_up()
        fail_once_powered(bus, cell, lambda drive, at_s: drive.fail(OVERVOLTAGE, at_s), after_s)
        with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "base", "3210h"):
            check(open_cell.axes, open_cell.clock, cell)
        assert bus.drives[0].power.state is PowerState.FAULT
        assert not any(drive.power.powered for drive in bus.drives)


def test_a_fault_that_is_added_to_the_expected_one_is_not_reset(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cell = cell_of(WITHOUT_REACTIONS, ServoProfile())
    with opened(cell) as (open_cell, bus):
        drive = bus.drives[0]

        def lose(code: int) -> None:
            drive._fault(code)
            drive._fault(OVERVOLTAGE)

        monkeypatch.setattr(drive, "_lose_master", lose)
        with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "3210h"):
            try_it(open_cell, cell)
        assert drive.power.state is PowerState.FAULT


def test_the_fault_of_the_lost_connection_is_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = cell_of(WITHOUT_REACTIONS, ServoProfile())
    with opened(cell) as (open_cell, bus):
        monkeypatch.setattr(bus.drives[0], "_lose_master", bus.drives[0]._fault)
        first, _ = try_it(open_cell, cell)
        assert (first.how, first.reacted_s <= 0.09) == ("fault", True)
        assert resets(bus) == [1, 2]


@pytest.mark.parametrize(("declared", "accepted"), [((), False), ((MAKERS_CODE,), True)])
def test_a_makers_code_counts_only_if_the_profile_declares_it(
    monkeypatch: pytest.MonkeyPatch, declared: tuple[int, ...], accepted: bool
) -> None:
    profile = WITHOUT_REACTIONS.model_copy(update={"lost_connection_codes": (0x8130, *declared)})
    cell = cell_of(profile, ServoProfile())
    with opened(cell) as (open_cell, bus):
        drive = bus.drives[0]
        monkeypatch.setattr(drive, "_lose_master", lambda _code: drive._fault(MAKERS_CODE))
        if accepted:
            assert try_it(open_cell, cell)[0].reacted_s <= 0.09
            assert resets(bus) == [1, 2]
            return
        with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "FF01h"):
            try_it(open_cell, cell)
        assert drive.power.state is PowerState.FAULT


def test_power_that_is_lost_before_the_timeout_is_no_reaction() -> None:
    """An emergency stop is pressed during the test: no drive has shown that it would stop."""
    cell = cell_of(WITHOUT_REACTIONS, ServoProfile())
    with opened(cell) as (open_cell, bus):
        open_cell.axes.bring_up()
        fail_once_powered(bus, cell, lambda drive, _: drive.power.supply(False), 0.01)
        with raises_code(PreflightError, "RID-DRIVE-WATCHDOG", "base"):
            require_watchdogs(open_cell.axes, open_cell.clock, cell)


def test_a_restart_is_no_reaction() -> None:
    cell = cell_of(WITHOUT_REACTIONS, ServoProfile())

    def restart(drive: SimulatedDrive, now_s: float) -> None:
        drive.lose_supply(now_s)
        drive.restore_supply(now_s)

    with opened(cell) as (open_cell, bus):
        open_cell.axes.bring_up()
        fail_once_powered(bus, cell, restart, 0.02)
        with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "base"):
            require_watchdogs(open_cell.axes, open_cell.clock, cell)


@pytest.mark.parametrize("profile", [ServoProfile(), WITHOUT_REACTIONS, GUARDED])
def test_a_fault_before_the_test_is_refused_and_stays(profile: ServoProfile) -> None:
    cell = cell_of(profile, ServoProfile())
    with opened(cell) as (open_cell, bus):
        bus.run_until(0.1)
        bus.drives[0].fail(HEARTBEAT_LOST, bus.now_s)
        with raises_code(PreflightError, "RID-PREFLIGHT-RED", "8130h"):
            try_it(open_cell, cell)
        assert bus.drives[0].power.state is PowerState.FAULT


def test_without_power_a_fault_of_the_test_is_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    """Many drives enter their fault state also without power when the heartbeat is lost."""
    cell = cell_of(ServoProfile(), ServoProfile())
    with opened(cell) as (open_cell, bus):
        monkeypatch.setattr(bus.drives[0], "_lose_master", bus.drives[0]._fault)
        first, _ = try_it(open_cell, cell)
        assert (first.powered, first.reacted_s <= 0.09) == (False, True)
        assert resets(bus) == [1, 2]


def test_a_drive_that_stays_powered_ends_the_test_with_an_error(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cell = cell_of(ServoProfile(), WITHOUT_REACTIONS)
    with opened(cell) as (open_cell, bus):
        drive = bus.drives[1]
        drive.watches = False
        drive.objects[od.ABORT_CONNECTION] = 0
        power = drive.power
        command = power.command
        monkeypatch.setattr(
            power, "command", lambda word, at_s: command(word, at_s) if word else None
        )
        with raises_code(DeviceFaultError, "RID-DRIVE-NOT-STOPPED", "elbow"):
            try_it(open_cell, cell)
        monkeypatch.undo()


def test_a_fault_that_comes_before_the_reset_is_not_reset(monkeypatch: pytest.MonkeyPatch) -> None:
    cell = cell_of(WITHOUT_REACTIONS, ServoProfile())
    with opened(cell) as (open_cell, bus):
        service = open_cell.axes.service
        monkeypatch.setattr(bus.drives[0], "_lose_master", bus.drives[0]._fault)
        claim_bus = service.claim_bus

        def fail_before_a_reset() -> None:
            if bus.drives[0].power.state is PowerState.FAULT:
                bus.drives[1].fail(OVERVOLTAGE, bus.now_s)
            claim_bus()

        monkeypatch.setattr(service, "claim_bus", fail_before_a_reset)
        with raises_code(DeviceFaultError, "RID-DRIVE-FAULT", "3210h"):
            try_it(open_cell, cell)
        assert bus.drives[1].power.state is PowerState.FAULT
