"""Stopping distance of an axis, from the settings of its drive, and refused settings."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import pytest

from config.cell.cell import CellConfig, Supervision
from config.cell.drive_safety import DriveSafety
from config.errors import PreflightError
from drivers.servo.stop_ramp import LONGEST_STOP_S, StopRamp
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.drivers.conftest import Bench

MakeBench = Callable[[CellConfig], Any]


def with_numbers(cell: CellConfig, **numbers: Any) -> CellConfig:
    """Return a simulated cell with changed numbers for safety and supervision."""
    safety = cell.drive_safety.model_dump()
    rules = cell.supervision.model_dump()
    safety |= {name: value for name, value in numbers.items() if name in safety}
    rules |= {name: value for name, value in numbers.items() if name in rules}
    return cell.model_copy(
        update={
            "simulated": True,
            "drive_safety": DriveSafety(**safety),
            "supervision": Supervision(**rules),
        }
    )


def setting(bench: Bench, name: str, joint: str = "base") -> Any:
    (found,) = (s for s in bench.axes.settings() if s.name == name and s.joint == joint)
    return found


def test_duration_and_distance_of_a_ramp_are_computed() -> None:
    ramp = StopRamp(velocity=2.0, deceleration=4.0)
    assert ramp.time_s == 0.5
    assert ramp.distance == 0.5
    assert math.isinf(StopRamp(velocity=2.0, deceleration=0.0).time_s)


def test_the_stop_is_reported_with_duration_and_distance(bench: Bench) -> None:
    """The axis has 1.1 times the speed 2 rad/s and brakes at 10 rad/s², from the SYNC after the
    next.
    """
    bench.axes.bring_up()
    stop = setting(bench, "stop from top speed")
    assert stop.verdict == "ok"
    assert stop.found == "0.236 s, 0.277 rad from 2.2 rad/s"
    assert stop.required == "≤ 2 s, ≤ 6 rad"
    rest = setting(bench, "rest after a fault")
    assert rest.verdict == "ok"
    assert rest.found == "0.236 s, 0.517 rad (following error, detected by this computer)"


@pytest.mark.parametrize("deceleration", [1e-30, 1e-3, 1.0])
def test_a_ramp_that_is_too_long_is_refused(
    make_bench: MakeBench, cell: CellConfig, deceleration: float
) -> None:
    bench = make_bench(with_numbers(cell, quick_stop_deceleration_rad_s2=deceleration))
    names = ("drive_safety.quick_stop_deceleration_rad_s2", f"≤ {LONGEST_STOP_S:g} s")
    with raises_code(PreflightError, "RID-PREFLIGHT-RED", *names):
        bench.axes.bring_up()


def test_the_value_read_back_from_the_drive_counts(make_bench: MakeBench, cell: CellConfig) -> None:
    """The drive accepts every write and keeps its own deceleration."""
    bench = make_bench(cell)
    bench.drives[0].ignored = {(0x6085, 0)}
    bench.drives[0].objects[0x6085, 0] = (100).to_bytes(4, "little")
    with pytest.raises(PreflightError):
        bench.axes.bring_up()
    assert setting(bench, "stop from top speed").verdict == "red"
    assert setting(bench, "stop from top speed", "elbow").verdict == "ok"


@pytest.mark.parametrize("options", [{"quick_stop_option": 5}, {"fault_reaction_option": 1}])
def test_the_profile_deceleration_is_written_and_checked_if_a_stop_uses_it(
    make_bench: MakeBench, cell: CellConfig, options: dict[str, int]
) -> None:
    bench = make_bench(with_numbers(cell, **options))
    with raises_code(PreflightError, "RID-PREFLIGHT-RED", "6084h:00"):
        bench.axes.bring_up()
    bench = make_bench(with_numbers(cell, **options))
    for drive in bench.drives:
        drive.objects[0x6084, 0] = bytes(4)
    bench.axes.bring_up()
    assert bench.drives[0].objects[0x6084, 0] == bench.drives[0].objects[0x6085, 0] != bytes(4)


@pytest.mark.parametrize(
    ("numbers", "cause"),
    [
        ({"master_heartbeat_timeout_ms": 5000}, "this computer fails"),
        ({"drive_heartbeat_timeout_ms": 5000}, "another drive fails"),
        ({"missed_frames_limit": 1000}, "answers are lost"),
        ({"late_by_cycles_limit": 1e6}, "this computer is late"),
        ({"stuck_encoder_cycles": 1000}, "an encoder is stuck"),
        ({"following_error_min_rad": 6.0}, "following error, detected by this computer"),
        ({"following_error_per_velocity_s": 100.0}, "following error, detected by this computer"),
        ({"following_error_rad": 7.0}, "following error, detected by the drive"),
        ({"following_error_timeout_ms": 65535}, "following error, detected by the drive"),
    ],
)
def test_a_fault_detected_too_late_is_refused_with_the_number_to_lower(
    make_bench: MakeBench, cell: CellConfig, numbers: dict[str, Any], cause: str
) -> None:
    bench = make_bench(with_numbers(cell, **numbers))
    with raises_code(PreflightError, "RID-PREFLIGHT-RED") as refused:
        bench.axes.bring_up()
    (name,) = numbers
    assert f"({cause})" in str(refused.value)
    assert f".{name}" in str(refused.value)


def test_a_following_error_window_that_is_disabled_in_the_drive_is_refused(
    make_bench: MakeBench, cell: CellConfig
) -> None:
    counts_per_rad = 4096 * 100 / (2.0 * math.pi)
    off = 0xFFFF_FFFF / counts_per_rad
    bench = make_bench(with_numbers(cell, following_error_rad=off))
    with raises_code(PreflightError, "RID-PREFLIGHT-RED", "monitor"):
        bench.axes.bring_up()


def test_a_torque_limit_below_that_of_motions_is_refused(
    make_bench: MakeBench, cell: CellConfig
) -> None:
    bench = make_bench(with_numbers(cell, torque_limit_fraction=2.0))
    with raises_code(PreflightError, "RID-PREFLIGHT-RED", "400", "required", "450"):
        bench.axes.bring_up()


def test_an_axis_with_its_own_deceleration_gets_it(
    make_bench: Callable[[CellConfig], Bench], cell: CellConfig
) -> None:
    axes = [
        axis.model_copy(update={"quick_stop_deceleration_rad_s2": 40.0})
        if axis.node_id == 2
        else axis
        for axis in cell.axes
    ]
    bench = make_bench(cell.model_copy(update={"axes": tuple(axes)}))
    bench.axes.bring_up()
    base, shoulder = (int.from_bytes(bench.drives[n].objects[0x6085, 0], "little") for n in (0, 1))
    assert shoulder == pytest.approx(4 * base, rel=1e-3)
