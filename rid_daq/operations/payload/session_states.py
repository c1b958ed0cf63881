"""`STATES`: states of a payload session in order; `SessionFile`: file of a session.

A session passes the states in the order of the table, without those that its request does not need.
An interrupted session continues with the first state whose runs are missing. If the session has a
warm-up, the robot is warmed up again; on a real cell, a person must again confirm that the payload
is attached.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal, NamedTuple, Self

from pydantic import BaseModel, ConfigDict, Field, JsonValue, PrivateAttr, ValidationError

from acquisition.runs.catalogue import find_run_below
from acquisition.runs.folder import RunFolder
from config.errors import ConfigError
from config.wrong_value import explain_error
from rid_daq.operations.payload.payload_session import LOADED, UNLOADED, PayloadSessionRequest
from rid_daq.report.sections.payload import EmptyFlange
from rid_daq.runs.run_data import SESSION, RunData
from rid_daq.terminal.job_events import SessionState as State

EMPTY_FLANGE: Final = "empty_flange"
REHEARSAL: Final = "rehearsal"
WARM_UP: Final = "warm-up"


class StateRule(NamedTuple):
    """Description of a state, and the states that can follow. `by_person`: a person must act."""

    text: str
    next: tuple[State, ...]
    by_person: bool = False


STATES: Final = {
    State.PREPARE: StateRule(
        "Check that no person is in the cell and that the flange is empty.",
        (State.REHEARSE, State.WARM_UP_WITHOUT, State.RECORD_WITHOUT, State.ATTACH),
        by_person=True,
    ),
    State.REHEARSE: StateRule(
        "Rehearse: record one slow period.",
        (State.WARM_UP_WITHOUT, State.RECORD_WITHOUT, State.ATTACH),
    ),
    State.WARM_UP_WITHOUT: StateRule(
        "Warm up without the payload until friction settles.", (State.RECORD_WITHOUT, State.ATTACH)
    ),
    State.RECORD_WITHOUT: StateRule("Record the motion without the payload.", (State.ATTACH,)),
    State.ATTACH: StateRule(
        "Attach the payload.", (State.WARM_UP_WITH, State.RECORD_WITH), by_person=True
    ),
    State.WARM_UP_WITH: StateRule(
        "Warm up with the payload until friction settles.", (State.RECORD_WITH,)
    ),
    State.RECORD_WITH: StateRule(
        "Record the motion with the payload.", (State.RECORD_WITH, State.IDENTIFY)
    ),
    State.IDENTIFY: StateRule("Identify the payload.", (State.DONE,)),
    State.DONE: StateRule("The session is done.", ()),
}
"""All states, in the order of a session."""

ORDER: Final = tuple(STATES)


class SessionFile(BaseModel):
    """File of a payload session; it is written at every change.

    Attributes:
        cell: Name of the cell.
        state: Present state.
        request: Options of the session, as JSON; known quantities and limits are stored only here.
        done: Run id by step, in the order of recording.
        facts: Results of the steps: drift, skipped steps, evidence of the empty flange.
    """

    model_config = ConfigDict(extra="forbid", populate_by_name=True)

    format: Literal["rid-daq payload session 2"] = Field(
        default="rid-daq payload session 2", alias="schema"
    )
    cell: str
    state: State = State.PREPARE
    request: dict[str, JsonValue] = Field(default_factory=dict)
    done: dict[str, str] = Field(default_factory=dict)
    facts: dict[str, JsonValue] = Field(default_factory=dict)
    _folder: RunFolder = PrivateAttr()
    _text: bytes = PrivateAttr(b"")

    @classmethod
    def begin(
        cls, folder: RunFolder, cell: str, asked: Mapping[str, JsonValue] | None = None
    ) -> Self:
        """Create a payload session of a cell, write its file into a folder, and return it.

        Args:
            asked: Options of the session, as JSON.
        """
        begun = cls(cell=cell, request=dict(asked or {}))
        begun._folder = folder
        begun.write()
        return begun

    @classmethod
    def read(cls, folder: RunFolder) -> Self:
        """Read the session of a folder.

        Raises:
            ConfigError: The folder is not of a payload session (RID-SESSION-STATE).
            RecordingError: The file cannot be read, or was changed.
        """
        if not folder.file(SESSION).exists():
            raise ConfigError(
                f"{folder.path} is not the folder of a payload session: name the run of one with"
                " --resume",
                code="RID-SESSION-STATE",
            )
        text = folder.read(SESSION)
        try:
            found = cls.model_validate_json(text)
        except ValidationError as error:
            first = error.errors()[0]
            raise ConfigError(
                f"{folder.file(SESSION)} is not the file of a payload session"
                f" ({'.'.join(map(str, first['loc']))}: {explain_error(first)}); was it edited?",
                code="RID-SESSION-STATE",
            ) from None
        found._folder, found._text = folder, text
        return found

    @property
    def folder(self) -> RunFolder:
        """Folder of the session."""
        return self._folder

    @property
    def measurements(self) -> tuple[str, ...]:
        """Completed steps whose runs are used to estimate the payload."""
        return tuple(name for name in self.done if name.startswith((UNLOADED, LOADED)))

    @property
    def empty_flange(self) -> EmptyFlange | None:
        """Evidence that the flange was empty without payload; None without evidence."""
        evidence = self.facts.get(EMPTY_FLANGE)
        return (
            EmptyFlange(evidence)
            if isinstance(evidence, str) and evidence in set(EmptyFlange)
            else None
        )

    def runs(self) -> list[RunData]:
        """Return the runs of `measurements`.

        Raises:
            RidDaqError: A run cannot be used.
        """
        root = self.folder.path.parent
        return [RunData.load(find_run_below(root, self.done[name])) for name in self.measurements]

    def enter(self, state: State, *, again: bool = False) -> None:
        """Enter a state and write the file.

        Args:
            state: The new state.
            again: True if the session continues after an interruption; any state can then follow.

        Raises:
            ConfigError: The state must not follow, or another program has changed the session
                (RID-SESSION-ORDER).
            RecordingError: The file cannot be written.
        """
        session, now = f"session {self.folder.run_id}", self.state
        if self.folder.read(SESSION) != self._text:
            raise ConfigError(
                f"{session}: another program has changed the session since state {now.value}:"
                " this program stops here; end the other program, then continue with --resume",
                code="RID-SESSION-ORDER",
            )
        if state not in STATES[now].next and not again:
            raise ConfigError(
                f"{session}: state {state.value} cannot follow state {now.value}; only"
                f" {', '.join(STATES[now].next) or 'no state'} can: continue with --resume",
                code="RID-SESSION-ORDER",
            )
        self.state = state
        self.write()

    def note_step(self, name: str, run_id: str) -> None:
        """Write that a step is complete, with the id of its run."""
        self.done[name] = run_id
        self.write()

    def note_fact(self, name: str, fact: JsonValue) -> None:
        """Write a value of the session, such as an answer of the user, under a name."""
        self.facts[name] = fact
        self.write()

    def write(self) -> None:
        """Write the file.

        Raises:
            RecordingError: The file cannot be written.
        """
        self._text = (self.model_dump_json(indent=1, by_alias=True) + "\n").encode()
        self.folder.write(SESSION, self._text)


def next_state(
    state: State, request: PayloadSessionRequest, done: dict[str, str], *, is_warm: bool
) -> State:
    """Return the next state that a request needs after a state.

    Args:
        state: The state that has ended; `PREPARE` if a session begins or continues.
        request: Options of the session.
        done: Run id by completed step.
        is_warm: True if the robot has performed more than the rehearsal since the program started.
    """
    missing = [name for name in request.measured_steps if name not in done]
    warms_up = request.warm_up_percent > 0.0
    needed = {
        State.REHEARSE: request.rehearsal_percent > 0.0 and REHEARSAL not in done,
        State.WARM_UP_WITHOUT: warms_up and UNLOADED in missing,
        State.RECORD_WITHOUT: UNLOADED in missing,
        State.ATTACH: bool(missing),
        State.WARM_UP_WITH: warms_up and bool(missing) and not is_warm,
        State.RECORD_WITH: bool(missing),
    }
    first = ORDER.index(state) + (state is not State.RECORD_WITH)
    return next(each for each in ORDER[first:] if needed.get(each, True))
