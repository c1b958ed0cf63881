"""`JobKind`: what a service does, each by the request of the command of the same name."""

from __future__ import annotations

from enum import StrEnum

from rid_daq.operations.catalogue import OF_KINDS, operation
from rid_daq.operations.operation import Operation


class JobKind(StrEnum):
    """The kinds of jobs: the operations of the catalogue that a service does."""

    _ignore_ = "kind"
    for kind in OF_KINDS:
        vars()[kind] = kind

    @property
    def operation(self) -> Operation:
        """Its declaration."""
        return operation(OF_KINDS[self.value])
