"""A real cell moves only after all its guards have passed: one case for each guard."""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from contextlib import nullcontext
from dataclasses import dataclass, field, replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import pytest

from compensation.loops.loop_file import write_loops
from config.errors import ConfigError, PreflightError
from config.load import LoadedCell, load_cell
from identification.estimation.file import write_estimate
from rid_daq.operations.catalogue import CATALOGUE, operation
from rid_daq.preflight.axis_test import AxisTestRule, require_axis_test
from rid_daq.recording import run_session
from rid_daq.recording.run_request import RunRequest
from rid_daq.recording.run_session import open_session
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.remote_jobs import send
from rid_daq.service.request_check import check_request, parse_request
from rid_daq.terminal.console import Console
from tests.builders.known_model import known_estimate
from tests.builders.point_streams import loops_of
from tests.builders.raised_codes import raises_code

HELD = ("axes", "jog")
BY_ITSELF = ("record", "stream", "plate zero")
MOTION = "kind: fourier\nrobot: ir361\nperiod_s: 2.0\nperiods: 2\nramp_s: 1.0\njoints:\n" + "".join(
    f"  - {{joint: axis{i}, sine: [0.2], cosine: [0.1]}}\n" for i in (1, 2, 3)
)
MOVING = pytest.mark.parametrize("name", [*HELD, *BY_ITSELF])


class OpenedError(Exception):
    """Raised instead of opening the cell, after all guards have passed."""


@dataclass(frozen=True)
class Person(Console):
    """A user who types an answer, or a console without a user if there is no answer."""

    answer: str = ""
    said: list[str] = field(default_factory=list)

    @property
    def can_ask(self) -> bool:
        return bool(self.answer)

    def say(self, text: str = "") -> None:
        self.said.append(text)

    def ask(self, question: str, understood: Any, choices: Any = ()) -> Any:
        return understood(self.answer)

    def confirm(self, question: str) -> bool:
        return True

    def require_keys(self, *, simulated: bool) -> None:
        self.said.append(f"keys of a {'simulated' if simulated else 'real'} cell")


@dataclass(frozen=True)
class Cell:
    """A real cell, the requests of operations on it, and the rules with which it is opened."""

    loaded: LoadedCell
    folder: Path
    rules: list[AxisTestRule]

    def run(self, name: str, person: Person, **more: object) -> None:
        files: Mapping[str, object] = {
            "record": {"motion": self.folder / "motion.yaml"},
            "stream": {
                "motion": self.folder / "motion.yaml",
                "model": self.folder / "model.json",
                "loop": self.folder / "loops.json",
            },
        }.get(name, {})
        declared = operation(name)
        values = {"cell": "real", "runs": self.folder / "runs", **files, **more}
        declared.run(declared.request.of(values), person)


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Cell:
    bundled = load_cell("ir361")
    (tmp_path / "motion.yaml").write_text(MOTION)
    write_estimate(tmp_path / "model.json", known_estimate(bundled, {}))
    write_loops(tmp_path / "loops.json", loops_of(bundled), "ir361", "a run")
    real = replace(bundled, config=bundled.config.model_copy(update={"simulated": False}))
    found = Cell(real, tmp_path, [])

    opened_rules: list[AxisTestRule] = []

    def check_axis_test(loaded: LoadedCell, rule: AxisTestRule) -> str:
        opened_rules.append(rule)
        return require_axis_test(loaded, rule)

    def raise_opened(*_: object) -> None:
        found.rules.append(opened_rules[-1])
        raise OpenedError

    for name in (*HELD, *BY_ITSELF):
        module = importlib.import_module(operation(name).module)
        monkeypatch.setattr(module, "load_cell", lambda _: real)
    monkeypatch.setattr(run_session, "require_axis_test", check_axis_test)
    monkeypatch.setattr(run_session, "hold_reachable_cell", raise_opened)
    return found


