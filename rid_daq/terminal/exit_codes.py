"""The exit codes of the command line, and what leads to which."""

from __future__ import annotations

import signal
from enum import IntEnum

from acquisition.supervision.stop_reason import StopCode
from config import errors


class ExitCode(IntEnum):
    """What the program's exit status says to a script."""

    DONE = 0
    VERDICT_FAILED = 1
    USAGE = 2
    PREFLIGHT = 3
    COMMUNICATION = 4
    STOPPED = 5
    DATA_QUALITY = 6
    STORAGE = 7
    LOCKED = 8
    INTERRUPTED = 130
    TERMINATED = 143


_BY_ERROR: tuple[tuple[type[errors.RidDaqError], ExitCode], ...] = (
    (errors.LimitError, ExitCode.PREFLIGHT),
    (errors.ConfigError, ExitCode.USAGE),
    (errors.PreflightError, ExitCode.PREFLIGHT),
    (errors.DriverError, ExitCode.COMMUNICATION),
    (errors.SafetyStop, ExitCode.STOPPED),
    (errors.DataQualityError, ExitCode.DATA_QUALITY),
    (errors.EstimationError, ExitCode.DATA_QUALITY),
    (errors.RecordingError, ExitCode.STORAGE),
    (errors.ShortageError, ExitCode.STORAGE),
    (errors.LockedError, ExitCode.LOCKED),
    (errors.ServiceError, ExitCode.COMMUNICATION),
)


_BY_STOP: dict[StopCode, ExitCode] = {
    StopCode.INTERRUPTED: ExitCode.INTERRUPTED,
    StopCode.PROGRAM_GONE: ExitCode.TERMINATED,
    StopCode.MISSED_FRAMES: ExitCode.COMMUNICATION,
    StopCode.LATE_FRAMES: ExitCode.COMMUNICATION,
    StopCode.SECOND_ANSWERS: ExitCode.COMMUNICATION,
    StopCode.DRIVE_RESTARTED: ExitCode.COMMUNICATION,
    StopCode.HEARTBEAT_LOST: ExitCode.COMMUNICATION,
    StopCode.BUS: ExitCode.COMMUNICATION,
    StopCode.RECORDER: ExitCode.STORAGE,
    StopCode.PLATE_LINE: ExitCode.COMMUNICATION,
    StopCode.PLATE_OVERLOAD: ExitCode.DATA_QUALITY,
    StopCode.POINTS_LOST: ExitCode.COMMUNICATION,
}
"""Every other stop is a limit or a safety stop."""


def exit_code_of_stop(code: StopCode, interrupted_by: signal.Signals | None) -> ExitCode:
    """Return the exit code of a motion that was stopped.

    Args:
        code: Why it was stopped.
        interrupted_by: The signal that came, where one did: SIGINT is 130, SIGTERM and SIGHUP are
            143.
    """
    if code is StopCode.INTERRUPTED and interrupted_by not in (None, signal.SIGINT):
        return ExitCode.TERMINATED
    return _BY_STOP.get(code, ExitCode.STOPPED)


def exit_code_of(error: errors.RidDaqError) -> ExitCode:
    """Return the exit code that an error of the tree stands for."""
    for kind, code in _BY_ERROR:
        if isinstance(error, kind):
            return code
    return ExitCode.VERDICT_FAILED
