"""Leaving a cell for any reason: power is off and the bus is closed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import pytest
from can.interfaces.virtual import VirtualBus

from config.cell.cell import CanBusConfig, CellConfig
from config.errors import (
    ConfigError,
    DeviceFaultError,
    DeviceTimeoutError,
    DriverError,
    PreflightError,
    TransportError,
)
from config.robot.robot import RobotDescription
from drivers.cell import Cell, open_cell
from drivers.servo.cia402 import PowerState
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench


@pytest.fixture
def opened(bench: Bench) -> Callable[[], Cell]:
    """Return a function that opens a cell on the bus of the scripted bench."""

    def open_it() -> Cell:
        cell = Cell(bench.cell, bench.robot, bench.link)
        bench.axes = cell.axes
        return cell

    return open_it


def at_rest_without_power(bench: Bench) -> bool:
    return bench.bus.closed and all(
        drive.state is PowerState.SWITCH_ON_DISABLED and drive.velocity == 0
        for drive in bench.drives
    )


def test_leaving_after_a_motion_removes_power_and_closes_the_bus(
    bench: Bench, opened: Callable[[], Cell]
) -> None:
    with opened():
        bench.enabled()
        bench.cycle((0.5, 0.5, 0.5))
    assert at_rest_without_power(bench)


def leave_by(bench: Bench, cell: Cell, error: BaseException) -> None:
    with cell:
        bench.enabled()
        bench.cycle((0.5, 0.5, 0.5))
        bench.cycle((0.5, 0.5, 0.5))
        raise error


@pytest.mark.parametrize("error", [ValueError("bug"), KeyboardInterrupt(), SystemExit(3)])
def test_leaving_by_any_exception_during_a_motion_removes_power(
    bench: Bench, opened: Callable[[], Cell], error: BaseException
) -> None:
    with pytest.raises(type(error)) as caught:
        leave_by(bench, opened(), error)
    assert caught.value is error
    assert at_rest_without_power(bench)


def test_leaving_during_enabling_removes_power(bench: Bench, opened: Callable[[], Cell]) -> None:
    bench.drives[2].follows = 0
    with raises_code(DeviceTimeoutError, "RID-DRIVE-NOT-ENABLED", "elbow", "6060h"), opened():
        bench.enabled()
    assert at_rest_without_power(bench)


def test_leaving_after_a_red_preflight_sends_nothing_more(
    bench: Bench, opened: Callable[[], Cell]
) -> None:
    bench.drives[0].ignored = {(0x6007, 0)}
    with opened() as cell:
        with pytest.raises(PreflightError):
            cell.axes.bring_up()
        bench.bus.sent.clear()
    assert bench.bus.sent == []
    assert bench.bus.closed


def test_leaving_an_untouched_cell_sends_nothing(bench: Bench, opened: Callable[[], Cell]) -> None:
    with opened():
        assert bench.bus.sent == []
    assert bench.bus.sent == []
    assert bench.bus.closed


def test_a_lost_bus_is_closed_and_its_error_is_kept(
    bench: Bench, opened: Callable[[], Cell]
) -> None:
    def unplug() -> None:
        with opened():
            bench.enabled()
            bench.bus.broken = True
            bench.cycle((0.5, 0.5, 0.5))

    with raises_code(TransportError, "RID-CAN-LOST", "fake") as caught:
        unplug()
    assert bench.bus.closed
    assert len(caught.value.__notes__) > 0


def test_unconfirmed_power_off_is_reported_with_the_first_error(
    bench: Bench, opened: Callable[[], Cell]
) -> None:
    def go_silent() -> None:
        with opened():
            bench.enabled()
            bench.drives[2].answers_sync = False
            raise PreflightError("the robot stands outside its limits")

    with raises_code(PreflightError, "", "limits; ") as caught:
        go_silent()
    assert "elbow" in caught.value.__notes__[-1]
    assert not bench.axes.without_power


def test_power_off_counts_as_confirmed_by_the_last_request_only(
    bench: Bench, opened: Callable[[], Cell]
) -> None:
    unpowered: list[bool] = []
    with opened() as cell:
        unpowered.append(cell.axes.without_power)
        bench.enabled()
        cell.axes.disable()
        unpowered.append(cell.axes.without_power)
        bench.enabled()
        bench.bus.broken = True
        with pytest.raises(TransportError):
            cell.axes.disable()
        unpowered.append(cell.axes.without_power)
        bench.bus.broken = False
    assert unpowered == [False, True, False]


def test_an_error_of_leaving_alone_is_reported(bench: Bench, opened: Callable[[], Cell]) -> None:
    def go_silent() -> None:
        with opened():
            bench.enabled()
            bench.drives[0].answers_sync = False

    with raises_code(DeviceFaultError, "RID-DRIVE-NOT-STOPPED"):
        go_silent()
    assert bench.bus.closed
    assert bench.drives[1].state is PowerState.SWITCH_ON_DISABLED


def test_an_unexpected_error_in_one_step_does_not_skip_the_next(
    bench: Bench, opened: Callable[[], Cell]
) -> None:
    cell = opened()

    def broken() -> bool:
        raise ZeroDivisionError("a bug")

    def leave() -> None:
        with cell:
            bench.enabled()
            cell.axes.halt = broken  # type: ignore[method-assign]

    with raises_code(DriverError, "RID-INTERNAL-ERROR", "ZeroDivisionError: "):
        leave()
    assert at_rest_without_power(bench)


def test_a_real_python_can_bus_is_opened(cell: CellConfig, robot: RobotDescription) -> None:
    with open_cell(cell, robot) as opened:
        assert opened.axes.joint_names == ("base", "shoulder", "elbow")
        assert opened.config is cell


def test_a_configuration_error_closes_the_bus(
    cell: CellConfig, robot: RobotDescription, monkeypatch: pytest.MonkeyPatch
) -> None:
    closed: list[bool] = []
    monkeypatch.setattr(VirtualBus, "shutdown", lambda self: closed.append(True))
    slow = CanBusConfig(interface="virtual", channel="slow", bitrate=10_000)
    with raises_code(ConfigError, "RID-CAN-LOAD", "3 axes", "10000 bit/s"):
        open_cell(cell.model_copy(update={"can": slow}), robot)
    assert closed


def test_a_bus_that_cannot_be_opened_is_reported(cell: CellConfig, robot: RobotDescription) -> None:
    bus = CanBusConfig(interface="socketcan", channel="no_such_can7")
    with raises_code(TransportError, "RID-CAN-OPEN", "socketcan:no_such_can7"):
        open_cell(cell.model_copy(update={"can": bus}), robot)