def test_the_operations_that_open_a_cell_move_it_or_need_a_held_key() -> None:
    """By these declarations a service requires lease, preflight, clearance and axis test."""
    declared = {name: operation(name) for name, entry in CATALOGUE.items() if entry.is_job}
    assert {name for name, each in declared.items() if each.opens_cell} == {
        *("check", "reset", "payload session", "watch"),
        *HELD,
        *BY_ITSELF,
    }
    assert {name for name, each in declared.items() if each.moves} == {
        *("payload session", *HELD, *BY_ITSELF)
    }
    assert {name for name, each in declared.items() if each.is_held} == {*HELD}
    assert {kind for kind in JobKind if kind.operation.needs_axis_test} == {
        *(JobKind("payload_session"), JobKind("record"), JobKind("stream"), JobKind("plate_zero"))
    }


@pytest.mark.parametrize("name", BY_ITSELF)
def test_an_automatic_motion_of_a_real_cell_needs_the_axis_test(name: str, cell: Cell) -> None:
    with raises_code(PreflightError, "RID-AXIS-TEST-MISSING", "axis1"):
        cell.run(name, Person(answer="ir361"))
    assert cell.rules == []


@pytest.mark.parametrize("name", BY_ITSELF)
def test_a_waived_axis_test_is_also_waived_for_the_session(name: str, cell: Cell) -> None:
    with pytest.raises(OpenedError):
        cell.run(name, Person(answer="ir361"), axis_test="waived")
    assert cell.rules == [AxisTestRule.WAIVED]


@pytest.mark.parametrize("name", HELD)
def test_a_hold_to_run_operation_requires_keys_for_a_real_cell(name: str, cell: Cell) -> None:
    person = Person(answer="ir361")
    with pytest.raises(OpenedError):
        cell.run(name, person)
    assert cell.rules == [AxisTestRule.HELD]
    assert "keys of a real cell" in person.said


@MOVING
def test_a_real_cell_does_not_move_without_a_user_to_confirm(name: str, cell: Cell) -> None:
    waived = {} if name in HELD else {"axis_test": "waived"}
    with raises_code(PreflightError, "RID-ANSWER-NOBODY", "ir361"):
        cell.run(name, Person(), **waived)
    assert cell.rules == []


@MOVING
def test_another_answer_than_the_cell_name_is_refused(name: str, cell: Cell) -> None:
    waived = {} if name in HELD else {"axis_test": "waived"}
    with raises_code(PreflightError, "RID-ANSWER-NO", "ir361"):
        cell.run(name, Person(answer="yes"), **waived)
    assert cell.rules == []


@MOVING
def test_a_cleared_cell_needs_no_further_question(name: str, cell: Cell) -> None:
    waived = {} if name in HELD else {"axis_test": "waived"}
    with pytest.raises(OpenedError):
        cell.run(name, Person(), cleared=True, **waived)


def test_an_unattended_axis_test_of_a_real_cell_is_refused(cell: Cell) -> None:
    with raises_code(PreflightError, "RID-KEY-NEEDED", "ir361"):
        cell.run("axes", Person(answer="ir361"), unattended=True)
    assert cell.rules == []


def test_opening_a_session_on_a_real_cell_checks_the_axis_test(cell: Cell) -> None:
    with (
        raises_code(PreflightError, "RID-AXIS-TEST-MISSING", "axis1"),
        open_session(cell.loaded, cell.folder / "runs", Person(), None, AxisTestRule.REQUIRED),
    ):
        pass


@pytest.mark.parametrize(
    ("name", "value"),
    [("cell", "ir361"), ("runs", "/tmp"), ("cleared", True), ("live", {}), ("tester", "anna")],
)
def test_the_worker_refuses_fields_that_only_the_service_sets(
    name: str, value: object, tmp_path: Path
) -> None:
    kind = JobKind("axes") if name == "tester" else JobKind("record")
    document = {name: value} if kind == JobKind("axes") else {"motion": "motion.yaml", name: value}
    with raises_code(ConfigError, "RID-REQUEST-INVALID", kind.value, name):
        parse_request(kind, document, cell="ir361", runs=str(tmp_path), cleared=False)


