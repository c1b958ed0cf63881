"""What the service keeps and tells: jobs, leases, who is who. One frozen model each."""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Final, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints

from rid_daq.service.job_kinds import JobKind

MOST_CHARACTERS: Final = 200
"""Of names, notes and other texts that every answer repeats."""

ShortText = Annotated[str, StringConstraints(max_length=MOST_CHARACTERS)]


class Record(BaseModel):
    """A frozen model that takes no other fields."""

    model_config = ConfigDict(frozen=True, extra="forbid")


class Role(StrEnum):
    """What somebody may do; each includes the ones before."""

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMINISTRATOR = "administrator"

    def includes(self, other: Role) -> bool:
        """Return whether this role may do what another may."""
        order = list(Role)
        return order.index(self) >= order.index(other)


class Identity(Record):
    """Who asks: a name, a role, and whether a person at a page asks, or a program."""

    name: str
    role: Role
    person: bool
    token: str = Field(description="The id of the token that was shown; empty on this computer.")


class JobState(StrEnum):
    """Where a job is."""

    ACCEPTED = "accepted"
    RUNNING = "running"
    DONE = "done"
    FAILED = "failed"
    STOPPED = "stopped"
    INTERRUPTED = "interrupted"

    @property
    def is_over(self) -> bool:
        """Whether nothing more happens to it."""
        return self not in (JobState.ACCEPTED, JobState.RUNNING)


OnLostClient = Literal["stop", "finish"]
"""What happens to a motion whose lease ends."""


class Job(Record):
    """A job: what was asked for, by whom, and what became of it.

    Times are seconds since 1970. `exit_code` is that of the command of the same kind; `reason` says
    in a sentence why a job did not end well; `run` is the id of the newest run that it made,
    `lease` that of the lease that it was begun with.
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
    """Who may move a cell, and until when unless it is renewed [s since 1970].

    That time is for people: the service counts by a clock that no change of the date moves.
    A lease that is renewed keeps its `id`; one that is taken anew, or over, has another.
    """

    id: str
    cell: str
    owner: str
    note: str
    person: bool
    until_s: float


class HeldLease(Lease):
    """A lease as its holder gets it: with the key that jobs and renewals show."""

    key: str


class TokenEnd(StrEnum):
    """When a token ends that nobody revokes."""

    NEVER = "never"
    UNUSED = "unused"
    SERVICE = "service"


class Token(Record):
    """What somebody shows to be let in; the secret itself is not kept."""

    id: str
    name: str
    role: Role
    person: bool
    created_s: float
    used_s: float | None = None
    ends: TokenEnd = Field(
        default=TokenEnd.NEVER,
        description="Never; after 30 days without use; or with this run of the service.",
    )


class AuditEntry(Record):
    """Who did what, when [s since 1970], to which cell."""

    at_s: float
    who: str
    what: str
    cell: str = ""
    details: str = ""


class CellState(StrEnum):
    """Where a cell is."""

    CLOSED = "closed"
    CHECKING = "checking"
    READY = "ready"
    MOVING = "moving"
    STOPPING = "stopping"
    FAULT = "fault"


class Preflight(Record):
    """The newest preflight of a cell: when, whether green, its lines, and what it is void by.

    `at_s` is for people [s since 1970]; `age_s` is what counts, None where the service has been
    started, or stood still, since.
    """

    at_s: float
    age_s: float | None = None
    passed: bool
    problem: str | None
    lines: tuple[dict[str, object], ...]
    void_because: str = ""


class CellStatus(Record):
    """A cell, as everybody may see it; `simulated` stands in every answer.

    `preflight_age_s` is None if there is none that counts. `not_ready_because` is about motions in
    general, `not_held_because` about axis test and jog, in which a key is held: they need no axis
    test before.
    """

    cell: str
    robot: str
    joints: tuple[str, ...]
    simulated: bool
    pace: float | None
    state: CellState
    fault: str = ""
    preflight_age_s: float | None = None
    preflight_limit_s: float
    not_ready_because: str = ""
    not_held_because: str = ""
    job: Job | None = None
    lease: Lease | None = None


class NamedFile(Record):
    """A file of the service's folder that requests may name."""

    path: str = Field(description="Inside the service's folder.")
    words: str = Field(description="What people read in a list.")
    kind: str = Field(default="", description="Of a motion: its kind.")


class FilesOfCell(Record):
    """What lies in the service's folder for a cell's robot, by what it is; the newest first."""

    motions: tuple[NamedFile, ...] = ()
    models: tuple[NamedFile, ...] = ()
    loops: tuple[NamedFile, ...] = ()
    feedforwards: tuple[NamedFile, ...] = ()
    payloads: tuple[NamedFile, ...] = ()
