"""`JobKind`: kinds of jobs of a service; each uses the request of the command of that name."""

from __future__ import annotations

from enum import StrEnum

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
