"""How far a motion is and how it goes, in words: on the terminal and on the live page."""

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


def motion_words(progress: TaskProgress) -> str:
    """Return what the cyclic task is doing."""
    if progress.state is TaskState.MOVING:
        return _PHASES[progress.phase]
    return _STATES[progress.state]


def total_of(samples: MotionSamples | None, *, held: bool = False) -> tuple[float | None, str]:
    """Return how long a motion is and in what that is counted.

    Periods or seconds; points where they come from elsewhere, cycles where a key is `held`.
    """
    if samples is None:
        return None, "cycles" if held else "points"
    if samples.samples_per_period is None:
        return samples.duration_s, "s"
    return len(samples) / samples.samples_per_period, "periods"


def progress_shown(
    samples: MotionSamples | None,
    joint_names: Sequence[str],
    show: Callable[[float, str], None],
    watched: Callable[[], str],
    seen_enough: Callable[[], bool] = lambda: False,
) -> Callable[[TaskProgress], None]:
    """Return what shows the cyclic task's progress, counted as `total_of` counts.

    Args:
        samples: The motion; None where no rows are planned.
        joint_names: Base to flange.
        show: Takes how much is done, and a line about how it goes.
        watched: Says what is estimated meanwhile; empty where nothing is.
        seen_enough: Says whether the motion ends early: its run-out follows the period under way,
            and what it leaves out is not counted as done.
    """
    done = 0.0

    def update(progress: TaskProgress) -> None:
        nonlocal done
        row = progress.sample_index
        left_out = progress.phase is Phase.RUN_OUT and seen_enough()
        if row >= 0 and not left_out:
            done = float(row) if samples is None else _done(samples, row)
        line = motion_words(progress) + (": enough was measured" if left_out else "")
        if progress.state is TaskState.MOVING:
            load = "" if progress.joints is None else load_words(progress.joints, joint_names)
            line = "; ".join(filter(None, (line, load, watched())))
        show(done, line)

    return update


def load_words(joints: JointValues, names: Sequence[str]) -> str:
    """Say how much of their limits torque and following error take, each of the worst joint."""
    torque, error = int(joints.torque_share.argmax()), int(joints.following_error_share.argmax())
    return (
        f"torque {joints.torque_share[torque]:.0%} ({names[torque]}), following error"
        f" {joints.following_error_share[error]:.0%} ({names[error]}) of the limit"
    )


def place_words(tally: RecordingTally) -> str:
    """Say how far into the motion a recording goes."""
    if tally.last_row < 0 or tally.head.sample_period_s is None:
        return "The motion had not begun."
    into_s = tally.last_row * tally.head.sample_period_s
    begun = tally.cutter.periods if tally.last_phase is Phase.MAIN else 0
    period = f", period {begun}" if begun else ""
    return f"That was {into_s:.2f} s into the motion ({_PHASES[tally.last_phase]}{period})."


def _done(samples: MotionSamples, row: int) -> float:
    per_unit = samples.samples_per_period or 1.0 / samples.sample_period_s
    return row / per_unit
