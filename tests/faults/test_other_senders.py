"""Other nodes that send a drive's answers or unknown identifiers (docs/faults.md, rows 7, 49)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from acquisition.motion.samples import MotionSamples
from acquisition.supervision.stop_reason import StopCode
from config.errors import DeviceTimeoutError
from rid_daq.preflight.bus_check import sender_lines

AT = 230
"""A cycle in which every axis moves."""
Measured = Callable[[str], None]

STRANGERS_S = 8.0
UNKNOWN_SENDER = {"identifier": 0x3F1, "at_s": STRANGERS_S + 0.04}
FALSE_ANSWERS = {
    "torque": {"torque_permille": 150},
    "a little off": {"position_counts": 300},
    "far off": {"position_counts": 200_000},
}


@pytest.mark.fault(49)
@pytest.mark.parametrize("false_answer", FALSE_ANSWERS)
@pytest.mark.parametrize("joint", ["axis1", "axis3"], ids=["first on the bus", "last on the bus"])
def test_a_foreign_node_that_answers_before_the_drive_stops_the_motion(
    serve: Any, motion: MotionSamples, joint: str, false_answer: str, measured: Measured
) -> None:
    spoof = {
        "kind": "spoof",
        "joint": joint,
        "at_cycle": AT,
        "lasting": True,
        **FALSE_ANSWERS[false_answer],
    }
    run = serve(bus=[spoof]).move(motion)
    assert (run.reason.code, run.reason.joint) == (StopCode.SECOND_ANSWERS, joint)
    node = int(joint[-1])
    assert f"node {node}" in run.reason.text
    assert f"18{node}h" in run.reason.text
    cycles = run.quick_stop_cycle() - AT + 1
    assert cycles <= 4
    stop_s = min(run.quick_stops().values())
    assert not run.motion_frames_after(stop_s)
    assert np.abs(run.truth.velocity[-1]).max() < 1e-3
    assert not any(run.truth.powered[-1])
    streamed = run.rows[run.rows["sample_index"] >= 0]
    false_rows = streamed[-cycles:]
    used = int(false_rows["valid"][:, node - 1].sum())
    assert used <= 1, "at most one false answer is used"
    steered = np.abs(np.diff(streamed["velocity_command"][:-1, node - 1])[-cycles:]).max()
    assert steered < 0.05, "a false position steered the axis"
    assert any(f"{joint}: node {node} answered twice" in note for note in run.notes)
    measured(f"{false_answer}, {joint}: quick stop in cycle {cycles}, {used} false answers used")


@pytest.mark.fault(49)
def test_slowly_drifting_false_positions_do_not_steer_the_axis(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    """The false positions do not jump: without the guard against them, the axis would follow."""
    creeping = [
        {"kind": "spoof", "joint": "axis2", "at_cycle": AT + k, "position_counts": 40 * (k + 1)}
        for k in range(60)
    ]
    honest, run = serve().move(motion), serve(bus=creeping).move(motion)
    assert run.reason.code is StopCode.SECOND_ANSWERS
    stop_s = min(run.quick_stops().values())
    true, undisturbed = (each.truth.position[each.truth.at(stop_s)][1] for each in (run, honest))
    assert abs(true - undisturbed) < 1e-3
    cycles = run.quick_stop_cycle() - AT + 1
    measured(
        f"drifting false positions: quick stop in {cycles} T,"
        f" axis {1e3 * abs(true - undisturbed):.2f} mrad off at that time"
    )


@pytest.mark.fault(49)
def test_identical_second_answers_are_tolerated_up_to_a_limit(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    run = serve(
        bus=[{"kind": "duplicate", "joint": "axis2", "at_cycle": AT, "lasting": True}]
    ).move(motion)
    assert (run.reason.code, run.reason.joint) == (StopCode.SECOND_ANSWERS, "axis2")
    cycles = run.quick_stop_cycle() - AT + 1
    assert 20 <= cycles <= 21
    moved = run.rows["sample_index"] >= 0
    assert run.rows["valid"][moved][:-1].all(), "duplicate answers do not make values invalid"
    run.assert_at_rest()
    measured(f"identical second answers in every cycle: quick stop in cycle {cycles}")


@pytest.mark.fault(49)
def test_a_single_differing_second_answer_marks_one_value(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    spoof = {"kind": "spoof", "joint": "axis1", "at_cycle": AT, "position_counts": 300}
    run = serve(bus=[spoof]).move(motion)
    assert run.reason is None
    assert np.argwhere(run.rows["valid"] == 0)[:, 1].tolist() == [0]
    (note,) = run.notes
    assert note.startswith("axis1: node 1 answered twice in 1 cycle, 1 with different data")
    measured("one second answer that differs: 1 value marked invalid, reported at the end")


@pytest.mark.fault(49)
@pytest.mark.fault(7)
def test_frames_of_unknown_identifiers_are_reported_at_the_end(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    strange = {"kind": "strange", "identifier": 0x3F1, "at_cycle": AT, "count": 40}
    run = serve(bus=[strange]).move(motion)
    assert run.reason is None
    (note,) = run.notes
    assert note.startswith("40 frames came with identifiers")
    measured("40 unknown frames: reported at the end")


@pytest.mark.fault(49)
def test_a_second_device_with_a_drives_identifier_is_refused_before_motion(
    serve: Any, motion: MotionSamples, measured: Measured
) -> None:
    spoof = {"kind": "spoof", "joint": "axis3", "lasting": True, "position_counts": 5}
    run = serve(bus=[spoof]).move(motion)
    assert isinstance(run.error, DeviceTimeoutError)
    assert run.error.refusal == "RID-DRIVE-NOT-STARTED"
    assert {"axis3:", "250"} <= set(str(run.error).split())
    assert not any(map(any, run.truth.powered))
    measured("a spoofing device before the motion: refused before power on")


@pytest.mark.fault(49)
@pytest.mark.parametrize(
    ("fault", "verdicts"),
    [
        ({}, ["ok"] * 3),
        ({"kind": "duplicate", "count": 3}, ["ok"] * 3),
        ({"kind": "duplicate", "joint": "axis2", "lasting": True}, ["ok", "red", "ok"]),
        (
            {"kind": "spoof", "joint": "axis1", "at_frame": 20, "torque_permille": 1},
            ["red", "ok", "ok"],
        ),
        ({"kind": "strange", "count": 3, **UNKNOWN_SENDER}, ["ok"] * 3 + ["shown"]),
        ({"kind": "strange", "count": 90, **UNKNOWN_SENDER}, ["ok"] * 3 + ["red"]),
    ],
    ids=["none", "one copy each", "copies", "one deviation", "unknown", "many unknown"],
)
def test_the_preflight_reports_foreign_senders(
    serve: Any, fault: dict[str, Any], verdicts: list[str], measured: Measured
) -> None:
    rig = serve(bus=[fault] if fault else [])
    cycles = 60
    with rig.session() as cell:
        axes, clock = cell.axes, cell.clock
        axes.bring_up()
        clock.sleep_until(STRANGERS_S)
        axes.start()
        for _ in range(cycles):
            clock.sleep_until(clock.now_s() + 0.001)
            axes.exchange()
            axes.send_heartbeat(clock.now_s())
            axes.quick_stop()
        lines = sender_lines(cell, cycles)
    assert [line.verdict for line in lines] == verdicts
    red = [line for line in lines if line.verdict == "red"]
    assert all(line.next_action for line in red)
    measured(f"preflight, fault {fault.get('kind', 'none')}: {len(red)} of {len(lines)} lines red")
