"""`JobEvent`: what a job says on its way, one line of JSON each; and how it is shown again.

The worker writes them into the job's folder, the service reads them from there and sends them on,
the client shows them as the command would have.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from rid_daq.blocks.block import Heading, Next, Table, Text, Verdict

ToldBlock = Annotated[Heading | Text | Verdict | Table | Next, Field(discriminator="kind")]
"""A block that an event has: all but plots."""


class _Event(BaseModel):
    """What every event has: `at_s`, when it was said [s since 1970]."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    at_s: float


class Said(_Event):
    """A sentence for people."""

    kind: Literal["said"] = "said"
    text: str


class Judged(_Event):
    """The sentence that matters: good, bad, or neither."""

    kind: Literal["judged"] = "judged"
    passed: bool | None
    text: str


class Resulted(_Event):
    """The result of an operation: its document for programs, its blocks for people.

    The cells of tables are texts. Plots are left out: the report of the run has them.
    """

    kind: Literal["result"] = "result"
    document: dict[str, object]
    blocks: tuple[ToldBlock, ...]


class MotionBegun(_Event):
    """A motion begins: its run, its sentence, how many cycles it has, 0 if nobody knows."""

    kind: Literal["motion"] = "motion"
    run: str
    title: str
    rows: int
    rows_per_period: int | None


class Progressed(_Event):
    """How far a long step is; `total` is None where nobody knows how long it is."""

    kind: Literal["progress"] = "progress"
    title: str
    done: float
    total: float | None
    unit: str
    line: str


class Choice(BaseModel):
    """An answer that somebody may choose: what it says, and the text that is sent."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    label: str
    text: str


class WarmedUp(_Event):
    """More periods of a warm-up: what friction takes of each joint [W], and what counts as warm.

    `power_w` has one row a period, in the order of `joints`; it counts as warm where no joint's
    power changes by more than `settled_percent` in a period.
    """

    kind: Literal["warmed_up"] = "warmed_up"
    joints: tuple[str, ...]
    power_w: tuple[tuple[float, ...], ...]
    settled_percent: float


class SessionState(StrEnum):
    """A state of a payload session, in the order of a session that is not interrupted."""

    PREPARE = "prepare"
    REHEARSE = "rehearse"
    WARM_UP_WITHOUT = "warm_up_without"
    RECORD_WITHOUT = "record_without"
    ATTACH = "attach"
    WARM_UP_WITH = "warm_up_with"
    RECORD_WITH = "record_with"
    IDENTIFY = "identify"
    DONE = "done"


class StateEntered(_Event):
    """A payload session enters a state; `session` is the id of its folder."""

    kind: Literal["state"] = "state"
    session: str
    state: SessionState
    text: str


class Asked(_Event):
    """A question that waits for an answer: free text, yes or no, or a key to be held.

    `choices` are answers to a free text that a page shows as buttons.
    """

    kind: Literal["asked"] = "asked"
    question: int
    form: Literal["text", "yes_no", "hold"]
    text: str
    choices: tuple[Choice, ...] = ()


class KeyRefused(_Event):
    """A held key counts no longer, or not at all, until it is pressed again; and why.

    `round_trip_ms` is how long the link takes there and back, if that is the reason [ms].
    """

    kind: Literal["key_refused"] = "key_refused"
    text: str
    round_trip_ms: float | None = None


class Answered(_Event):
    """A question needs no answer any more."""

    kind: Literal["answered"] = "answered"
    question: int


class Ended(_Event):
    """The job's end: exit code as the command's; `error`, `message`, `code` of an error."""

    kind: Literal["ended"] = "ended"
    exit_code: int
    error: str | None = None
    message: str | None = None
    code: str | None = None


AnyEvent = Annotated[
    Said
    | Judged
    | Resulted
    | MotionBegun
    | Progressed
    | WarmedUp
    | StateEntered
    | Asked
    | KeyRefused
    | Answered
    | Ended,
    Field(discriminator="kind"),
]

EVENT: TypeAdapter[AnyEvent] = TypeAdapter(AnyEvent)
"""Reads and writes one event."""
