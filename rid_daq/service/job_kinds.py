"""`JobKind`: kinds of jobs of a service; a kind has the name and the request of a command."""

from __future__ import annotations

from enum import StrEnum
from functools import cache

from rid_daq.operations.catalogue import OF_KINDS, operation
from rid_daq.operations.operation import Operation


class JobKind(StrEnum):
    """Kinds of jobs: the operations of the catalogue that a service executes."""

    _ignore_ = "kind"
    for kind in OF_KINDS:
        vars()[kind] = kind

    @property
    def operation(self) -> Operation:
        """Declaration of the operation."""
        return operation(OF_KINDS[self.value])


@cache
def held_kinds() -> tuple[JobKind, ...]:
    """Return the kinds of jobs in which the robot moves only while a key is held.

    This imports every operation, so it is not done when a command starts.
    """
    return tuple(kind for kind in JobKind if kind.operation.is_held)