@pytest.mark.parametrize("cleared", [False, True])
@MOVING
def test_the_service_sets_the_clearance_of_a_cell(name: str, cleared: bool, tmp_path: Path) -> None:
    kind = JobKind(operation(name).kind)
    needed: Mapping[str, object] = {
        "record": {"motion": "motion.yaml"},
        "stream": {"model": "model.json", "loop": "loops.json"},
    }.get(name, {})
    request = parse_request(kind, dict(needed), cell="ir361", runs=str(tmp_path), cleared=cleared)
    assert request.model_dump()["cleared"] is cleared


@pytest.mark.parametrize(
    ("kind", "field_name"),
    [(kind, each) for kind in JobKind for each in ("cell", "runs", "cleared", "live", "tester")],
)
def test_the_service_refuses_fields_that_only_the_service_sets(
    kind: JobKind, field_name: str, tmp_path: Path
) -> None:
    with raises_code(ConfigError, "RID-REQUEST-INVALID", kind.value):
        check_request(kind, {field_name: True}, tmp_path)


@pytest.mark.parametrize("beat", [None, object()])
def test_a_motion_monitors_the_service_that_started_it(
    beat: Any, cell: Cell, monkeypatch: pytest.MonkeyPatch
) -> None:
    watched: list[object] = []
    config = cell.loaded.config

    def record(*_: object, context: Any, **__: object) -> None:
        watched.append(context.service)
        raise OpenedError

    monkeypatch.setattr(run_session, "hold_reachable_cell", lambda *_: nullcontext((config, None)))
    monkeypatch.setattr(run_session, "record_motion", record)
    monkeypatch.setattr(Person, "service", beat)
    request = RunRequest("a run", "A run.", None, drive=lambda record: record(cast(Any, None)))
    with (
        pytest.raises(OpenedError),
        open_session(
            cell.loaded, cell.folder / "runs", Person(), None, AxisTestRule.HELD
        ) as session,
    ):
        session.record(request)
    assert watched == [beat]


class Client:
    """Client of a service with one real cell; it stores the requested jobs."""

    def __init__(self) -> None:
        self.begun: list[tuple[JobKind, bool]] = []

    def __enter__(self) -> Client:
        return self

    def __exit__(self, *_: object) -> None:
        pass

    def cells(self) -> list[Any]:
        return [SimpleNamespace(cell="real", simulated=False)]

    def lease(self, _name: str, note: str) -> Any:
        return nullcontext(SimpleNamespace(answer=None, run=self.run))

    def run(self, kind: JobKind, _body: object, *, cleared: bool, watch: object) -> Any:
        self.begun.append((kind, cleared))
        job, ended = SimpleNamespace(reason=""), SimpleNamespace(error=None, exit_code=0)
        return SimpleNamespace(job=job, ended=ended)


@pytest.mark.parametrize("name", ["check", *HELD, *BY_ITSELF])
def test_only_a_user_can_clear_a_served_real_cell(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    client = Client()
    monkeypatch.setattr("rid_daq.service.client.ServiceClient.at", lambda _: client)
    kind = JobKind(operation(name).kind)
    files = {
        field: "a"
        for field, info in operation(name).request.model_fields.items()
        if info.is_required()
    }
    request = operation(name).request.of({**files, "cell": "real"})

    def ask(person: Person) -> None:
        send("local", kind.operation, request, person)

    if not kind.operation.moves:
        ask(Person())
        assert client.begun == [(kind, True)]
        return
    with raises_code(PreflightError, "RID-ANSWER-NOBODY", "real"):
        ask(Person())
    with raises_code(PreflightError, "RID-ANSWER-NO", "real"):
        ask(Person(answer="yes"))
    assert client.begun == []
    ask(Person(answer="real"))
    assert client.begun == [(kind, True)]
