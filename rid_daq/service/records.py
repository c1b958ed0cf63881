"""Records in the service's API: jobs, leases, identities, cells. Each is a frozen model."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from rid_daq.preflight.check_line import CheckLine
from rid_daq.service.job_kinds import JobKind, held_kinds

MOST_CHARACTERS: Final = 200
"""Maximum length of names, notes and other texts that every answer repeats."""

ShortText = Annotated[str, StringConstraints(max_length=MOST_CHARACTERS)]


class Record(BaseModel):
    """Frozen model that refuses unknown fields."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Role(StrEnum):
    """Access right of a client. Each role includes the rights of the roles before it."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMINISTRATOR = "administrator"

    def includes(self, other: Role) -> bool:
        """Return True if this role has all rights of another role."""
        order = list(Role)
        return order.index(self) >= order.index(other)


class Identity(Record):
    """Caller of a request: a name, a role, and whether a person at a page or a program calls."""

    name: str
    role: Role
    person: bool
    token: str = Field(
        description="Id of the request's token; empty for a request of this computer without one."
    )


class JobState(StrEnum):
    """State of a job."""

    ACCEPTED = "accepted"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"

    @property
    def is_over(self) -> bool:
        """True if the job has ended and its state is final."""
        return self not in (JobState.ACCEPTED, JobState.RUNNING)


OnLostClient = Literal["stop", "finish"]
"""Action on a motion whose lease ends."""


class Job(Record):
    """A job: its request, its owner and its outcome.

    Times are seconds since 1970. `exit_code` is the exit code of the command of the same kind.
    `reason` is a sentence with the reason for any other end than success. `run` is the id of the
    newest run that the job made; `lease` is the id of the lease with which the job was started.
    """

    id: str
    cell: str
    kind: JobKind
    state: JobState
    owner: str
    request: dict[str, object]
    on_lost_client: OnLostClient = "stop"
    lease: str | None = None
    created_s: float
    began_s: float | None = None
    ended_s: float | None = None
    pid: int | None = None
    exit_code: int | None = None
    reason: str = ""
    run: str | None = None


class Lease(Record):
    """Right of one client to use a cell. It ends at `until_s` unless it is renewed [s since 1970].

    `until_s` is for display only: the service measures the time with a clock that ignores changes
    of the date. A renewed lease keeps its `id`; a new lease, or one taken over from another client,
    has a new `id`.
    """

    id: str
    cell: str
    owner: str
    note: str
    person: bool
    until_s: float


class HeldLease(Lease):
    """A lease as its holder receives it: with the key that jobs and renewals must contain."""

    key: str


class TokenEnd(StrEnum):
    """Expiry of a token that no one revokes."""

    NEVER = "never"
    UNUSED = "unused"
    SERVICE = "service"


class Token(Record):
    """Access token of a person or program. The service does not store its secret."""

    id: str
    name: str
    role: Role
    person: bool
    created_s: float
    used_s: float | None = None
    ends: TokenEnd = Field(
        default=TokenEnd.NEVER,
        description="Expiry: never, after 30 days without use, or at the end of the service.",
    )


class AuditEntry(Record):
    """Entry of the log of user actions: caller, action, time [s since 1970] and cell."""

    at_s: float
    who: str
    what: str
    cell: str = ""
    details: str = ""


class CellState(StrEnum):
    """State of a cell.

    While a job runs that can move the robot, the state is `moving` during its motions, `waiting`
    while it waits for an answer, and `at rest` in between: the next motion can begin at any time.
    """

    CLOSED = "closed"
    CHECKING = "checking"
    READY = "ready"
    AT_REST = "at rest"
    WAITING = "waiting"
    MOVING = "moving"
    STOPPING = "stopping"
    FAULT = "fault"


class Preflight(Record):
    """Newest preflight of a cell: time, verdict, lines, and the reason if it is void.

    `at_s` is for display only [s since 1970]. `age_s` decides if the preflight is valid; it is None
    if the service was started or paused after the preflight.
    """

    at_s: float
    age_s: float | None = None
    passed: bool
    problem: str | None
    lines: tuple[CheckLine, ...]
    void_because: str = ""


class CellStatus(Record):
    """Public status of a cell.

    `preflight_age_s` is None if the preflight is not valid, unless a fault is the only reason, or
    if there was none since the service started. `not_ready_because` is the obstacle to
    motions in general. `not_held_because` is the obstacle to jobs of the `held_kinds`, for which a
    key is held: they do not require an earlier axis test. `files_hash` changes with the cell's
    files.
    """

    cell: str
    robot: str
    joints: tuple[str, ...]
    simulated: bool
    pace: float | None
    files_hash: str
    state: CellState
    fault: str = ""
    preflight_age_s: float | None = None
    preflight_limit_s: float
    not_ready_because: str = ""
    not_held_because: str = ""
    held_kinds: tuple[JobKind, ...] = Field(default_factory=held_kinds)
    job: Job | None = None
    lease: Lease | None = None


class NamedFile(Record):
    """A file of the service's folder that requests may name."""

    path: str = Field(description="Path relative to the service's folder.")
    words: str = Field(description="Label of the file in lists; without the time `made_utc`.")
    made_utc: str = Field(default="", description="Start of the run with this file; empty outside.")
    kind: str = Field(default="", description="Kind of the motion; empty for other files.")


class FilesOfCell(Record):
    """Files in the service's folder by kind; the newest first."""

    motions: tuple[NamedFile, ...] = ()
    models: tuple[NamedFile, ...] = ()
    loops: tuple[NamedFile, ...] = ()
    feedforwards: tuple[NamedFile, ...] = ()
    payloads: tuple[NamedFile, ...] = ()
