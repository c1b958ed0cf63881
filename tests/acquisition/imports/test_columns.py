"""Import: columns are converted according to the side of the gear (motor or joint), the unit and
the robot file.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.imports.report import ImportReport
from acquisition.maps.import_map import ImportMap
from acquisition.recording.recording import Recording
from config.errors import ConfigError, DataQualityError
from config.robot.robot import RobotDescription
from tests.builders.raised_codes import raises_code

ROWS = 300
GEARS = np.array([50.0, -20.0])
WARMTH = np.array([0, 0, 0, 0, 0, 0, 0, 1, 1])
COUPLING = [[1.0, 0.0], [-0.25, 1.0]]

Read = Callable[..., tuple[Recording, ImportReport]]


@pytest.fixture
def read(tmp_path: Path) -> Read:
    """Return a function that reads a table with an import map, with or without a robot."""

    def read_table(
        table: np.ndarray, import_map: ImportMap, robot: RobotDescription | None = None
    ) -> tuple[Recording, ImportReport]:
        path = tmp_path / "recording.csv"
        np.savetxt(path, table, fmt="%.9f", delimiter=",")
        return import_csv(path, import_map, robot)

    return read_table


def table(rows: int = ROWS) -> np.ndarray:
    """Return a table with columns for the time, two positions, two velocities, two torques or
    currents, and two temperatures in °C.
    """
    t = 0.01 * np.arange(rows)
    warmth = np.linspace(20.0, 45.0, rows)
    return np.column_stack(
        [
            t,
            np.sin(3.0 * t),
            np.cos(2.0 * t),
            3.0 * np.cos(3.0 * t),
            -2.0 * np.sin(2.0 * t),
            1.0 + np.sin(t),
            np.cos(5.0 * t),
            warmth,
            warmth + 5.0,
        ]
    )


def motor_table() -> np.ndarray:
    """Return `table()` with positions and velocities on the motor side of the gears instead of the
    joint side.
    """
    motor = table()
    motor[:, 1:3] *= GEARS
    motor[:, 3:5] *= GEARS
    return motor


def layout(*joints: dict[str, Any], **changes: Any) -> ImportMap:
    two = (
        {"joint": "a", "position": 1, "velocity": 3, "torque": 5},
        {"joint": "b", "position": 2, "velocity": 4, "torque": 6},
    )
    given = [old | new for old, new in zip(two, joints or ({}, {}), strict=True)]
    values = {
        "name": "test",
        "robot": "test",
        "columns": 9,
        "time": {"column": 0},
        "joints": [{k: v for k, v in joint.items() if v is not None} for joint in given],
    }
    return ImportMap.model_validate_json(json.dumps(values | changes))


def robot(**changes: Any) -> RobotDescription:
    """The gear ratios are 50 and -20; the torque constants are 60 and 30 N m/A on the link side."""
    limits = {
        "position_min": -3.0,
        "position_max": 3.0,
        "velocity": 3.0,
        "acceleration": 9.0,
        "torque": 99.0,
    }
    values: dict[str, Any] = {
        "name": "test",
        "kinematics": {"convention": "modified_dh", "rows": [{}, {"alpha_rad": 1.5}]},
        "joints": [
            {"name": "a", "limits": limits, "gear_ratio": 50.0, "torque_constant_nm_per_a": 60.0},
            {"name": "b", "limits": limits, "gear_ratio": -20.0, "torque_constant_nm_per_a": 30.0},
        ],
    }
    return RobotDescription.model_validate_json(json.dumps(values | changes))


class TestVelocityCommands:
    MAP: ClassVar = (
        {"velocity": None, "velocity_command": 3},
        {"velocity": None, "velocity_command": 4, "position_sign": -1},
    )

    def test_commands_have_unit_gear_and_sign_of_the_velocities(self, read: Read) -> None:
        """Motor speeds are in deg/s; those of joint b have the opposite sign."""
        motor = motor_table()
        motor[:, 2] *= -1.0
        motor[:, 3:5] *= [180.0 / np.pi, -180.0 / np.pi]
        units = {"velocity": "deg/s"}
        recording, _ = read(motor, layout(*self.MAP, side="motor", units=units), robot())
        assert recording.velocity_command is not None
        np.testing.assert_allclose(recording.velocity_command, table()[:, 3:5], atol=1e-8)

    def test_commands_of_a_coupled_wrist_become_those_of_the_joints(self, read: Read) -> None:
        joints = tuple({**joint, "position_sign": 1} for joint in self.MAP)
        import_map = layout(*joints, side="motor")
        recording, _ = read(motor_table(), import_map, robot(coupling=COUPLING))
        expected = table()[:, 3:5] @ np.transpose(COUPLING)
        assert recording.velocity_command is not None
        np.testing.assert_allclose(recording.velocity_command, expected, atol=1e-8)

    def test_commands_are_put_on_the_grid_of_the_periods(self, read: Read) -> None:
        joints = ({**joint, "position_sign": 1} for joint in self.MAP)
        recording, _ = read(table(1300), layout(*joints, period_s=2.0 * np.pi))
        t = recording.time_s
        expected = np.column_stack([3.0 * np.cos(3.0 * t), -2.0 * np.sin(2.0 * t)])
        assert recording.velocity_command is not None
        np.testing.assert_allclose(recording.velocity_command, expected, atol=1e-6)

    @pytest.mark.parametrize("factor", [180.0 / np.pi, np.pi / 180.0, 30.0 / np.pi, 50.0, -1.0])
    def test_commands_that_the_motion_contradicts_are_refused(
        self, factor: float, read: Read
    ) -> None:
        """Wrong units (degrees or radians, rev/min), the motor's speed, and the wrong sign."""
        rows = table()
        rows[:, [1, 3]] *= 0.1
        rows[:, 3] *= factor
        joints = ({**joint, "position_sign": 1} for joint in self.MAP)
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", " a ", "column 3"):
            read(rows, layout(*joints))

    @pytest.mark.parametrize("seed", range(20))
    def test_a_loop_follows_its_commands_with_delay_and_error(self, seed: int, read: Read) -> None:
        """The command has noise, leads by 0 to 50 ms, and is 0.6 to 2 times the speed."""
        random = np.random.default_rng(seed)
        rows = table()
        size = np.std(rows[:, 3:5], axis=0)
        rows[:, 3:5] = np.roll(rows[:, 3:5], -int(random.integers(0, 6)), axis=0)
        rows[:, 3:5] *= random.uniform(0.6, 2.0)
        rows[:, 3:5] += 0.3 * size * random.standard_normal((len(rows), 2))
        recording, _ = read(rows, layout(*({**each, "position_sign": 1} for each in self.MAP)))
        assert recording.velocity_command is not None

    def test_a_row_with_an_absurd_command_is_left_out(self, read: Read) -> None:
        rows = table()
        rows[100, 3] = 1e9
        joints = ({**joint, "position_sign": 1} for joint in self.MAP)
        recording, report = read(rows, layout(*joints))
        assert len(recording) == ROWS - 1
        assert "velocity command of a" in report.damaged[0].examples[0].detail


