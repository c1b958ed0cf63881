"""The exit codes of the command line, and the errors and stops that lead to them."""

from __future__ import annotations

import signal
from enum import IntEnum

from acquisition.supervision.stop_reason import StopCode
from config import errors


class ExitCode(IntEnum):
    """Exit status of the program."""

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
"""Exit codes of stops; all other stops are limit or safety stops (`STOPPED`)."""


def exit_code_of_stop(code: StopCode, interrupted_by: signal.Signals | None) -> ExitCode:
    """Return the exit code of a motion that was stopped.

    Args:
        code: Code of the stop reason.
        interrupted_by: Signal that stopped the motion: SIGINT gives 130, SIGTERM and SIGHUP give
            143. None if no signal arrived.
    """
    if code is StopCode.INTERRUPTED and interrupted_by not in (None, signal.SIGINT):
        return ExitCode.TERMINATED
    return _BY_STOP.get(code, ExitCode.STOPPED)


def exit_code_of(error: errors.RidDaqError) -> ExitCode:
    """Return the exit code of an error."""
    for kind, code in _BY_ERROR:
        if isinstance(error, kind):
            return code
    return ExitCode.VERDICT_FAILED
