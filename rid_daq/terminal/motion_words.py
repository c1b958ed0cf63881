"""What the parts of a motion are called, on the terminal and on the live page."""

from __future__ import annotations

from acquisition.motion.phase import Phase
from acquisition.task.control_block import Progress, TaskState

_STATES = {
    TaskState.STARTING: "starting",
    TaskState.BRING_UP: "configuring the drives",
    TaskState.ENABLING: "switching the drives on",
    TaskState.STOPPING: "stopping",
    TaskState.FINISHED: "power off",
}
PHASES = {
    Phase.APPROACH: "approach",
    Phase.RUN_IN: "run-in",
    Phase.TRANSIENT: "transient period",
    Phase.MAIN: "measuring",
    Phase.RUN_OUT: "run-out",
    Phase.HOLD: "hold",
}


def motion_words(progress: Progress) -> str:
    """Return what the cyclic task is doing."""
    if progress.state is TaskState.MOVING:
        return PHASES[progress.phase]
    return _STATES[progress.state]
