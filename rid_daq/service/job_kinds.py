"""`JobKind`: what a service does, each by the request of the command of the same name."""

from __future__ import annotations

from enum import StrEnum

from rid_daq.operations.catalogue import OF_KINDS, operation
from rid_daq.operations.operation import Operation


class JobKind(StrEnum):
    """The kinds of jobs."""

    CHECK = "check"
    RESET = "reset"
    AXES = "axes"
    JOG = "jog"
    PLATE_ZERO = "plate_zero"
    RECORD = "record"
    PAYLOAD_SESSION = "payload_session"
    STREAM = "stream"
    DESIGN = "design"
    IDENTIFY = "identify"
    VALIDATE = "validate"
    FRICTION = "friction"
    LOOP = "loop"
    RETIME = "retime"
    COMPENSATE = "compensate"
    REFINE = "refine"
    TRACKING = "tracking"
    COMPARE = "compare"
    PAYLOAD_IDENTIFY = "payload_identify"
    PAYLOAD_EXPORT = "payload_export"
    PAYLOAD_READ_BACK = "payload_read_back"
    PAYLOAD_CERTIFICATE = "payload_certificate"
    EXPORT = "export"
    RECOVER = "recover"

    @property
    def opens_cell(self) -> bool:
        """True if it opens the cell's bus; the others only compute."""
        return self.operation.opens_cell

    @property
    def moves(self) -> bool:
        """True if the robot moves in it."""
        return self.operation.moves

    @property
    def needs_axis_test(self) -> bool:
        """True if the axes of a real cell must have been tested before."""
        return self.moves and not self.operation.is_held

    @property
    def operation(self) -> Operation:
        """Its declaration."""
        return operation(OF_KINDS[self.value])
