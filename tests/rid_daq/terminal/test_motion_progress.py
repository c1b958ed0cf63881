from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.motion.samples import MotionSamples, Phase
from acquisition.processing.recording_tally import RecordingTally
from acquisition.recording.recording import Recording
from acquisition.task.joint_values import JointValues
from acquisition.task.states import TaskProgress, TaskState
from rid_daq.terminal.motion_progress import (
    describe_end_position,
    describe_state,
    motion_total,
    progress_callback,
)
from tests.builders.console_blocks import assert_shown

CYCLE_S = 0.01
PERIOD = 50


def motion(*, periodic: bool) -> MotionSamples:
    """Return a motion at rest.

    If `periodic`, it has one transient period and three measured ones.
    """
    rows = 4 * PERIOD
    phase = np.full(rows, Phase.MAIN, dtype=np.uint8)
    phase[:PERIOD] = Phase.TRANSIENT
    nothing = np.zeros((rows, 1))
    return MotionSamples(
        joint_names=("axis1",),
        sample_period_s=CYCLE_S,
        position=nothing,
        velocity=nothing,
        acceleration=nothing,
        phase=phase,
        samples_per_period=PERIOD if periodic else None,
        periods=3 if periodic else 0,
    )


def progress_at(row: int, state: TaskState = TaskState.MOVING) -> TaskProgress:
    return TaskProgress(state=state, phase=Phase.MAIN, sample_index=row, cycles=max(row, 0))


def recorded(rows: int) -> RecordingTally:
    samples = motion(periodic=True)
    recording = Recording(
        joint_names=("axis1",),
        time_s=np.arange(rows, dtype=np.float64) * CYCLE_S,
        position=samples.position[:rows],
        torque_nm=samples.position[:rows],
        valid=np.ones(rows, dtype=np.bool_),
        phase=samples.phase[:rows],
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=CYCLE_S,
        samples_per_period=PERIOD,
    )
    return RecordingTally(recording)


def test_a_motion_is_counted_in_periods_seconds_points_or_cycles() -> None:
    assert motion_total(motion(periodic=True)) == (4.0, "periods")
    total, unit = motion_total(motion(periodic=False))
    assert total == pytest.approx(1.99)
    assert unit == "s"
    assert motion_total(None) == (None, "points")
    assert motion_total(None, held=True) == (None, "cycles")


@pytest.mark.parametrize(
    ("samples", "done"),
    [(motion(periodic=True), 2.0), (motion(periodic=False), 1.0), (None, 100.0)],
)
def test_progress_is_shown_in_its_unit(samples: MotionSamples | None, done: float) -> None:
    shown: list[tuple[float, str]] = []
    update = progress_callback(samples, ("axis1",), lambda *what: shown.append(what), lambda: "")
    update(progress_at(-1, TaskState.BRING_UP))
    update(progress_at(100))
    update(progress_at(-1, TaskState.FINISHED))
    assert shown == [
        (0.0, "configuring the drives"),
        (pytest.approx(done), "measuring"),
        (pytest.approx(done), "power off"),
    ]


def test_periods_omitted_by_an_early_end_do_not_count_as_measured() -> None:
    shown: list[tuple[float, str]] = []
    samples, enough = motion(periodic=True), iter((False, True, True))
    update = progress_callback(
        samples, ("axis1",), lambda *what: shown.append(what), lambda: "", lambda: next(enough)
    )
    update(progress_at(100))
    run_out = TaskProgress(state=TaskState.MOVING, phase=Phase.RUN_OUT, sample_index=0, cycles=1)
    update(replace(run_out, sample_index=150))  # the motion was executed completely
    update(replace(run_out, sample_index=199))
    update(replace(run_out, sample_index=199))
    assert [done for done, _ in shown] == [2.0, 3.0, 3.0, 3.0]
    assert [line for _, line in shown] == [
        "measuring",
        "run-out",
        *["run-out: enough was measured"] * 2,
    ]


def test_an_estimate_is_shown_only_while_the_robot_moves() -> None:
    shown: list[str] = []
    update = progress_callback(
        None, ("axis1",), lambda _done, line: shown.append(line), lambda: "2 kg"
    )
    update(progress_at(-1, TaskState.ENABLING))
    update(progress_at(1))
    assert shown == ["switching the drives on", "measuring; 2 kg"]
    assert describe_state(progress_at(1, TaskState.STOPPING)) == "stopping"


def test_the_worst_joint_of_each_load_is_named() -> None:
    rest = np.zeros(2)
    joints = JointValues(
        time_s=0.0,
        position=rest,
        velocity=rest,
        torque=rest,
        torque_share=np.array([0.2, 0.5]),
        following_error=rest,
        following_error_share=np.array([0.1, 0.04]),
        valid=np.ones(2, dtype=np.bool_),
    )
    shown: list[str] = []
    update = progress_callback(
        None, ("axis1", "axis2"), lambda _done, line: shown.append(line), lambda: "sx3 ± 0.8 %"
    )
    update(replace(progress_at(1), joints=joints))
    assert_shown("watch-and-stop", "rid-daq record ir361 excitation.yaml", shown[0])


def test_the_time_of_a_stop_is_given_in_seconds_phase_and_period() -> None:
    assert describe_end_position(recorded(0)) == "The motion had not started."
    assert (
        describe_end_position(recorded(20))
        == "The motion ended 0.19 s after its start (transient period)."
    )
    assert (
        describe_end_position(recorded(120))
        == "The motion ended 1.19 s after its start (measuring, period 2)."
    )
