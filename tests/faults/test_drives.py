"""Drives that reset, fail, stop sending, lose power or ignore commands (docs/faults.md, rows 8 to
11 and 13 to 15).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from acquisition.motion.samples import MotionSamples
from acquisition.supervision.stop_reason import StopCode
from config.load import LoadedCell

T = 0.008
AT = 230
Measured = Callable[[str], None]


def ramp_time_s(loaded: LoadedCell, speed: float) -> float:
    return speed / loaded.config.drive_safety.quick_stop_deceleration_rad_s2


@pytest.mark.fault(8)
def test_a_drive_reset_stops_all_axes_and_the_drive_stays_disabled(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    rig = serve(drives=[{"kind": "reset", "joint": "axis2", "at_cycle": AT}])
    run = rig.move(motion)
    assert run.reason.code in (StopCode.DRIVE_RESTARTED, StopCode.MISSED_FRAMES)
    boot_s = max(f.time_s for f in run.frames if f.can_id == 0x702 and f.data == b"\x00")
    stop_s = max(run.quick_stops().values())
    assert stop_s <= boot_s + 2 * T
    cycles = run.quick_stop_cycle() - AT + 1
    assert cycles <= 4
    run.assert_at_rest()
    when = "before" if stop_s < boot_s else "after"
    measured(
        f"quick stop {cycles} T after the reset, {abs(stop_s - boot_s) / T:.1f} T {when} the"
        " boot-up message"
    )


@pytest.mark.fault(9)
@pytest.mark.parametrize("phase", [0.1, 0.4, 0.7, 0.95])
def test_an_emergency_message_stops_all_axes_and_is_explained(
    serve: Any, motion: MotionSamples, phase: float, measured: Measured
) -> None:
    quiet = serve().move(motion)
    at_s = quiet.syncs_s[AT - 1] + phase * T
    run = serve(drives=[{"kind": "emergency", "joint": "axis3", "at_s": at_s, "code": 0x4310}])
    run = run.move(motion)
    assert (run.reason.code, run.reason.joint) == (StopCode.EMERGENCY, "axis3")
    assert "4310h" in run.reason.text
    assert "temperature" in run.reason.text
    (sent_s,) = [f.time_s for f in run.frames if f.can_id == 0x083 and f.data[:2] == b"\x10\x43"]
    late = (max(run.quick_stops().values()) - sent_s) / T
    assert late <= 2.0
    run.assert_at_rest()
    measured(f"quick stop {late:.2f} T after the message")


@pytest.mark.fault(9)
def test_a_fault_of_one_drive_stops_all_axes(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    run = serve(drives=[{"kind": "fault", "joint": "axis1", "at_cycle": AT, "code": 0x2310}])
    run = run.move(motion)
    assert run.reason.code is StopCode.EMERGENCY
    cycles = run.quick_stop_cycle() - AT + 1
    assert cycles <= 2
    run.assert_at_rest()
    measured(f"a drive in fault: quick stop in {cycles} T")


class CallCounter:
    """Counter of the function calls of the cyclic task in each cycle."""

    def __init__(self) -> None:
        self.calls: list[int] = []
        self._count = 0

    def __call__(self, cell: Any, _control: object) -> None:
        exchange = cell.axes.exchange

        def counted() -> Any:
            self.calls.append(self._count)
            self._count = 0
            return exchange()

        cell.axes.exchange = counted
        sys.setprofile(self._see)

    def _see(self, _frame: object, event: str, _argument: object) -> None:
        self._count += event in ("call", "c_call")

    def count(self, rig: Any, motion: MotionSamples) -> Any:
        """Run the motion and count the calls in each cycle."""
        try:
            return rig.move(motion, self)
        finally:
            sys.setprofile(None)


@pytest.mark.fault(10)
def test_a_flood_of_emergency_messages_adds_few_calls_per_cycle(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    """The test counts function calls, because processor time depends on the computer."""
    flood = {"kind": "emergency", "joint": "axis2", "at_cycle": AT, "count": 500}
    single, flooded = CallCounter(), CallCounter()
    one = single.count(serve(drives=[flood | {"count": 1}]), motion)
    run = flooded.count(serve(drives=[flood]), motion)
    assert one.quick_stop_cycle() == run.quick_stop_cycle() == AT
    assert len(single.calls) == len(flooded.calls)
    stopping = slice(-12, None)
    moving = float(np.median(single.calls[-100:-20]))
    quiet, busy = (np.median(work.calls[stopping]) for work in (single, flooded))
    assert busy > quiet, "the flood of messages has no effect"
    a_message = (busy - quiet) / (1000.0 * T)
    assert a_message < 40
    assert max(flooded.calls[stopping]) < 2.0 * moving
    assert len(run.notes) <= 3
    measured(
        f"{a_message:.0f} function calls per message; a flooded cycle makes {busy / moving:.1f}"
        " times the calls of a quiet cycle; times are measured by benchmarks.reactions"
    )


@pytest.mark.fault(10)
def test_a_flood_of_emergency_messages_causes_one_stop_and_no_late_cycle(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    flood = {"kind": "emergency", "joint": "axis2", "at_cycle": AT, "count": 500}
    run = serve(drives=[flood]).move(motion)
    assert run.reason.code is StopCode.EMERGENCY
    assert run.quick_stop_cycle() == AT
    run.assert_at_rest()
    came = sum(f.can_id == 0x082 for f in run.frames)
    assert came > 100
    assert len(run.notes) <= 3
    assert np.unique(np.diff(run.rows["cycle"].astype(int))).tolist() == [1]
    assert run.rows["lateness_s"].max() < 1e-6
    measured(f"{came} messages: 1 quick stop within 1 T, {len(run.notes)} notes, 0 late cycles")


@pytest.mark.fault(11)
@pytest.mark.parametrize("timeout_ms", range(93, 101))
def test_a_lost_heartbeat_stops_all_axes(
    serve: Any, motion: MotionSamples, loaded: LoadedCell, timeout_ms: int, measured: Measured
) -> None:
    """The timeouts end at different phases of the cycle."""
    update = {"drive_heartbeat_timeout_ms": timeout_ms}
    safety = loaded.config.drive_safety.model_copy(update=update)
    rig = serve(drives=[{"kind": "heartbeat_stops", "joint": "axis1", "at_cycle": AT}])
    run = rig.move(motion, config=rig.config.model_copy(update={"drive_safety": safety}))
    assert (run.reason.code, run.reason.joint) == (StopCode.HEARTBEAT_LOST, "axis1")
    stop_s = max(run.quick_stops().values())
    last_s = max(f.time_s for f in run.frames if f.can_id == 0x701 and f.time_s < stop_s)
    allowed_s = timeout_ms / 1000.0 + T
    assert allowed_s - T - 0.001 < stop_s - last_s <= allowed_s
    run.assert_at_rest()
    measured(
        f"quick stop {1e3 * (stop_s - last_s):.1f} ms after the last heartbeat,"
        f" {1e3 * allowed_s:.0f} allowed"
    )


@pytest.mark.fault(13)
def test_nothing_moves_when_power_returns_after_an_emergency_stop(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    rig = serve(drives=[{"kind": "motor_power_lost", "at_cycle": AT, "duration_s": 0.05}])
    run = rig.move(motion)
    assert run.reason.code is StopCode.NOT_ENABLED
    assert run.quick_stop_cycle() == AT
    lost_s = run.syncs_s[AT - 1]
    assert run.motion_frames_after(lost_s + 1e-3) == []
    assert run.truth.speed_after(lost_s + 0.3) < 1e-3
    assert not any(map(any, run.truth.powered[run.truth.at(lost_s + 0.001) :]))
    cycles = run.quick_stop_cycle() - AT + 1
    again = rig.move(motion)
    assert again.reason is None
    assert again.error is None
    far = first_set_point_distance_counts(again)
    assert far <= 1.0
    assert np.abs(again.rows["velocity_command"][0]).max() < 0.02
    measured(
        f"0 motion frames, quick stop in {cycles} T; first set-point of the next motion"
        f" {far:.2f} counts from the position"
    )


def first_set_point_distance_counts(run: Any) -> float:
    """Return the largest distance between an axis's first set-point and its position before it
    [counts].
    """
    rows = run.rows
    far = []
    for axis in range(3):
        counts, position = rows["position_counts"][:, axis], rows["position"][:, axis]
        per_rad = (counts[300] - float(counts[0])) / (position[300] - position[0])
        wanted = counts[0] + per_rad * (rows["target_position"][0, axis] - position[0])
        last = [
            f
            for f in run.frames
            if f.can_id == 0x181 + axis and f.time_s < rows["time_s"][0] and len(f.data) == 8
        ][-1]
        far.append(abs(wanted - int.from_bytes(last.data[2:6], "little", signed=True)))
    return max(far)


@pytest.mark.fault(13)
def test_no_queued_set_point_moves_an_axis_when_power_returns(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    """While all drives are off, the adapter stores frames; it sends them when power returns."""
    away = {"at_cycle": AT, "duration_s": 1.5}
    rig = serve(
        drives=[{"kind": "supply_lost", **away}],
        bus=[{"kind": "no_acknowledge", "queue": 10, **away}],
    )
    run = rig.move(motion)
    assert run.reason.code is StopCode.MISSED_FRAMES
    off_s = run.syncs_s[AT - 2] + T
    with rig.session() as cell:
        cell.clock.sleep_until(cell.clock.now_s() + 2.0)
    frames = rig.frames()
    back_s = min(f.time_s for f in frames if f.can_id == 0x701 and f.time_s > off_s + 1.0)
    released = [f for f in frames if 0x201 <= f.can_id <= 0x203 and f.time_s > off_s + 1e-3]
    assert released, "the adapter queued no frame, so that the test proves nothing"
    moving = [f for f in released if f.word == 0x000F]
    assert moving == []
    assert rig.truth.speed_after(back_s) < 1e-6
    assert not any(rig.truth.powered[-1])
    measured(f"{len(released)} queued commands were sent after power return; none moves an axis")


@pytest.mark.fault(14)
def test_a_stuck_encoder_stops_the_motion(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    run = serve(drives=[{"kind": "stuck_encoder", "joint": "axis1", "at_cycle": AT}]).move(motion)
    assert (run.reason.code, run.reason.joint) == (StopCode.STUCK_ENCODER, "axis1")
    cycles = run.quick_stop_cycle() - AT + 1
    assert cycles <= 8
    run.assert_at_rest()
    measured(f"quick stop in {cycles} T")


@pytest.mark.fault(14)
def test_a_blocked_axis_stops_the_motion_while_its_torque_rises(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    run = serve(drives=[{"kind": "blocked", "joint": "axis3", "at_cycle": AT}]).move(motion)
    assert run.reason.joint == "axis3"
    assert run.reason.code in (StopCode.STUCK_ENCODER, StopCode.FOLLOWING_ERROR)
    cycles = run.quick_stop_cycle() - AT + 1
    assert cycles <= 8
    measured(f"blocked: {run.reason.code.name.lower()} after {cycles} T")


@pytest.mark.fault(15)
def test_an_axis_that_runs_the_wrong_way_is_stopped_within_the_allowed_travel(
    serve: Any, motion: MotionSamples, loaded: LoadedCell, measured: Measured
) -> None:
    run = serve(drives=[{"kind": "reversed", "joint": "axis1", "at_cycle": AT}]).move(motion)
    assert (run.reason.code, run.reason.joint) == (StopCode.FOLLOWING_ERROR, "axis1")
    rows, rules = run.rows, loaded.config.supervision
    error = np.abs(rows["target_position"] - rows["position"])[:, 0]
    line = rules.following_error_min_rad + rules.following_error_per_velocity_s * np.abs(
        rows["target_velocity"][:, 0]
    )
    beyond = np.flatnonzero(error > line)
    stop = int(np.flatnonzero(~rows["velocity_command"].any(axis=1) & (error > line))[0])
    cycles = stop - int(beyond[0]) + 1
    assert cycles <= 3
    stop_s = min(run.quick_stops().values())
    at, end = run.truth.at(stop_s - T), len(run.truth.time_s) - 1
    speed = float(np.abs([v[0] for v in run.truth.velocity[at:]]).max())
    travel = abs(run.truth.position[end][0] - run.truth.position[at][0])
    allowed = speed * 4 * T + 0.5 * speed * ramp_time_s(loaded, speed)
    assert travel <= allowed
    run.assert_at_rest()
    measured(
        f"quick stop {cycles} T after the error exceeds its limit; travel {travel:.4f} rad,"
        f" {allowed:.4f} allowed"
    )


@pytest.mark.fault(15)
def test_an_axis_that_ignores_the_quick_stop_loses_its_power(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    deaf = {"kind": "ignores_quick_stop", "joint": "axis1", "at_cycle": AT}
    fault = {"kind": "emergency", "joint": "axis2", "at_cycle": AT}
    run = serve(drives=[deaf, fault]).move(motion)
    assert run.reason.code is StopCode.EMERGENCY
    assert any("did not decelerate axis1" in note for note in run.notes)
    rest_s = run.assert_at_rest()
    assert rest_s < 0.2
    off = next(f for f in run.frames if f.can_id == 0x201 and f.word == 0 and f.time_s > 1.0)
    cycles = run.cycle(off.time_s) - AT
    assert math.isclose(cycles, 10, abs_tol=2)
    measured(f"power off {cycles} T after the ignored quick stop")
