"""`JobKind`: what a service does, each by the request of the command of the same name."""

from __future__ import annotations

from enum import StrEnum


class JobKind(StrEnum):
    """The kinds of jobs."""

    CHECK = "check"
    RESET = "reset"
    AXES = "axes"
    JOG = "jog"
    PLATE_ZERO = "plate_zero"
    RECORD = "record"
    PAYLOAD = "payload"
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
        """Whether it opens the cell's bus; the others only compute."""
        return self in _ON_CELL

    @property
    def moves(self) -> bool:
        """Whether the robot moves in it."""
        return self in _ON_CELL - {JobKind.CHECK, JobKind.RESET}

    @property
    def needs_axis_test(self) -> bool:
        """Whether a real cell's axes must have been tested before; else a key is held."""
        return self.moves and self not in {JobKind.AXES, JobKind.JOG}


_ON_CELL = frozenset(
    {
        JobKind.CHECK,
        JobKind.RESET,
        JobKind.AXES,
        JobKind.JOG,
        JobKind.PLATE_ZERO,
        JobKind.RECORD,
        JobKind.PAYLOAD,
        JobKind.STREAM,
    }
)
