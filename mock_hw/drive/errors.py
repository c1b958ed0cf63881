"""`ErrorLog`: active errors of a simulated drive, and their emergency messages (CiA 301, 7.2.7)."""

from __future__ import annotations

from drivers.canopen.emcy import Emergency
from mock_hw.drive.object_dictionary import ObjectDictionary
from mock_hw.drive.objects import ERROR_CODE, ERROR_HISTORY, ERROR_HISTORY_LENGTH, ERROR_REGISTER

HEARTBEAT_LOST = 0x8130
PDO_LENGTH = 0x8210
RPDO_TIMEOUT = 0x8250
FOLLOWING_ERROR = 0x8611
SYNC_LOST = 0x8700

_GENERIC_BIT = 0x01
_COMMUNICATION_BIT = 0x10
_PROFILE_BIT = 0x20


class ErrorLog:
    """Maintains error register (1001h), error history (1003h) and last error code (603Fh).

    Args:
        objects: The drive's objects.
    """

    def __init__(self, objects: ObjectDictionary) -> None:
        self._objects = objects
        self._active: set[int] = set()

    def enter(self, code: int) -> Emergency | None:
        """Add an error; return its emergency message, or None if the error is already active."""
        if code in self._active:
            return None
        self._active.add(code)
        objects = self._objects
        count = min(ERROR_HISTORY_LENGTH, objects[ERROR_HISTORY, 0] + 1)
        for number in range(count, 1, -1):
            objects[ERROR_HISTORY, number] = objects[ERROR_HISTORY, number - 1]
        objects[ERROR_HISTORY, 1] = code
        objects[ERROR_HISTORY, 0] = count
        objects[ERROR_CODE] = code
        return Emergency(code, self._register())

    def leave(self, code: int) -> Emergency | None:
        """Remove an error; return the message `no error` if it was the last active error."""
        if code not in self._active:
            return None
        self._active.discard(code)
        register = self._register()
        return None if self._active else Emergency(0, register)

    def reset(self) -> Emergency | None:
        """Remove all errors, as a fault reset does; return `no error` if any was active."""
        any_active = bool(self._active)
        self._active.clear()
        self._objects[ERROR_CODE] = 0
        register = self._register()
        return Emergency(0, register) if any_active else None

    def restore(self) -> None:
        """Write the active errors into the error register again, after a reset of the objects."""
        self._register()

    def clear_history(self) -> None:
        """Clear 1003h, as a write of 0 to its sub-index 0 does."""
        for number in range(ERROR_HISTORY_LENGTH + 1):
            self._objects[ERROR_HISTORY, number] = 0

    def _register(self) -> int:
        register = 0
        for code in self._active:
            communication = 0x8100 <= code < 0x8300
            register |= _GENERIC_BIT | (_COMMUNICATION_BIT if communication else _PROFILE_BIT)
        self._objects[ERROR_REGISTER] = register
        return register
