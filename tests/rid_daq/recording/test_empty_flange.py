"""A payload session asks if the flange is empty, and its verdict contains the answer."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from acquisition.motion.motion_file import AnyMotion, load_motion
from acquisition.runs.folder import RunFolder
from config.errors import PreflightError
from config.load import load_cell
from identification.choices import PayloadLimits
from identification.payload.verdict import PayloadResult, check_payload
from rid_daq.operations.payload import session_steps
from rid_daq.operations.payload.payload_estimate import PayloadRequest
from rid_daq.operations.payload.payload_session import PayloadSessionRequest
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.operations.payload.session_steps import PayloadGuide
from rid_daq.preflight.check_line import CheckLine
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.report.sections.payload import EmptyFlange, payload_verdict
from rid_daq.terminal.clearance import ask_clearance
from rid_daq.terminal.console import Console
from rid_daq.worker.job_console import EventFile, JobConsole
from rid_daq.worker.orders import Orders
from tests.builders.certified import estimate_of
from tests.builders.raised_codes import raises_code

EMPTY = "Is the flange empty"
Lead = Callable[..., tuple[str, RecordedRun] | None]


class Person(Console):
    """A user who answers yes, except to questions that contain `denies`."""

    asked: list[str]

    def __init__(self, denies: str = "nothing") -> None:
        super().__init__()
        object.__setattr__(self, "asked", [])
        object.__setattr__(self, "denies", denies)

    @property
    def can_ask(self) -> bool:
        return True

    def ask(self, question: str, understood: Any, choices: Any = ()) -> Any:
        self.asked.append(question)
        return understood("kr15")

    def confirm(self, question: str) -> bool:
        self.asked.append(question)
        return cast("Any", self).denies not in question


@pytest.fixture
def state(tmp_path: Path) -> SessionFile:
    return SessionFile.begin(RunFolder.create(tmp_path, "payload", kind="payload session"), "kr15")


@pytest.fixture(scope="module")
def motion(six_axis_motion: Callable[[int], Path]) -> AnyMotion:
    return load_motion(six_axis_motion(2))


@pytest.fixture
def run_session(monkeypatch: pytest.MonkeyPatch, state: SessionFile, motion: AnyMotion) -> Lead:
    """Return a function that runs a session whose first motion is stopped at once."""
    monkeypatch.setattr(session_steps, "preflight", lambda *_, **__: ([], None))
    loaded, stopped = load_cell("kr15"), SimpleNamespace(outcome=SimpleNamespace(stop="stopped"))
    stopped.quality = None

    def run_guide(
        console: Console, *, simulated: object = None, **words: Any
    ) -> tuple[str, RecordedRun] | None:
        session = SimpleNamespace(
            simulated=simulated, loaded=loaded, cell=loaded.config, record=lambda _request: stopped
        )
        request = PayloadSessionRequest(cell="kr15", runs=state.folder.path.parent, **words)
        guide = PayloadGuide(
            request, cast("Any", session), state, cast("Any", motion), PayloadRequest(), console
        )
        return guide.perform_steps()

    return run_guide


def flange_note(state: SessionFile) -> str:
    """Return the sentence of the verdict that follows from the session's folder."""
    estimate = estimate_of(load_cell("kr15"), ())
    payload = PayloadResult(estimate, check_payload(estimate, PayloadLimits()))
    return payload_verdict(payload, SessionFile.read(state.folder).empty_flange).sentence


def test_the_verdict_states_that_the_user_confirmed_the_empty_flange(
    run_session: Lead, state: SessionFile
) -> None:
    person = Person()
    assert run_session(person) is not None
    assert [EMPTY in question for question in person.asked].count(True) == 1
    assert "You confirmed that the flange was empty" in flange_note(state)


def test_a_flange_that_is_not_empty_prevents_motion(run_session: Lead, state: SessionFile) -> None:
    with raises_code(PreflightError, "RID-ANSWER-NO", "moved", "--resume", "--model"):
        run_session(Person(EMPTY))
    assert state.empty_flange is None


