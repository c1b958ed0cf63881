"""Ratings that the cell file states, compared with those that the drive holds."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from typing import TYPE_CHECKING

import pytest

from config.cell.cell import CellConfig
from config.cell.servo_profile import ServoProfile, TorqueObject
from config.errors import PreflightError

if TYPE_CHECKING:
    from drivers.interfaces.servo_axes import DriveSetting
    from tests.drivers.conftest import Bench

HELD_NM, HELD_INCREMENTS = 2.0, 4096.0
BY_CURRENT = ServoProfile(torque=TorqueObject(object="6077h:00", of="rated_current"))


def ratings(bench: Bench, object_name: str) -> list[DriveSetting]:
    """Return the lines of the first drive that compare or show a rating."""
    return [
        setting
        for setting in bench.axes.settings()
        if (setting.object_name, setting.node_id) == (object_name, 1)
        and setting.name != "rated torque at the joint"
    ]


@pytest.fixture
def make_stating(
    make_bench: Callable[[CellConfig], Bench], cell: CellConfig
) -> Callable[[ServoProfile], Bench]:
    """Return a function that makes a bench whose cell file states ratings."""
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
    assert (line.verdict, line.found) == ("red", "5000")


@pytest.mark.parametrize("stated_nm", [HELD_NM, 1.04 * HELD_NM])
def test_a_rating_from_a_rounded_data_sheet_is_accepted(
    make_stating: Callable[[ServoProfile], Bench], stated_nm: float
) -> None:
    bench = make_stating(ServoProfile(rated_torque_nm=stated_nm))
    bench.axes.bring_up()
    (line,) = ratings(bench, "6076h:00")
    assert line.verdict == "ok"


def test_a_drive_without_a_rating_or_with_zero_is_not_compared(
    make_stating: Callable[[ServoProfile], Bench],
) -> None:
    bench = make_stating(ServoProfile(rated_torque_nm=2.0 * HELD_NM))
    bench.drives[0].objects[0x6076, 0] = bytes(4)
    for drive in bench.drives[1:]:
        del drive.objects[0x6076, 0]
    bench.axes.bring_up()
    assert [line.verdict for line in ratings(bench, "6076h:00")] == ["shown"]


def test_a_value_that_is_known_to_be_wrong_is_shown_and_not_compared(
    make_stating: Callable[[ServoProfile], Bench],
) -> None:
    profile = ServoProfile(rated_torque_nm=2.0 * HELD_NM, not_compared=("6076h",))
    bench = make_stating(profile)
    bench.axes.bring_up()
    (line,) = ratings(bench, "6076h:00")
    assert (line.verdict, line.found) == ("shown", "2000")


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
