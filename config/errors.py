"""The error tree: everything that rid-daq raises on purpose.

The program catches `RidDaqError` alone and turns it into one message and an exit code. A message
says what is wrong, where, and what to do about it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class RidDaqError(Exception):
    """Root of every error that a user may see; its notes are part of its text.

    Args:
        text: What is wrong, where, and what to do.
        code: Stable name of the error, `RID-AREA-NAME`, as declared in
            `config/bundled/error_codes`; an error that is raised again with more text keeps it
            (``code=error.refusal``).
    """

    def __init__(self, text: str = "", *, code: str = "") -> None:
        super().__init__(text)
        self.refusal = code

    def __str__(self) -> str:
        """Return its text and its notes."""
        return with_notes(super().__str__(), self)


class ConfigError(RidDaqError):
    """A file or an argument is invalid. The text carries its position."""


class LimitError(ConfigError):
    """A motion asks for more than its robot may do. It is refused before anything moves."""


class DriverError(RidDaqError):
    """Something went wrong between the program and a device."""


class TransportError(DriverError):
    """A bus or port cannot be opened, or was lost."""


class DeviceTimeoutError(DriverError):
    """A device did not answer in time."""


class ProtocolError(DriverError):
    """A device answered what its protocol does not allow, or refused a request."""


class DeviceFaultError(DriverError):
    """A device reported a fault of its own."""


class SafetyStop(RidDaqError):  # noqa: N818 - a stop is what happened, not an error of the code
    """The supervisor stopped the motion; the drives are stopped and disabled."""


class PreflightError(RidDaqError):
    """A check before motion is red."""


class LockedError(RidDaqError):
    """Another session holds the cell."""


class ServiceError(RidDaqError):
    """A service refused what was asked of it, or cannot be reached."""


class RecordingError(RidDaqError):
    """A recording or run folder cannot be written or read."""


class ShortageError(RidDaqError):
    """The computer has too little of something: memory, room on a disk, open files, processes."""


class DataQualityError(RidDaqError):
    """What was recorded is not good enough to go on with."""


class EstimationError(RidDaqError):
    """An estimate cannot be computed from what was given."""


def with_notes(text: str, error: BaseException) -> str:
    """Return a text about an error, and what was noted about the error on its way."""
    return "; ".join(filter(None, (text, *getattr(error, "__notes__", ()))))


@contextmanager
def system_errors(kind: type[RidDaqError], what: str, *, code: str) -> Iterator[None]:
    """Raise what the operating system refuses as an error of a kind: `what`, and its reason."""
    try:
        yield
    except OSError as error:
        raise kind(f"{what}: {error.strerror}", code=code) from error
