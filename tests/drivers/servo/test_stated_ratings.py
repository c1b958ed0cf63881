"""Ratings that the cell file states, compared with those that the drive holds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from typing import TYPE_CHECKING

import pytest

from config.cell.cell import CellConfig
from config.cell.servo_profile import ServoProfile, TorqueObject
from config.errors import PreflightError
from drivers.servo.axes import CanServoAxes
from drivers.servo.motor_ratings import NOT_AVAILABLE
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from drivers.interfaces.servo_axes import DriveSetting
    from tests.drivers.conftest import Bench

HELD_NM, HELD_INCREMENTS = 2.0, 4096.0
BY_CURRENT = ServoProfile(torque=TorqueObject(object="6077h:00", of="rated_current"))


def ratings(bench: Bench, object_name: str) -> list[DriveSetting]:
    """Return the first drive's settings that compare or show an object's rating."""
    return [
        setting
        for setting in bench.axes.settings()
        if (setting.object_name, setting.node_id) == (object_name, 1)
        and setting.name != "rated torque at the joint"
    ]


def constants(bench: Bench) -> list[DriveSetting]:
    """Return the settings of all drives that compare a torque constant."""
    return [line for line in bench.axes.settings() if line.name.startswith("torque constant")]


def set_rated_current(bench: Bench, milliamperes: int) -> None:
    for drive in bench.drives:
        drive.objects[0x6075, 0] = milliamperes.to_bytes(4, "little")


@pytest.fixture
def make_stating(
    make_bench: Callable[[CellConfig], Bench], cell: CellConfig
) -> Callable[[ServoProfile], Bench]:
    """Return a function that makes a bench whose drives have the given servo profile."""
    return lambda profile: make_bench(cell.model_copy(update={"servo": profile}))


@pytest.mark.parametrize(
    ("profile", "object_name"),
    [
        (ServoProfile(rated_torque_nm=2.0 * HELD_NM), "6076h:00"),
        (ServoProfile(rated_torque_nm=0.9 * HELD_NM), "6076h:00"),
        (ServoProfile(encoder_increments=2.0 * HELD_INCREMENTS), "608Fh:01"),
    ],
)
def test_a_rating_that_the_drive_contradicts_is_refused(
    make_stating: Callable[[ServoProfile], Bench], profile: ServoProfile, object_name: str
) -> None:
    bench = make_stating(profile)
    with pytest.raises(PreflightError):
        bench.axes.bring_up()
    (line,) = ratings(bench, object_name)
    assert (line.verdict, line.code) == ("red", "RID-DRIVE-RATING")


def test_a_rated_current_that_the_drive_contradicts_is_refused(
    make_stating: Callable[[ServoProfile], Bench],
) -> None:
    stated = {"rated_torque_nm": HELD_NM, "rated_current_a": 7.0}
    bench = make_stating(BY_CURRENT.model_copy(update=stated))
    for drive in bench.drives:
        drive.objects[0x6075, 0] = (5000).to_bytes(4, "little")
    with pytest.raises(PreflightError):
        bench.axes.bring_up()
    (line,) = ratings(bench, "6075h:00")
    assert line.verdict == "red"
    assert all(number in line.found for number in ("5000", "7"))


@pytest.mark.parametrize(
    ("stated_nm", "held_mnm", "verdict"),
    [(2.0, 2000, "ok"), (2.13, 2127, "ok"), (2.13, 2136, "shown"), (2.08, 2000, "shown")],
)
def test_a_difference_that_rounding_does_not_explain_is_shown_with_both_numbers(
    make_stating: Callable[[ServoProfile], Bench], stated_nm: float, held_mnm: int, verdict: str
) -> None:
    bench = make_stating(ServoProfile(rated_torque_nm=stated_nm))
    for drive in bench.drives:
        drive.objects[0x6076, 0] = held_mnm.to_bytes(4, "little")
    bench.axes.bring_up()
    (line,) = ratings(bench, "6076h:00")
    assert (line.verdict, bool(line.headline)) == (verdict, verdict == "shown")
    numbers = (f"{1e-3 * held_mnm:g} N m ({held_mnm})", f"{stated_nm:g} N m")
    assert all(number in line.found + line.required for number in numbers)


def test_a_drive_without_a_rating_or_with_zero_does_not_agree(
    make_stating: Callable[[ServoProfile], Bench],
) -> None:
    bench = make_stating(ServoProfile(rated_torque_nm=2.0 * HELD_NM))
    bench.drives[0].objects[0x6076, 0] = bytes(4)
    for drive in bench.drives[1:]:
        del drive.objects[0x6076, 0]
    bench.axes.bring_up()
    lines = [line for line in bench.axes.settings() if line.name == "rated motor torque [N m]"]
    assert [line.verdict for line in lines] == ["shown"] * 3
    assert all(line.found.startswith(NOT_AVAILABLE) and line.headline for line in lines)


def test_a_rating_that_no_conversion_uses_is_compared_too(
    make_stating: Callable[[ServoProfile], Bench],
) -> None:
    bench = make_stating(ServoProfile(rated_current_a=7.0))
    set_rated_current(bench, 5000)
    with raises_code(PreflightError, "RID-DRIVE-RATING", "5000", "7"):
        bench.axes.bring_up()


def test_a_rated_current_is_read_from_the_object_that_the_profile_names(
    make_stating: Callable[[ServoProfile], Bench],
) -> None:
    stated = ServoProfile(rated_current_a=7.0, rated_current_object="6410h:01")
    bench = make_stating(stated)
    for drive in bench.drives:
        drive.objects[0x6410, 1] = (5000).to_bytes(2, "little")
    with raises_code(PreflightError, "RID-DRIVE-RATING", "6410h:01", "5000", "7"):
        bench.axes.bring_up()


CONSTANTS = [(0.4, "ok"), (0.41, "ok"), (0.565, "shown"), (0.8, "red"), (40.0, "red")]


@pytest.mark.parametrize(("nm_per_a", "verdict"), CONSTANTS)
def test_a_torque_constant_is_compared_with_rated_torque_per_rated_current(
    make_stating: Callable[[ServoProfile], Bench], nm_per_a: float, verdict: str
) -> None:
    bench = make_stating(ServoProfile(torque_constant_nm_per_a=nm_per_a))
    set_rated_current(bench, 5000)
    with raises_code(PreflightError, "RID-DRIVE-RATING") if verdict == "red" else nullcontext():
        bench.axes.bring_up()
    (line,) = (line for line in constants(bench) if line.node_id == 1)
    assert (line.verdict, bool(line.headline)) == (verdict, verdict == "shown")
    assert "0.4 N m/A" in line.found


@pytest.mark.parametrize(("nm_per_a", "verdict"), CONSTANTS)
def test_a_torque_constant_of_the_robot_file_is_compared_with_the_gear(
    bench: Bench, nm_per_a: float, verdict: str
) -> None:
    joints = [
        joint.model_copy(update={"torque_constant_nm_per_a": 100.0 * nm_per_a})
        for joint in bench.robot.joints
    ]
    robot = bench.robot.model_copy(update={"joints": tuple(joints)})
    bench.axes = CanServoAxes(bench.link, bench.cell, robot)
    set_rated_current(bench, 5000)
    with raises_code(PreflightError, "RID-DRIVE-RATING") if verdict == "red" else nullcontext():
        bench.axes.bring_up()
    (line,) = (line for line in constants(bench) if line.node_id == 1)
    assert line.verdict == verdict
    assert all(f"{value:g} N m/A" in line.found + line.required for value in (40, 100 * nm_per_a))


def test_a_torque_constant_is_not_available_from_a_drive_without_a_rating(
    make_stating: Callable[[ServoProfile], Bench],
) -> None:
    bench = make_stating(ServoProfile(torque_constant_nm_per_a=0.4))
    bench.axes.bring_up()
    assert [line.verdict for line in constants(bench)] == ["shown"] * 3
    assert all(line.found.startswith(NOT_AVAILABLE) for line in constants(bench))


@pytest.mark.parametrize("index", [0x6073, 0x60E0, 0x60E1])
@pytest.mark.parametrize(("permille", "verdict"), [(2300, "ok"), (2200, "red"), (0, "red")])
def test_every_torque_limit_of_the_drive_must_allow_a_stop(
    bench: Bench, index: int, permille: int, verdict: str
) -> None:
    for drive in bench.drives:  # 2 N m, gear 100, 500 N m at the joint
        drive.objects[index, 0] = permille.to_bytes(2, "little")
    with nullcontext() if verdict == "ok" else pytest.raises(PreflightError):
        bench.axes.bring_up()
    lines = [line for line in bench.axes.settings() if line.name == "torque for a stop"]
    found = [line.verdict for line in lines if line.object_name == f"{index:04X}h:00"]
    assert found == [verdict] * 3


def test_a_torque_limit_that_is_known_to_be_wrong_is_only_shown(
    make_stating: Callable[[ServoProfile], Bench],
) -> None:
    bench = make_stating(ServoProfile(not_compared=("6073h",)))
    for drive in bench.drives:
        drive.objects[0x6073, 0] = bytes(2)
    bench.axes.bring_up()


def test_a_value_that_is_known_to_be_wrong_is_shown_and_not_compared(
    make_stating: Callable[[ServoProfile], Bench],
) -> None:
    profile = ServoProfile(rated_torque_nm=2.0 * HELD_NM, not_compared=("6076h",))
    bench = make_stating(profile)
    bench.axes.bring_up()
    (line,) = ratings(bench, "6076h:00")
    assert (line.verdict, line.found) == ("shown", "2 N m (2000)")


@pytest.mark.parametrize(("nm_per_a", "verdict"), [(0.4, "ok"), (400.0, "red")])
def test_torques_from_a_current_are_judged_by_their_torque_constant(
    make_stating: Callable[[ServoProfile], Bench], nm_per_a: float, verdict: str
) -> None:
    stated = {"rated_current_a": 5.0, "torque_constant_nm_per_a": nm_per_a}
    bench = make_stating(BY_CURRENT.model_copy(update=stated))
    with nullcontext() if verdict == "ok" else pytest.raises(PreflightError):
        bench.axes.bring_up()
    found = [line for line in bench.axes.settings() if line.name == "rated torque at the joint"]
    assert found[0].verdict == verdict


@pytest.mark.parametrize(
    ("feed", "verdict"), [(1, "ok"), (4096, "ok"), (409600, "ok"), (360, "red"), (1000, "red")]
)
def test_a_drive_that_scales_its_positions_is_refused(
    bench: Bench, feed: int, verdict: str
) -> None:
    for drive in bench.drives:
        drive.objects[0x6092, 1] = feed.to_bytes(4, "little")
        drive.objects[0x6092, 2] = (1).to_bytes(4, "little")
    refused = raises_code(PreflightError, "RID-DRIVE-POSITION-UNIT", "6092h:01", f"{feed}")
    with nullcontext() if verdict == "ok" else refused:
        bench.axes.bring_up()
    assert bench.found("6092h:01").verdict == verdict


def test_scaled_positions_are_accepted_if_the_cell_file_states_their_unit(
    make_stating: Callable[[ServoProfile], Bench],
) -> None:
    bench = make_stating(ServoProfile(encoder_increments=1000.0, not_compared=("608Fh",)))
    for drive in bench.drives:
        drive.objects[0x6092, 1] = (1000).to_bytes(4, "little")
        drive.objects[0x6092, 2] = (1).to_bytes(4, "little")
    bench.axes.bring_up()
    assert bench.found("6092h:01").verdict == "shown"