CURRENTS = ({"torque": None, "current": 5}, {"torque": None, "current": 6})


class TestMotorSide:
    def test_the_motor_side_is_converted_by_the_robots_gears(self, read: Read) -> None:
        recording, report = read(motor_table(), layout(side="motor"), robot())
        np.testing.assert_allclose(recording.position, table()[:, 1:3], atol=1e-8)
        np.testing.assert_allclose(recording.torque_nm, table()[:, 5:7] * GEARS, atol=1e-6)
        assert report.velocity_ratio == pytest.approx((1.0, 1.0), abs=1e-3)

    def test_the_motor_side_is_converted_by_the_maps_gear_if_it_has_one(self, read: Read) -> None:
        import_map = layout({}, {"gear_ratio": -40.0}, side="motor")
        recording, _ = read(motor_table(), import_map, robot())
        np.testing.assert_allclose(recording.position, table()[:, 1:3] * [1.0, 0.5], atol=1e-8)

    def test_the_motor_side_of_a_coupled_wrist_becomes_joint_positions_and_actuator_torques(
        self, read: Read
    ) -> None:
        """q = C alpha (5.18); the actuator torque is the motor torque times the gear ratio."""
        recording, report = read(motor_table(), layout(side="motor"), robot(coupling=COUPLING))
        a, b = table()[:, 1:3].T
        np.testing.assert_allclose(recording.position[:, 0], a, atol=1e-8)
        np.testing.assert_allclose(recording.position[:, 1], b - 0.25 * a, atol=1e-8)
        np.testing.assert_allclose(recording.torque_nm, table()[:, 5:7] * GEARS, atol=1e-6)
        assert report.travel == pytest.approx(np.ptp(recording.position, axis=0).tolist())

    def test_the_motor_side_needs_gear_ratios_in_the_robot_or_the_map(self, read: Read) -> None:
        with raises_code(ConfigError, "RID-IMPORT-MOTOR-SIDE", "'a'", "gear_ratio"):
            read(motor_table(), layout(side="motor"))
        alone = layout({"gear_ratio": 50.0}, {"gear_ratio": -20.0}, side="motor")
        recording, _ = read(motor_table(), alone)
        np.testing.assert_allclose(recording.position, table()[:, 1:3], atol=1e-8)


class TestLinkSide:
    def test_link_side_positions_are_joint_positions_for_any_coupling(self, read: Read) -> None:
        recording, _ = read(table(), layout(), robot(coupling=COUPLING))
        np.testing.assert_allclose(recording.position, table()[:, 1:3], atol=1e-8)
        np.testing.assert_allclose(recording.torque_nm, table()[:, 5:7], atol=1e-8)


