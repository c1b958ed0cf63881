"""Events of a running job, one line of JSON each.

The worker writes the events into the job's folder, the service reads and forwards them, and the
client shows them as the command itself would.
"""

from __future__ import annotations

from enum import StrEnum
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, TypeAdapter

from rid_daq.blocks.block import Heading, Next, Table, Text, Verdict

EventBlock = Annotated[Heading | Text | Verdict | Table | Next, Field(discriminator="kind")]
"""Blocks that an event can contain: all kinds except plots and pictures."""


class _Event(BaseModel):
    """Common part of all events.

    Attributes:
        at_s: Time of the event [s since 1970].
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    at_s: float


class MessageEvent(_Event):
    """An event with a sentence for people."""

    kind: Literal["said"] = "said"
    text: str


class VerdictEvent(_Event):
    """A verdict.

    Attributes:
        passed: True for passed, False for failed, None for neither.
        text: The verdict in words.
    """

    kind: Literal["judged"] = "judged"
    passed: bool | None
    text: str


class ResultEvent(_Event):
    """Result of an operation.

    The cells of tables are texts. Plots are left out, because the run's report contains them. A
    text with the caption replaces each picture.

    Attributes:
        document: Values for programs.
        blocks: The same result for people.
    """

    kind: Literal["result"] = "result"
    document: dict[str, object]
    blocks: tuple[EventBlock, ...]


class MotionEvent(_Event):
    """Start of a motion.

    Attributes:
        run: Id of the motion's run.
        title: Description of the motion.
        rows: Number of cycles; 0 if unknown.
        rows_per_period: Rows of one period; None if the motion is not periodic.
        tested_joint: Name of the joint that moves in an axis test; None in other motions.
    """

    kind: Literal["motion"] = "motion"
    run: str
    title: str
    rows: int
    rows_per_period: int | None
    tested_joint: str | None = None


class ProgressEvent(_Event):
    """Progress of a long step.

    Attributes:
        title: Title of the step.
        done: Amount done, in `unit`.
        total: Total amount, in `unit`; None if it is unknown.
        unit: Unit of the amounts.
        line: Status in one line.
    """

    kind: Literal["progress"] = "progress"
    title: str
    done: float
    total: float | None
    unit: str
    line: str


class Choice(BaseModel):
    """An answer that a user can select.

    Attributes:
        label: Label of the button.
        text: Text that is sent as the answer.
    """

    model_config = ConfigDict(frozen=True, extra="forbid")

    label: str
    text: str


class WarmUpEvent(_Event):
    """Further periods of a warm-up.

    Attributes:
        joints: Names of the joints, base to flange.
        power_w: Mean mechanical power of each joint, one row per period [W].
        settled_percent: The robot counts as warm if no joint's power changes by more than this
            between two periods [%].
    """

    kind: Literal["warmed_up"] = "warmed_up"
    joints: tuple[str, ...]
    power_w: tuple[tuple[float, ...], ...]
    settled_percent: float


class SessionState(StrEnum):
    """State of a payload session, in the order of a session without interruption."""

    PREPARE = "prepare"
    REHEARSE = "rehearse"
    WARM_UP_WITHOUT = "warm_up_without"
    RECORD_WITHOUT = "record_without"
    ATTACH = "attach"
    WARM_UP_WITH = "warm_up_with"
    RECORD_WITH = "record_with"
    IDENTIFY = "identify"
    DONE = "done"


class StateEvent(_Event):
    """Next state of a payload session.

    Attributes:
        session: Id of the session's folder.
        state: The next state.
        text: Description of the state.
    """

    kind: Literal["state"] = "state"
    session: str
    state: SessionState
    text: str


class QuestionEvent(_Event):
    """A question that waits for an answer.

    Attributes:
        question: Number of the question.
        form: Kind of answer: free text, yes or no, or a key to hold.
        text: The question.
        choices: Answers to a free-text question that a page shows as buttons.
    """

    kind: Literal["asked"] = "asked"
    question: int
    form: Literal["text", "yes_no", "hold"]
    text: str
    choices: tuple[Choice, ...] = ()


class KeyRefusalEvent(_Event):
    """A held key does not count until it is released and pressed again.

    Attributes:
        text: Reason for the refusal.
        round_trip_ms: Round-trip time, or time without a fresh message of the key, if it is the
            reason [ms].
    """

    kind: Literal["key_refused"] = "key_refused"
    text: str
    round_trip_ms: float | None = None


class AnswerEvent(_Event):
    """A question no longer waits for an answer.

    Attributes:
        question: Number of the question.
    """

    kind: Literal["answered"] = "answered"
    question: int


class EndEvent(_Event):
    """End of the job.

    Attributes:
        exit_code: Exit code of the command.
        error: Class of the error; None without an error.
        message: Text of the error; None without an error.
        code: Code of the error, `RID-AREA-NAME`; None without an error.
    """

    kind: Literal["ended"] = "ended"
    exit_code: int
    error: str | None = None
    message: str | None = None
    code: str | None = None


AnyEvent = Annotated[
    MessageEvent
    | VerdictEvent
    | ResultEvent
    | MotionEvent
    | ProgressEvent
    | WarmUpEvent
    | StateEvent
    | QuestionEvent
    | KeyRefusalEvent
    | AnswerEvent
    | EndEvent,
    Field(discriminator="kind"),
]

EVENT: TypeAdapter[AnyEvent] = TypeAdapter(AnyEvent)
"""Converts one event from and to JSON."""
