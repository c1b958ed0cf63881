"""Progress and state of a motion in words, for the terminal and the live page."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from acquisition.motion.samples import MotionSamples, Phase
from acquisition.processing.recording_tally import RecordingTally
from acquisition.task.joint_values import JointValues
from acquisition.task.states import TaskProgress, TaskState

_STATES = {
    TaskState.STARTING: "starting",
    TaskState.BRING_UP: "configuring the drives",
    TaskState.ENABLING: "switching the drives on",
    TaskState.STOPPING: "stopping",
    TaskState.FINISHED: "power off",
}
_PHASES = {
    Phase.APPROACH: "approach",
    Phase.RUN_IN: "run-in",
    Phase.TRANSIENT: "transient period",
    Phase.MAIN: "measuring",
    Phase.RUN_OUT: "run-out",
    Phase.HOLD: "hold",
}


def describe_state(progress: TaskProgress) -> str:
    """Return the activity of the cyclic task."""
    if progress.state is TaskState.MOVING:
        return _PHASES[progress.phase]
    return _STATES[progress.state]


def motion_total(samples: MotionSamples | None, *, held: bool = False) -> tuple[float | None, str]:
    """Return the length of a motion and the unit in which it is counted.

    The unit is periods or seconds. A motion without `samples` has no known length (None) and is
    counted in cycles if keys are `held`, else in points.
    """
    if samples is None:
        return None, "cycles" if held else "points"
    if samples.samples_per_period is None:
        return samples.duration_s, "s"
    return len(samples) / samples.samples_per_period, "periods"


def progress_callback(
    samples: MotionSamples | None,
    joint_names: Sequence[str],
    show: Callable[[float, str], None],
    watched: Callable[[], str],
    seen_enough: Callable[[], bool] = lambda: False,
) -> Callable[[TaskProgress], None]:
    """Return a function that shows the cyclic task's progress in the unit of `motion_total`.

    Args:
        samples: The motion; None if no rows are planned.
        joint_names: Base to flange.
        show: Called with the amount done and a line of status.
        watched: Returns the live estimates as text; empty if nothing is estimated.
        seen_enough: Returns True if enough was measured, so that the motion ends early. The run-out
            then follows the current period, and the omitted rows do not count as done.
    """
    done = 0.0

    def update(progress: TaskProgress) -> None:
        nonlocal done
        row = progress.sample_index
        left_out = progress.phase is Phase.RUN_OUT and seen_enough()
        if row >= 0 and not left_out:
            done = float(row) if samples is None else _amount_done(samples, row)
        line = describe_state(progress) + (": enough was measured" if left_out else "")
        if progress.state is TaskState.MOVING:
            load = "" if progress.joints is None else describe_load(progress.joints, joint_names)
            line = "; ".join(filter(None, (line, load, watched())))
        show(done, line)

    return update


def describe_load(joints: JointValues, names: Sequence[str]) -> str:
    """Return torque and following error relative to their limits, each for the worst joint."""
    torque, error = int(joints.torque_share.argmax()), int(joints.following_error_share.argmax())
    return (
        f"torque {joints.torque_share[torque]:.0%} ({names[torque]}), following error"
        f" {joints.following_error_share[error]:.0%} ({names[error]}) of the limit"
    )


def describe_end_position(tally: RecordingTally) -> str:
    """Return a sentence with the position in the motion at which a recording ended."""
    if tally.last_row < 0 or tally.head.sample_period_s is None:
        return "The motion had not started."
    into_s = tally.last_row * tally.head.sample_period_s
    begun = tally.cutter.periods if tally.last_phase is Phase.MAIN else 0
    period = f", period {begun}" if begun else ""
    return f"The motion ended {into_s:.2f} s after its start ({_PHASES[tally.last_phase]}{period})."


def _amount_done(samples: MotionSamples, row: int) -> float:
    per_unit = samples.samples_per_period or 1.0 / samples.sample_period_s
    return row / per_unit
