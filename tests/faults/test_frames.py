"""Lost, late, duplicate, damaged and unknown frames (docs/faults.md, rows 1 to 7)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from acquisition.motion.samples import MotionSamples
from acquisition.supervision.stop_reason import StopCode
from config.errors import ProtocolError
from drivers.servo.axes import CanServoAxes

T = 0.008
AT = 230
"""A cycle in which every axis moves."""
Measured = Callable[[str], None]


class AxesStore:
    """Hook that stores the axes of a session, to read their frame counters afterwards."""

    axes: CanServoAxes

    def __call__(self, cell: Any, _control: object) -> None:
        self.axes = cell.axes


@pytest.mark.fault(1)
def test_one_lost_answer_marks_one_row_and_the_motion_continues(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    rig = serve(bus=[{"kind": "drop", "joint": "axis2", "at_cycle": AT}])
    run = rig.move(motion)
    assert run.error is None
    assert run.reason is None
    ((row, axis),) = np.argwhere(run.rows["valid"] == 0).tolist()
    assert axis == 1
    before, held = run.rows["position"][row - 1 : row + 1, 1]
    assert held == before
    streamed = run.rows["sample_index"][run.rows["sample_index"] >= 0]
    assert streamed.tolist() == list(range(len(motion)))
    before, at, after = run.rows["velocity_command"][row - 1 : row + 2, 1]
    kick = abs(at - 0.5 * (before + after))
    gain_per_s = 15.0
    assert kick < 0.1 * gain_per_s * T * abs(at), (
        "the position loop reacted to the repeated position"
    )
    measured(
        f"1 of {3 * len(run.rows)} values marked invalid, 0 rows lost, command {kick:.1g} rad/s off"
    )


@pytest.mark.fault(2)
@pytest.mark.parametrize("joint", ["axis1", "axis3"])
def test_three_lost_answers_in_a_row_stop_all_axes(
    serve: Any, motion: MotionSamples, joint: str, measured: Measured
) -> None:
    rig = serve(bus=[{"kind": "drop", "joint": joint, "at_cycle": AT, "count": 3}])
    run = rig.move(motion)
    assert (run.reason.code, run.reason.joint) == (StopCode.MISSED_FRAMES, joint)
    cycles = run.quick_stop_cycle() - AT + 1
    assert cycles == 3
    rest_s = run.assert_at_rest()
    measured(f"quick stop in {cycles} T; at rest {1e3 * rest_s:.0f} ms later")


@pytest.mark.fault(3)
def test_randomly_lost_answers_are_counted_exactly_and_the_motion_continues(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    rig = serve(bus=[{"kind": "drop", "probability": 0.01}], seed=4)
    run = rig.move(motion)
    assert run.reason is None
    assert run.error is None
    rows = run.rows
    answered: dict[int, list[float]] = {
        f.can_id: [] for f in run.frames if 0x181 <= f.can_id <= 0x183
    }
    for frame in run.frames:
        if frame.can_id in answered:
            answered[frame.can_id].append(frame.time_s)
    for axis in range(3):
        times_s = np.array(answered[0x181 + axis])
        first = np.searchsorted(times_s, rows["time_s"])
        came = np.array(
            [
                i < len(times_s) and times_s[i] < t + T
                for i, t in zip(first, rows["time_s"], strict=True)
            ]
        )
        np.testing.assert_array_equal(rows["valid"][:, axis] == 1, came)
    lost = int((rows["valid"] == 0).sum())
    assert lost > 5
    measured(f"{lost} of {rows['valid'].size} answers lost, {lost} marked invalid")


@pytest.mark.fault(4)
def test_a_duplicate_answer_is_ignored(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    keep = AxesStore()
    rig = serve(bus=[{"kind": "duplicate", "at_cycle": AT, "count": 30}])
    run = rig.move(motion, keep)
    assert run.reason is None
    assert run.rows["valid"].all()
    assert np.unique(np.diff(run.rows["cycle"].astype(int))).tolist() == [1]
    found = keep.axes.cyclic.duplicate_frames + keep.axes.answers.late_frames
    assert found == 30
    measured(f"{found} of 30 copies counted, 0 additional rows")


@pytest.mark.fault(5)
@pytest.mark.parametrize(("delay", "after"), [(0.8, 1), (1.2, 2)])
def test_the_third_cycle_with_late_answers_stops_the_motion(
    serve: Any, motion: MotionSamples, delay: float, after: int, measured: Measured
) -> None:
    late = [
        {"kind": "delay", "joint": "axis2", "at_cycle": AT + wait, "delay_s": delay * T}
        for wait in (0, 10, 20)
    ]
    run = serve(bus=late).move(motion)
    assert run.reason.code is StopCode.LATE_FRAMES
    cycles = run.quick_stop_cycle() - (AT + 20)
    assert cycles == after
    run.assert_at_rest()
    measured(f"third late answer, {delay:g} T late: quick stop {cycles} T after its SYNC")


@pytest.mark.fault(5)
def test_each_of_two_late_answers_is_marked_and_the_motion_continues(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    late = [
        {"kind": kind, "joint": "axis2", "at_cycle": AT + wait, **more}
        for kind, wait, more in (("delay", 0, {"delay_s": 1.5 * T}), ("reorder", 10, {}))
    ]
    keep = AxesStore()
    run = serve(bus=late).move(motion, keep)
    assert run.reason is None
    assert int((run.rows["valid"] == 0).sum()) == 2
    measured("1 late and 1 reordered answer: 2 values marked invalid, the motion continues")


@pytest.mark.fault(6)
@pytest.mark.parametrize(("count", "stops"), [(1, False), (2, True)])
def test_one_flipped_bit_marks_a_value_and_two_in_a_row_stop_the_motion(
    serve: Any, motion: MotionSamples, count: int, stops: bool, measured: Measured
) -> None:
    script = {"kind": "corrupt", "joint": "axis1", "at_cycle": AT, "count": count, "bit": 36}
    run = serve(bus=[script]).move(motion)
    if not stops:
        assert run.reason is None
        assert np.argwhere(run.rows["valid"] == 0)[:, 1].tolist() == [0]
        measured("1 flipped bit: 1 value marked invalid")
        return
    assert (run.reason.code, run.reason.joint) == (StopCode.IMPLAUSIBLE_POSITION, "axis1")
    cycles = run.quick_stop_cycle() - AT + 1
    assert cycles == 2
    run.assert_at_rest()
    measured(f"2 flipped bits in a row: quick stop in {cycles} T")


@pytest.mark.fault(7)
def test_an_answer_of_the_wrong_length_stops_the_motion(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    script = {"kind": "wrong_length", "joint": "axis2", "at_cycle": AT, "length": 5}
    run = serve(bus=[script]).move(motion)
    assert "5 bytes, but 8 are mapped" in run.reason.text
    assert run.quick_stop_cycle() == AT
    run.assert_at_rest()
    measured("a short answer: quick stop in the same cycle")


@pytest.mark.fault(7)
def test_frames_of_unknown_identifiers_are_counted_and_ignored(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    keep = AxesStore()
    strange = {"kind": "strange", "identifier": 0x3F1, "at_cycle": AT, "count": 40}
    run = serve(bus=[strange]).move(motion, keep)
    assert run.reason is None
    assert run.rows["valid"].all()
    assert keep.axes.watch.unexpected_frames == 40
    measured("40 of 40 unknown frames counted, the motion continues")


@pytest.mark.fault(7)
def test_a_node_id_of_two_devices_is_refused_before_motion(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    twin = {"kind": "duplicate", "frames": "heartbeat", "joint": "axis3"}
    run = serve(bus=[{**twin, "at_frame": 2}]).move(motion)
    assert isinstance(run.error, ProtocolError)
    assert run.error.refusal == "RID-DRIVE-NODE-TWICE"
    assert "axis3" in str(run.error)
    assert not any(map(any, run.truth.powered))
    measured("two devices with one node id: refused before power on")


@pytest.mark.fault(7)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("when", [{}, {"at_cycle": AT}], ids=["bring-up", "motion"])
def test_damaged_frames_of_any_kind_end_in_a_typed_error(
    serve: Any, motion: MotionSamples, seed: int, when: dict[str, int], measured: Measured
) -> None:
    """Flip bits and change lengths of all kinds of frames.

    The motion must end with a stop reason or a `RidDaqError`, without power and at rest. Every
    other exception fails this test.
    """
    damage = [
        {"kind": "corrupt", "frames": "any", "probability": 0.02, **when},
        {"kind": "wrong_length", "frames": "any", "probability": 0.01, "length": seed, **when},
    ]
    run = serve(bus=damage, seed=seed).move(motion)
    assert run.reason is not None or run.error is not None
    assert not any(run.truth.powered[-1])
    assert np.abs(run.truth.velocity[-1]).max() < 1e-3
    how = run.error if run.reason is None else run.reason.code
    measured(f"damaged frames {'in motion' if when else 'at bring-up'}: {type(how).__name__}")
