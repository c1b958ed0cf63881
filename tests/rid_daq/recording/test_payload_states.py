"""States of a payload session: their table, transitions, and the state after a restart."""

from __future__ import annotations

import itertools
import json
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from config.errors import ConfigError
from rid_daq.app import run
from rid_daq.operations.payload.payload_session import PayloadSessionRequest
from rid_daq.operations.payload.session_states import ORDER, STATES, SessionFile, next_state
from rid_daq.terminal.job_events import SessionState as State
from tests.builders.raised_codes import raises_code

DONE = ("rehearsal", "warm-up", "unloaded", "loaded 1")
PAIRS = [(now, after) for now, after in itertools.product(State, State)]


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    return RunFolder.create(tmp_path, "payload", kind="payload session")


def states_from(request: PayloadSessionRequest, *done: str) -> list[State]:
    """Return the states of a new session, or of one in which some steps are done."""
    runs = dict.fromkeys(done, "RUN")
    state, passed = State.PREPARE, list[State]()
    is_warm = False
    while state is not State.IDENTIFY:
        state = next_state(state, request, runs, is_warm=is_warm)
        passed.append(state)
        is_warm = is_warm or state in (State.WARM_UP_WITHOUT, State.RECORD_WITHOUT)
        missing = [name for name in request.measured_steps if name not in runs]
        if state in (State.RECORD_WITHOUT, State.RECORD_WITH):
            runs[missing[0]] = "RUN"
    return passed


def session(**choices: object) -> PayloadSessionRequest:
    return PayloadSessionRequest.of({"cell": "kr15", **choices})


def test_the_table_has_every_state_in_the_order_of_a_session() -> None:
    assert tuple(State) == ORDER
    assert [state for state in ORDER if STATES[state].by_person] == [State.PREPARE, State.ATTACH]
    for state, rule in STATES.items():
        earlier = [each for each in rule.next if ORDER.index(each) <= ORDER.index(state)]
        assert earlier == ([state] if state is State.RECORD_WITH else [])
    assert STATES[State.DONE].next == ()


@pytest.mark.parametrize(
    "choices",
    [
        {},
        {"repeats": 3},
        {"model": "model.json"},
        {"rehearsal_percent": 0.0, "warm_up_percent": 0.0},
        {"model": "model.json", "warm_up_percent": 0.0},
    ],
    ids=str,
)
def test_a_session_enters_only_permitted_states(choices: dict[str, object]) -> None:
    passed = [State.PREPARE, *states_from(session(**choices)), State.DONE]
    for now, after in itertools.pairwise(passed):
        assert after in STATES[now].next


def test_an_uninterrupted_session_passes_each_state_once() -> None:
    assert states_from(session()) == [
        each for each in ORDER[1:-1] if each is not State.WARM_UP_WITH
    ]
    assert states_from(session(model="model.json")) == [
        *(State.REHEARSE, State.ATTACH, State.WARM_UP_WITH, State.RECORD_WITH, State.IDENTIFY)
    ]


@pytest.mark.parametrize(
    ("interrupted", "done", "goes_on"),
    [
        (State.PREPARE, 0, State.REHEARSE),
        (State.REHEARSE, 0, State.REHEARSE),
        (State.WARM_UP_WITHOUT, 1, State.WARM_UP_WITHOUT),
        (State.RECORD_WITHOUT, 2, State.WARM_UP_WITHOUT),  # the motors have cooled down
        (State.ATTACH, 3, State.ATTACH),
        (State.WARM_UP_WITH, 3, State.ATTACH),  # the payload may have been removed
        (State.RECORD_WITH, 3, State.ATTACH),
        (State.IDENTIFY, 4, State.IDENTIFY),
        (State.DONE, 4, State.IDENTIFY),  # with other limits
    ],
)
def test_an_interrupted_session_continues_with_its_missing_steps(
    folder: RunFolder, interrupted: State, done: int, goes_on: State
) -> None:
    begun = SessionFile.begin(folder, "kr15", session().choices)
    begun.enter(interrupted, again=True)
    for step in DONE[:done]:
        begun.note_step(step, "RUN")
    file = SessionFile.read(folder)  # by another program, after a restart
    assert file.state is interrupted
    after = states_from(session(), *file.done)
    assert after[0] is goes_on
    if State.ATTACH in after and State.RECORD_WITHOUT not in after:
        assert after[1] is State.WARM_UP_WITH
    file.enter(after[0], again=True)
    assert SessionFile.read(folder).state is goes_on


@pytest.mark.parametrize(
    ("now", "after"), [(now, after) for now, after in PAIRS if after not in STATES[now].next]
)
def test_a_transition_that_is_not_permitted_is_refused(
    folder: RunFolder, now: State, after: State
) -> None:
    file = SessionFile.begin(folder, "kr15")
    file.enter(now, again=True)
    with raises_code(ConfigError, "RID-SESSION-ORDER", now.value, after.value):
        file.enter(after)
    assert SessionFile.read(folder).state is now


def test_two_programs_cannot_continue_one_session(folder: RunFolder) -> None:
    first = SessionFile.begin(folder, "kr15")
    second = SessionFile.read(folder)
    second.enter(State.REHEARSE)
    with raises_code(ConfigError, "RID-SESSION-ORDER", "prepare"):
        first.enter(State.REHEARSE)


def test_an_unknown_state_is_named(folder: RunFolder) -> None:
    SessionFile.begin(folder, "kr15")
    document = json.loads(folder.read("session.json")) | {"state": "elsewhere"}
    folder.write("session.json", json.dumps(document).encode())
    with raises_code(ConfigError, "RID-SESSION-STATE", "state"):
        SessionFile.read(folder)


def test_an_unknown_simulated_payload_is_refused_before_the_session(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["payload", "kr15", "--payload", "elephant", "--yes", "--runs", str(tmp_path / "runs")]
    assert run(words) == 2
    assert "[RID-PLANT-UNFIT]" in capsys.readouterr().err
    assert not (tmp_path / "runs").exists()