class TestCurrents:
    @pytest.mark.parametrize(("side", "constants"), [("link", (60, 30)), ("motor", (60, -30))])
    def test_currents_use_the_robots_link_side_constant_with_the_motors_sign(
        self, read: Read, side: str, constants: tuple[float, float]
    ) -> None:
        import_map = layout(*CURRENTS, side=side, plausible={"speed": 200.0})
        rows = motor_table() if side == "motor" else table()
        recording, _ = read(rows, import_map, robot())
        np.testing.assert_allclose(recording.torque_nm, table()[:, 5:7] * constants, atol=1e-6)

    def test_currents_use_the_maps_constant_first_on_the_side_of_its_columns(
        self, read: Read
    ) -> None:
        joints = tuple(joint | {"torque_constant_nm_per_a": 0.5} for joint in CURRENTS)
        recording, _ = read(motor_table(), layout(*joints, side="motor"), robot())
        np.testing.assert_allclose(recording.torque_nm, table()[:, 5:7] * GEARS / 2, atol=1e-6)

    def test_currents_need_a_constant_in_the_robot_or_the_map(self, read: Read) -> None:
        bare = [
            joint.model_copy(update={"torque_constant_nm_per_a": None}) for joint in robot().joints
        ]
        with raises_code(ConfigError, "RID-IMPORT-MOTOR-SIDE", "'a'", "torque_constant_nm_per"):
            read(table(), layout(*CURRENTS))
        with raises_code(ConfigError, "RID-IMPORT-MOTOR-SIDE", "'a'", "torque_constant_nm_per"):
            read(table(), layout(*CURRENTS), robot().model_copy(update={"joints": tuple(bare)}))


class TestDriveUnits:
    """The columns contain increments of the motor encoders, and fractions of rated values."""

    TURN: ClassVar = {"increments_per_rev": 131072}

    @pytest.mark.parametrize(("unit", "whole"), [("permille", 1000.0), ("percent", 100.0)])
    def test_a_drives_own_units_give_the_same_recording(
        self, read: Read, unit: str, whole: float
    ) -> None:
        increments = motor_table()
        increments[:, 1:5] = np.rint(increments[:, 1:5] * 131072 / (2.0 * np.pi))
        increments[:, 5:7] *= whole / 4.0
        units = {"position": "increments", "velocity": "increments/s", "torque": unit}
        joint = self.TURN | {"rated_torque_nm": 4.0}
        recording, report = read(
            increments, layout(joint, joint, side="motor", units=units), robot()
        )
        step = 2.0 * np.pi / 131072 / 20.0
        np.testing.assert_allclose(recording.position, table()[:, 1:3], atol=step)
        np.testing.assert_allclose(recording.torque_nm, table()[:, 5:7] * GEARS, atol=1e-6)
        assert report.velocity_ratio == pytest.approx((1.0, 1.0), abs=1e-3)

    def test_a_share_of_the_rated_current_gives_the_torque(self, read: Read) -> None:
        joints = [current | {"rated_current_a": 8.0} for current in CURRENTS]
        recording, _ = read(table(), layout(*joints, units={"current": "percent"}), robot())
        np.testing.assert_allclose(
            recording.torque_nm, 0.08 * table()[:, 5:7] * [60.0, 30.0], atol=1e-7
        )


class TestTemperatures:
    @pytest.mark.parametrize(("unit", "zero"), [("C", 0.0), ("K", 273.15)])
    def test_temperatures_are_converted_to_kelvin(self, read: Read, unit: str, zero: float) -> None:
        import_map = layout({"temperature": 7}, {"temperature": 8}, units={"temperature": unit})
        recording, _ = read(table() + zero * WARMTH, import_map)
        assert recording.temperature_k is not None
        np.testing.assert_allclose(recording.temperature_k[[0, -1], 0], [293.15, 318.15])
        np.testing.assert_allclose(recording.temperature_k[:, 1] - recording.temperature_k[:, 0], 5)

    @pytest.mark.parametrize(("unit", "zero"), [("C", 273.15), ("K", 0.0)])
    def test_temperatures_in_the_wrong_unit_are_implausible(
        self, read: Read, unit: str, zero: float
    ) -> None:
        import_map = layout({"temperature": 7}, {"temperature": 8}, units={"temperature": unit})
        names = ("0 of 300", "temperature of a", "223.15 to 473.15")
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", *names):
            read(table() + zero * WARMTH, import_map)

    def test_temperatures_without_columns_are_unknown(self, read: Read) -> None:
        assert read(table(), layout())[0].temperature_k is None


def test_a_robot_with_other_joints_is_refused(read: Read) -> None:
    import_map = layout({}, {"joint": "c"})
    with raises_code(ConfigError, "RID-IMPORT-JOINTS", "'test'"):
        read(table(), import_map, robot())
