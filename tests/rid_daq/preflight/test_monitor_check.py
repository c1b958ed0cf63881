"""Preflight lines about hot motors, silent drives and deviating torque constants."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from config.cell.cell import CellConfig
from config.cell.drive_profile import DriveProfile
from config.cell.monitor import ModbusTcp
from config.load import LoadedCell, load_cell
from drivers.modbus.codec import encode
from mock_hw.registers.registers import SimulatedRegisters
from mock_hw.registers.server import RegisterService, RegisterSettings
from rid_daq.preflight.check_line import CheckLine
from rid_daq.preflight.monitor_check import monitor_lines

Serve = Callable[..., CellConfig]


@pytest.fixture(scope="module")
def loaded() -> LoadedCell:
    return load_cell("kr15")


@pytest.fixture
def serve(loaded: LoadedCell, tmp_path: Path) -> Iterator[Serve]:
    """Return a function that serves the registers of up to six drives.

    By default, they have the motors that the robot file states. `temperature_k` and `constant`, a
    factor of the torque constant, apply to drive 3.
    """
    profile = loaded.drive_profile
    monitor = loaded.config.monitor
    assert isinstance(profile, DriveProfile)
    assert monitor is not None
    with ExitStack() as stack:

        def start(
            temperature_k: float = 300.0, constant: float = 1.0, units: int = 6
        ) -> CellConfig:
            def registers(unit: int) -> dict[int, int] | None:
                if unit > units:
                    return None
                joint = loaded.robot.joints[unit - 1]
                assert joint.torque_constant_nm_per_a is not None
                motor = joint.torque_constant_nm_per_a / joint.gear_ratio
                third = unit == 3
                values = dict.fromkeys(profile.registers, 0.0) | {
                    "motor_temperature_k": temperature_k if third else 300.0,
                    "torque_constant_nm_per_a": motor * (constant if third else 1.0),
                }
                return encode(profile, values)

            settings = RegisterSettings(monitor, profile, tmp_path / "line")
            service = stack.enter_context(
                RegisterService(SimulatedRegisters(registers), settings, realtime=False)
            )
            link = ModbusTcp(kind="tcp", host="127.0.0.1", port=service.port)
            served = monitor.model_copy(update={"link": link, "timeout_s": 10.0})
            return loaded.config.model_copy(update={"monitor": served})

        yield start


def red_lines(loaded: LoadedCell, cell: CellConfig) -> list[CheckLine]:
    lines = monitor_lines(cell, loaded.robot, loaded.drive_profile)
    return [line for line in lines if line.verdict == "red"]


def test_normal_motors_give_no_red_line(loaded: LoadedCell, serve: Serve) -> None:
    cell = serve()
    assert red_lines(loaded, cell) == []
    lines = monitor_lines(cell, loaded.robot, loaded.drive_profile)
    assert sum(line.of_drive for line in lines) == 12


def test_a_hot_motor_is_red(loaded: LoadedCell, serve: Serve) -> None:
    (line,) = red_lines(loaded, serve(temperature_k=395.0))
    assert (line.where, line.found, line.required) == ("axis3, node 3", "121.9", "≤ 120")
    assert line.next_action == "let the motor cool down"
    assert line.temperature_c == pytest.approx(121.9)


def test_a_deviating_torque_constant_is_red(loaded: LoadedCell, serve: Serve) -> None:
    (line,) = red_lines(loaded, serve(constant=1.05))
    assert (line.where, line.found, line.required) == ("axis3, node 3", "103.9", "99")
    assert "torque_constant_nm_per_a" in line.next_action


def test_a_missing_drive_is_red(loaded: LoadedCell, serve: Serve) -> None:
    (line,) = red_lines(loaded, serve(units=5))
    assert line.found == "no answer of unit 6"
    assert line.temperature_c is None
    assert "exception 11" in line.next_action


def test_an_unreachable_monitor_link_is_red(loaded: LoadedCell, serve: Serve) -> None:
    cell = serve()
    assert cell.monitor is not None
    link = cell.monitor.link.model_copy(update={"port": 1})
    gone = cell.monitor.model_copy(update={"link": link})
    (line,) = red_lines(loaded, cell.model_copy(update={"monitor": gone}))
    assert "cannot be opened" in line.found
    assert "monitor.units" in line.next_action


def test_a_cell_without_a_monitor_has_no_lines_about_motors(loaded: LoadedCell) -> None:
    bare = loaded.config.model_copy(update={"monitor": None})
    assert monitor_lines(bare, loaded.robot, None) == []
