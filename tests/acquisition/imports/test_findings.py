"""Import: wrong clocks, units and zeros, and stuck channels are reported or refused."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.imports.report import ImportReport
from acquisition.maps.import_map import ImportMap
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from tests.builders.foreign_tables import as_lines, sound_table, two_joint_map, two_joint_robot
from tests.builders.raised_codes import raises_code


def without_velocities(**changes: Any) -> ImportMap:
    joints = [
        {k: v for k, v in joint.model_dump(exclude_none=True).items() if k != "velocity"}
        for joint in two_joint_map().joints
    ]
    return two_joint_map(joints=joints, **changes)


def report_of(
    tmp_path: Path,
    table: np.ndarray,
    import_map: ImportMap | None = None,
    robot: RobotDescription | None = None,
) -> ImportReport:
    path = tmp_path / "recording.csv"
    path.write_text("\n".join(as_lines(table)))
    return import_csv(path, import_map or two_joint_map(), robot or two_joint_robot())[1]


def test_a_sound_recording_has_no_findings(tmp_path: Path) -> None:
    assert report_of(tmp_path, sound_table()).findings == ()


@pytest.mark.parametrize("meaning", ["model_based", "gravity_compensated"])
def test_torques_that_are_not_measured_are_a_finding(meaning: str, tmp_path: Path) -> None:
    table = as_lines(sound_table())
    (tmp_path / "rec.csv").write_text("\n".join(table))
    stated = two_joint_map().model_copy(update={"torques": meaning})
    report = import_csv(tmp_path / "rec.csv", stated, two_joint_robot())[1]
    assert report.torques == meaning
    assert [f"torques: {meaning}" in finding for finding in report.findings] == [True]


def test_a_torque_filter_that_lets_aliases_pass_is_reported(tmp_path: Path) -> None:
    half_hz = 0.5 / float(np.median(np.diff(sound_table()[:, 0])))
    for cutoff_hz, reported in ((0.5 * half_hz, []), (4.0 * half_hz, [True])):
        stated = two_joint_map(torque_filter={"order": 2, "cutoff_hz": cutoff_hz})
        found = report_of(tmp_path, sound_table(), stated).findings
        assert [f"{cutoff_hz:g} Hz" in finding for finding in found] == reported


def test_rows_seconds_apart_are_reported_with_the_likely_unit(
    tmp_path: Path,
) -> None:
    table = sound_table()
    table[:, 0] *= 1e3
    report = report_of(tmp_path, table, without_velocities())
    (finding,) = report.findings
    assert finding.startswith("The rows are ")
    assert finding.endswith("If the stamps are ms, put `unit: ms` under `time` into the map")
    assert "e+" not in report.lines()[1]


class TestClock:
    def test_a_clock_that_is_a_tenth_too_fast_is_reported_with_its_factor(
        self, tmp_path: Path
    ) -> None:
        table = sound_table()
        table[:, 0] *= 1.1
        (found,) = report_of(tmp_path, table).findings
        assert "positions and time stamps are 0.909 times" in found
        assert "Multiply the times by 0.909" in found

    @pytest.mark.parametrize("unit", ["ms", "us"])
    def test_a_clock_in_another_unit_is_refused(self, tmp_path: Path, unit: str) -> None:
        table, import_map = sound_table(), two_joint_map(time={"column": 0, "unit": unit})
        names = ("of 400", "plausible.speed", "and time", "row 2: position")
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", *names):
            report_of(tmp_path, table, import_map)
        table[:, 0] *= 1e3
        names = ("(column 1)", "0.00224", "2.24", "1000")
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", *names):
            report_of(tmp_path, table)
        table[:, 0] *= 1e6  # nanoseconds that are read as seconds
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", "1e9"):
            report_of(tmp_path, table)

    def test_the_clock_has_no_finding_if_one_joint_has_a_wrong_unit_or_gear(
        self, tmp_path: Path
    ) -> None:
        table = sound_table()
        table[:, 2] *= 1.2
        (found,) = report_of(tmp_path, table).findings
        assert found.startswith("b: its position moves 1.200 times as fast as its velocity column")

    @pytest.mark.parametrize("delay_s", [-0.02, 0.02])
    def test_the_clock_has_no_finding_for_a_delayed_noisy_velocity(
        self, tmp_path: Path, delay_s: float
    ) -> None:
        table = sound_table()
        t = table[:, 0] * 6.0
        table[:, 1:3] = np.stack([0.1 * np.sin(t), 0.05 * np.cos(t)], axis=1)
        t -= 6.0 * delay_s
        table[:, 3:5] = np.stack([0.6 * np.cos(t), -0.3 * np.sin(t)], axis=1)
        table[:, 3:5] += np.random.default_rng(1).normal(scale=0.02, size=(len(t), 2))
        assert report_of(tmp_path, table).findings == ()

    @pytest.mark.parametrize(
        ("clock", "noise", "is_reported"), [(1.0, 1.0, False), (1.06, 0.1, True)]
    )
    def test_the_clock_has_a_finding_if_velocity_noise_does_not_explain_the_difference(
        self, tmp_path: Path, clock: float, noise: float, is_reported: bool
    ) -> None:
        table = sound_table(150)
        table[:, 3:5] += np.random.default_rng(0).normal(scale=noise, size=(150, 2))
        table[:, 0] *= clock
        report = report_of(tmp_path, table)
        off = max(abs(ratio - 1.0) for ratio in report.velocity_ratio if ratio is not None)
        assert off > 0.05
        assert any("clock is wrong" in found for found in report.findings) is is_reported


class TestStuck:
    def test_a_stuck_torque_is_reported_with_its_rows(self, tmp_path: Path) -> None:
        table = sound_table()
        table[100:, 5] = 1.25
        (found,) = report_of(tmp_path, table).findings
        assert found.startswith(
            "a: its torque (column 5) is constant at 2.5 from row 101 to row 400 while"
        )

    def test_a_velocity_of_the_opposite_sign_is_refused_by_its_sign(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, 3] *= -1.0
        names = (" of a ", "2.23", "opposite")
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", *names):
            report_of(tmp_path, table)

    def test_a_clipped_torque_is_reported_with_its_values(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, 5] = np.clip(table[:, 5], -0.7 * table[:, 5].max(), 0.7 * table[:, 5].max())
        (found,) = report_of(tmp_path, table).findings
        assert found.startswith("a: its torque (column 5) is exactly ")

    def test_a_constant_extreme_torque_at_rest_is_not_reported(self, tmp_path: Path) -> None:
        table = sound_table()
        table[-60:, 1] = table[-60, 1]
        table[-60:, 3] = 0.0
        table[-60:, 5] = 1.2 * table[:, 5].max()
        found = report_of(tmp_path, table, without_velocities()).findings
        assert not [each for each in found if "exactly" in each]

    def test_a_torque_that_wraps_is_refused(self, tmp_path: Path) -> None:
        table = sound_table()
        half = 0.6 * np.abs(table[:, 5]).max()
        table[:, 5] = (table[:, 5] + half) % (2.0 * half) - half
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", "column 5"):
            report_of(tmp_path, table)

    def test_a_torque_of_friction_alone_does_not_wrap(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, 5] = np.sign(table[:, 3]) + 0.01 * table[:, 3]
        report_of(tmp_path, table)

    def test_forces_that_change_from_one_limit_to_the_other_in_motion_do_not_wrap(
        self, tmp_path: Path
    ) -> None:
        """With triangular speed profiles, acceleration changes its sign at the largest speed."""
        table = sound_table()
        t = table[:, 0] - table[0, 0]
        force = np.where(t % 0.8 < 0.4, 1.0, -1.0)
        table[:, 3] = 4.0 * (0.2 - np.abs(t % 0.8 - 0.4)) + 0.8
        table[:, 1] = np.cumsum(0.011 * table[:, 3]) - 1.7
        table[:, 5] = 3.0 * force + np.random.default_rng(0).normal(scale=0.02, size=len(t))
        report_of(tmp_path, table, without_velocities(plausible={"position": 9.0}))

    def test_a_stuck_position_is_refused_if_its_velocity_changes(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, 1] = 0.3
        names = ("position of a", "speed of 0,", "is 2.23", "stuck")
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", *names):
            report_of(tmp_path, table)

    def test_a_constant_torque_of_a_joint_at_rest_is_not_reported(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, [1, 3]], table[:, 5] = 0.0, 1.0
        assert report_of(tmp_path, table).findings == ()


class TestPositions:
    @pytest.mark.parametrize("moved", [0.3, -0.3])
    def test_a_position_whose_zero_moves_is_refused(self, moved: float, tmp_path: Path) -> None:
        table = sound_table()
        table[200:, 1] += moved
        import_map = without_velocities(plausible={"speed": 60.0})
        names = ("--rows",)
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", *names):
            report_of(tmp_path, table, import_map)

    def test_a_position_that_is_wrong_in_a_single_row_is_no_moved_zero(
        self, tmp_path: Path
    ) -> None:
        table = sound_table()
        table[200, 1] += 0.3
        report_of(tmp_path, table, without_velocities(plausible={"speed": 60.0}))

    def test_lost_rows_are_no_moved_zero(self, tmp_path: Path) -> None:
        table = sound_table()
        lost = np.delete(table, slice(150, 165), axis=0)
        report_of(tmp_path, lost, without_velocities(plausible={"speed": 60.0}))

    def test_positions_in_degrees_are_refused_by_the_limits(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, 1:3] *= 180.0 / math.pi
        import_map = without_velocities(plausible={"position": 100.0, "speed": 400.0})
        names = ("-57.29 to 57.29", "-3 to 3", "`units: {position: deg}`")
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", *names):
            report_of(tmp_path, table, import_map)

    def test_small_positions_in_degrees_are_refused_by_their_speed(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, 1:3] *= 0.03 * 180.0 / math.pi
        names = ("5.372 rad/s", "limit is 1 rad/s:", "(degrees?)")
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", *names):
            report_of(tmp_path, table, without_velocities(), slow_robot())

    def test_motor_positions_need_the_key_side_motor(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, 1:5] *= 100.0
        import_map = two_joint_map(plausible={"position": 1e3, "speed": 1e3})
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", "-100", "`side: motor`"):
            report_of(tmp_path, table, import_map)
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", "400", "`side: motor`"):
            report_of(tmp_path, table)  # with this map nearly every row is implausible

    def test_positions_with_another_zero_need_a_zero_offset(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, 1] += math.pi
        names = ("2.142 to 4.142", "zero_offset", "(3.1 rad")
        with raises_code(DataQualityError, "RID-IMPORT-UNITS", *names):
            report_of(tmp_path, table)
        joints = [joint.model_dump(exclude_none=True) for joint in two_joint_map().joints]
        joints[0]["zero_offset"] = math.pi
        assert report_of(tmp_path, table, two_joint_map(joints=joints)).findings == ()

    def test_positions_slightly_beyond_the_limits_are_a_finding(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, 1] += 2.1
        (found,) = report_of(tmp_path, table).findings
        assert "from 1.1 to 3.1 rad, but the robot file's limits are -3 to 3 rad" in found


class TestTorques:
    def test_torques_beyond_the_robots_limits_are_a_finding(self, tmp_path: Path) -> None:
        table = sound_table()
        table[:, 6] *= 20.0
        (found,) = report_of(tmp_path, table).findings
        assert found.startswith(
            "b: its torque reaches 79.99, but the robot file's limit is 50: its torque"
        )

    def test_torques_that_remove_too_many_rows_are_refused_with_the_likely_cause(
        self, tmp_path: Path
    ) -> None:
        table = sound_table()
        table[:, 6] *= 30.0
        names = ("248 of 400", "torques of b", "120", "limit is 50", "torque constant")
        with raises_code(DataQualityError, "RID-IMPORT-ROWS", *names):
            report_of(tmp_path, table)


def test_a_static_recording_is_reported_as_static(tmp_path: Path) -> None:
    table = sound_table()
    table[:, 1:3], table[:, 3:5] = 0.3, 0.0
    report = report_of(tmp_path, table)
    assert report.static
    assert report.findings[0].startswith("Static: no joint moves")


def slow_robot() -> RobotDescription:
    joints = [
        joint.model_copy(update={"limits": joint.limits.model_copy(update={"velocity": 1.0})})
        for joint in two_joint_robot().joints
    ]
    return two_joint_robot().model_copy(update={"joints": tuple(joints)})
