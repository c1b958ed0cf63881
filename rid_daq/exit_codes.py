"""The exit codes of the command line, and what leads to which."""

from __future__ import annotations

from enum import IntEnum

from config.errors import (
    ConfigError,
    DataQualityError,
    DriverError,
    EstimationError,
    LockedError,
    PreflightError,
    RecordingError,
    RidDaqError,
    SafetyStop,
)


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


_BY_ERROR: tuple[tuple[type[RidDaqError], ExitCode], ...] = (
    (ConfigError, ExitCode.USAGE),
    (PreflightError, ExitCode.PREFLIGHT),
    (DriverError, ExitCode.COMMUNICATION),
    (SafetyStop, ExitCode.STOPPED),
    (DataQualityError, ExitCode.DATA_QUALITY),
    (EstimationError, ExitCode.DATA_QUALITY),
    (RecordingError, ExitCode.STORAGE),
    (LockedError, ExitCode.LOCKED),
)


def exit_code_of(error: RidDaqError) -> ExitCode:
    """Return the exit code that an error of the tree stands for."""
    for kind, code in _BY_ERROR:
        if isinstance(error, kind):
            return code
    return ExitCode.VERDICT_FAILED