def test_a_red_preflight_prevents_motion(
    run_session: Lead, state: SessionFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    red = CheckLine("axis1", "drive", "", "fault", "red", "reset it")
    monkeypatch.setattr(session_steps, "preflight", lambda *_, **__: ([red], None))
    with raises_code(PreflightError, "RID-PREFLIGHT-RED"):
        run_session(Person(), simulated=SimpleNamespace())
    assert not state.done


def test_the_cell_must_be_cleared_again_after_the_payload_is_attached(
    run_session: Lead, state: SessionFile
) -> None:
    for step in ("rehearsal", "unloaded"):
        state.note_step(step, "RUN")
    person = Person()
    assert run_session(person, practise=True) is not None
    cleared = [number for number, each in enumerate(person.asked) if "free of people" in each]
    (attached,) = (number for number, each in enumerate(person.asked) if "attached" in each)
    assert len(cleared) == 2
    assert cleared[0] < attached < cleared[1]


def test_a_confirmation_before_the_session_counts_until_a_person_attaches_the_payload(
    run_session: Lead, state: SessionFile
) -> None:
    for step in ("rehearsal", "unloaded"):
        state.note_step(step, "RUN")
    person = Person()
    assert run_session(person, practise=True, cleared=True) is not None
    (cleared,) = (number for number, each in enumerate(person.asked) if "free of people" in each)
    (attached,) = (number for number, each in enumerate(person.asked) if "attached" in each)
    assert attached < cleared


def test_a_page_can_confirm_by_a_button_that_the_cell_is_free_of_people(tmp_path: Path) -> None:
    orders = Orders(io.StringIO())
    orders.take({"answer": 1, "text": "kr15"})
    orders.take({"answer": 2, "text": "yes"})
    with EventFile(tmp_path / "events.jsonl") as events:
        assert ask_clearance("kr15", False, JobConsole(events=events, orders=orders))
    events_read = map(json.loads, (tmp_path / "events.jsonl").read_text().splitlines())
    (question,) = (each for each in events_read if each.get("choices"))
    assert [each["text"] for each in question["choices"]] == ["kr15", "no"]


def test_with_yes_the_verdict_states_that_the_question_was_skipped(
    run_session: Lead, state: SessionFile
) -> None:
    run_session(Person(), yes=True)
    assert "--yes skipped the question whether the flange was empty" in flange_note(state)


def test_the_flange_of_a_simulated_cell_needs_no_question(
    run_session: Lead, state: SessionFile
) -> None:
    person = Person(EMPTY)
    run_session(person, simulated=SimpleNamespace())
    assert state.empty_flange is EmptyFlange.SIMULATED
    assert "The simulated flange was empty" in flange_note(state)


@pytest.mark.parametrize("words", [{"model": Path("model.json")}, {}])
def test_no_question_is_asked_if_no_unloaded_run_follows(
    run_session: Lead, state: SessionFile, words: dict[str, Any]
) -> None:
    if not words:
        state.note_step("unloaded", "RUN")
    person = Person()
    run_session(person, **words)
    assert not any(EMPTY in question for question in person.asked)


def test_a_page_gets_the_same_question(
    run_session: Lead, state: SessionFile, tmp_path: Path
) -> None:
    orders = Orders(io.StringIO())
    for number in (1, 2):
        orders.take({"answer": number, "text": "yes"})
    with EventFile(tmp_path / "events.jsonl") as events:
        run_session(JobConsole(events=events, orders=orders))
    assert EMPTY in (tmp_path / "events.jsonl").read_text(encoding="utf-8")
    assert state.empty_flange is EmptyFlange.SAID


def test_practice_on_a_simulated_cell_asks_every_question(run_session: Lead) -> None:
    attached: list[str | None] = []
    simulated = SimpleNamespace(attach=attached.append)
    person = Person()
    run_session(
        person, simulated=simulated, practise=True, rehearsal_percent=0.0, warm_up_percent=0.0
    )
    assert person.asked == [
        "Is cell kr15 free of people?",
        "Is the emergency stop within reach?",
        "Is the flange empty: no payload, gripper or cable hangs on it?",
    ]
    assert attached == []
    silent = Person()
    run_session(silent, simulated=simulated)
    assert silent.asked == []
