"""Error classes: the errors that rid-daq reports to its user.

The program turns such an error into one message and an exit code. A message says what is wrong,
where, and, if it is known, what to do about it.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class RidDaqError(Exception):
    """Base class of all errors that a user may see; its notes are part of its text.

    Args:
        text: What is wrong, where and, if it is known, what to do.
        code: Stable name of the error, `RID-AREA-NAME`, as declared in
            `config/bundled/error_codes`. An error that is raised again with more text keeps its
            code (``code=error.refusal``).
    """

    def __init__(self, text: str = "", *, code: str = "") -> None:
        super().__init__(text)
        self.refusal = code

    def __str__(self) -> str:
        """Return the error's text, followed by its notes."""
        return with_notes(super().__str__(), self)


class ConfigError(RidDaqError):
    """A file, an argument or the installation does not allow what was requested.

    The text names the place in the file, or the argument, if one of them is the cause.
    """


class LimitError(ConfigError):
    """A motion, path or payload exceeds the limits of its robot, and is refused."""


class DriverError(RidDaqError):
    """Communication with a device failed, or the device reported a problem."""


class TransportError(DriverError):
    """A bus or port cannot be opened, or was lost."""


class DeviceTimeoutError(DriverError):
    """A device did not answer in time."""


class ProtocolError(DriverError):
    """A device violated its protocol, or refused a request."""


class DeviceFaultError(DriverError):
    """A device reported a fault."""


class SafetyStop(RidDaqError):  # noqa: N818 - a stop is an outcome, not a defect
    """A stop was ordered, or a command cannot be sent; the axes are stopped."""


class PreflightError(RidDaqError):
    """A preflight check failed."""


class LockedError(RidDaqError):
    """Another session, a service or a client holds what is needed, such as the cell."""


class ServiceError(RidDaqError):
    """A service refused a request, or cannot be reached."""


class RecordingError(RidDaqError):
    """A file, recording or run folder cannot be written or read."""


class ShortageError(RidDaqError):
    """The computer is short of memory, disk space, open files or processes."""


class DataQualityError(RidDaqError):
    """The recorded data are not good enough for the next step."""


class EstimationError(RidDaqError):
    """An estimate cannot be computed from the data."""


def missing_library(what: str, extra: str) -> ConfigError:
    """Return the error for a file format whose library is not installed.

    Args:
        what: The file and its format.
        extra: Extra of rid-daq that installs the library.
    """
    return ConfigError(
        f"{what} needs a library that is not installed: install rid-daq with the extra {extra}"
        " (see `rid-daq docs install`)",
        code="RID-INSTALL-LIBRARY",
    )


def with_notes(text: str, error: BaseException) -> str:
    """Return a text about an error, followed by the error's notes."""
    return "; ".join(filter(None, (text, *getattr(error, "__notes__", ()))))


@contextmanager
def system_errors(kind: type[RidDaqError], what: str, *, code: str) -> Iterator[None]:
    """Turn an OSError into an error of class `kind`; its text is `what` and the system's reason."""
    try:
        yield
    except OSError as error:
        raise kind(f"{what}: {error.strerror}", code=code) from error
