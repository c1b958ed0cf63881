"""The console of a job: output, questions and held keys as events.

Displayed events equal the output of the command.
"""

from __future__ import annotations

import io
import json
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from math import inf
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from acquisition.hold_to_run.dead_man import DEAD_MAN_S
from acquisition.hold_to_run.dead_man_thread import KeySource
from acquisition.task.service_beat import SERVICE_LIMIT_S, ServiceBeat
from config.errors import ConfigError, PreflightError
from rid_daq.blocks.block import Column, Heading, Interval, Next, Table, Text, Verdict
from rid_daq.blocks.plot import Axis, Line, Panel, Plot
from rid_daq.service.remote_jobs import _EventDisplay
from rid_daq.service.workers.running_job import EventTail
from rid_daq.terminal.console import Console
from rid_daq.terminal.job_events import KeyRefusalEvent, ProgressEvent, QuestionEvent, ResultEvent
from rid_daq.worker.job_console import EventFile, JobConsole
from rid_daq.worker.orders import Orders
from tests.builders.clock import Clock
from tests.builders.raised_codes import raises_code


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def orders(clock: Clock) -> Orders:
    return Orders(io.StringIO(), clock)


@pytest.fixture
def events(tmp_path: Path) -> Path:
    return tmp_path / "events.jsonl"


@pytest.fixture
def console(events: Path, orders: Orders) -> Iterator[JobConsole]:
    with EventFile(events) as file:
        yield JobConsole(events=file, orders=orders)


def write_output(console: Console) -> None:
    console.say("Cell ir361: 3 drives.\x1b[31m")
    columns = (Column(title="drive", is_text=True), Column(title="is", is_text=True))
    rows = (("axis1", "ok"), ("axis2", "RED"))
    drives = Table(columns=columns, rows=rows, failed=(False, True))
    console.result({"passed": False, "sigma": 0.25}, [drives])
    console.verdict(False, "Not ready: no motion.")
    console.next_step("check", "ir361")


def test_displayed_events_equal_the_output_of_the_command(
    console: JobConsole, events: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_output(Console())
    here = capsys.readouterr().out
    write_output(console)
    assert capsys.readouterr().out == ""
    shown = _EventDisplay(Console())
    for event in EventTail(events).read_new():
        shown(None, event)
    assert capsys.readouterr().out == here


@pytest.mark.parametrize("as_json", [False, True])
def test_a_displayed_result_equals_the_output_of_the_command(
    console: JobConsole, events: Path, capsys: pytest.CaptureFixture[str], as_json: bool
) -> None:
    line = Line(label="torque", x=(0.0, 1.0), y=(0.0, 1.0), stroke=0)
    x, y = Axis(label="time", unit="s"), Axis(label="torque", unit="N m")
    blocks = (
        Heading(text="Errors"),
        Text(text="From a file.\x1b[31m", is_note=True),
        Table(
            columns=(Column(title="joint", is_text=True), Column(title="error", unit="%")),
            rows=(("axis1", Interval(value=1.25, reach=0.5)), ("axis2", 12.345), ("axis3", None)),
            failed=(False, True, False),
        ),
        Plot(name="torque", panels=(Panel(x=x, y=y, lines=(line,)),)),
        Verdict(passed=False, text="Failed: axis2"),
        Next(words=("identify", "a run")),
    )
    Console(as_json).result({"passed": False}, blocks)
    here = capsys.readouterr().out
    console.result({"passed": False}, blocks)
    shown = _EventDisplay(Console(as_json))
    (event,) = EventTail(events).read_new()
    shown(None, event)
    assert capsys.readouterr().out == here != ""
    assert b"\x1b" not in events.read_bytes()
    assert b"u001b" not in events.read_bytes()


def test_the_json_document_equals_that_of_the_command(
    console: JobConsole, events: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    write_output(console)
    shown = _EventDisplay(Console(as_json=True))
    for event in EventTail(events).read_new():
        shown(None, event)
    assert capsys.readouterr().out == '{\n  "passed": false,\n  "sigma": 0.25\n}\n'


def test_a_line_truncated_by_a_kill_is_ignored(console: JobConsole, events: Path) -> None:
    console.result({"a": 1}, [])
    tail = EventTail(events)
    with events.open("ab") as file:
        file.write(b'{"kind": "said", "at_s": 1.0, "te')
    assert [type(each) for each in tail.read_new()] == [ResultEvent]
    with events.open("ab") as file:
        file.write(b"\n")
    assert list(tail.read_new()) == []


def test_progress_is_reported_periodically_and_at_its_end(
    console: JobConsole, events: Path
) -> None:
    with console.progress("recording", 100.0, "periods") as progress:
        for done in range(101):
            progress.update(float(done), "measuring")
    reports = [each for each in EventTail(events).read_new() if isinstance(each, ProgressEvent)]
    assert [reports[0].done, reports[-1].done] == [0.0, 100.0]
    assert len(reports) < 50


def answer_questions(orders: Orders, events: Path, *texts: str) -> None:
    """Answer the next questions in a separate thread, like a service."""

    def work() -> None:
        tail, left = EventTail(events), list(texts)
        while left:
            for event in tail.read_new():
                if isinstance(event, QuestionEvent):
                    orders.take({"answer": event.question, "text": left.pop(0)})
            time.sleep(0.002)

    threading.Thread(target=work, daemon=True).start()


def test_a_question_is_repeated_until_its_answer_is_valid(
    console: JobConsole, orders: Orders, events: Path
) -> None:
    def number(text: str) -> int:
        if not text.isdigit():
            raise ConfigError("give a number")
        return int(text)

    answer_questions(orders, events, "two", "2")
    assert console.ask("How many?", number) == 2
    questions = [
        each.text for each in EventTail(events).read_new() if isinstance(each, QuestionEvent)
    ]
    assert questions == ["How many?", "give a number. How many?"]


def test_a_question_contains_the_answers_for_buttons_of_a_page(
    console: JobConsole, orders: Orders, events: Path
) -> None:
    answer_questions(orders, events, "-")
    assert console.ask("Which way?", str, [("As was said", "+"), ("The other way", "-")]) == "-"
    (questions,) = [
        each for each in EventTail(events).read_new() if isinstance(each, QuestionEvent)
    ]
    assert [(each.label, each.text) for each in questions.choices] == [
        ("As was said", "+"),
        ("The other way", "-"),
    ]


@pytest.mark.parametrize(("text", "expected"), [("yes", True), ("no", False), ("", False)])
def test_only_yes_confirms(
    console: JobConsole, orders: Orders, events: Path, text: str, expected: bool
) -> None:
    answer_questions(orders, events, text)
    assert console.confirm("Attached?") is expected


def test_without_the_service_a_question_fails_and_the_job_is_terminated(
    events: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    killed: list[Any] = []
    monkeypatch.setattr("os.kill", lambda *arguments: killed.append(arguments))
    orders = Orders(io.StringIO(""))
    with EventFile(events) as file:
        console = JobConsole(events=file, orders=orders)
        orders.start()
        with raises_code(PreflightError, "RID-ANSWER-NOBODY", "answered"):
            console.confirm("Attached?")
    assert len(killed) == 1


@contextmanager
def held_keys(
    console: JobConsole, tapped: Callable[[str], None] = lambda _key: None
) -> Iterator[KeySource]:
    """Yield the object that reads held keys from the console, for a robot that is ready to move."""
    with console.keys(tapped) as keys:
        keys.begin()
        yield keys


def test_a_key_is_requested_when_the_robot_is_ready_and_earlier_keys_are_ignored(
    holder: Holder, console: JobConsole, events: Path
) -> None:
    with console.keys(lambda _key: None) as keys:
        assert EventTail(events).read_new() == []
        holder.send(held="+")
        assert keys.look() is None
        keys.begin()
        assert [event.kind for event in EventTail(events).read_new()] == ["asked"]
        holder.send(held="+")
        assert keys.look() is None, "the key was already held"
        holder.send(held="")
        holder.send(held="+")
        assert keys.look() is not None


@pytest.mark.promise("service-heartbeat")
@pytest.mark.parametrize(
    ("later_s", "lease_s", "code"),
    [(SERVICE_LIMIT_S + 0.1, inf, "RID-SERVICE-LOST"), (1.0, 1.0, "RID-CLIENT-LOST")],
)
def test_a_question_ends_without_service_or_lease_even_if_it_is_answered(
    events: Path, clock: Clock, later_s: float, lease_s: float, code: str
) -> None:
    service = ServiceBeat.create()
    service.write(clock.now_s, clock.now_s + lease_s)
    orders = Orders(io.StringIO(), clock, service)
    with EventFile(events) as file:
        console = JobConsole(events=file, orders=orders)
        orders.take({"answer": 1, "text": "y"})
        assert console.confirm("Attached?")
        orders.take({"answer": 2, "text": "y"})
        clock.now_s += later_s
        with pytest.raises(PreflightError) as refused:
            console.confirm("Attached?")
    assert refused.value.refusal == code


class Holder:
    """A page that sends held keys and taps to the worker."""

    def __init__(self, orders: Orders, clock: Clock) -> None:
        self._orders, self._clock = orders, clock
        self._sequence = 0

    def send(self, late_s: float = 0.0, **key: str) -> None:
        """Send a key with the answer to a challenge that was issued `late_s` ago."""
        self._sequence += 1
        issued_s = self._clock.now_s - late_s
        line = json.dumps(
            {**key, "sender": "1/lease", "sequence": self._sequence, "issued_s": issued_s}
        )
        self._orders.take(json.loads(line))


@pytest.fixture
def holder(orders: Orders, clock: Clock) -> Holder:
    return Holder(orders, clock)


def refusals(events: Path) -> list[KeyRefusalEvent]:
    return [event for event in EventTail(events).read_new() if isinstance(event, KeyRefusalEvent)]


def test_a_held_key_is_valid_only_for_the_hold_to_run_time(
    holder: Holder, clock: Clock, console: JobConsole
) -> None:
    taps: list[str] = []
    with held_keys(console, taps.append) as keys:
        holder.send(tapped="2")
        holder.send(held="+")
        held = keys.look()
        assert held is not None
        assert (held.key, held.until_s) == ("+", clock.now_s + DEAD_MAN_S)
        clock.now_s += DEAD_MAN_S
        assert keys.look() is None
        holder.send(held="+")
        assert keys.look() is None, "the same press"
        holder.send(held="")
        holder.send(held="+")
        assert keys.look() is not None
        holder.send(held="")
        assert keys.look() is None, "let go"
    holder.send(tapped="3")
    assert taps == ["2"]


@pytest.mark.promise("held-key-fresh")
def test_a_held_key_expires_by_the_age_of_its_challenge(
    holder: Holder, clock: Clock, console: JobConsole
) -> None:
    with held_keys(console) as keys:
        holder.send(held="+", late_s=0.2)
        held = keys.look()
        assert held is not None
        assert held.until_s == pytest.approx(clock.now_s + 0.1), "0.3 s after the challenge"
        clock.now_s += 0.11
        assert keys.look() is None


@pytest.mark.promise("held-key-slow-link")
def test_a_slow_link_is_reported_once_per_press_with_its_round_trip(
    holder: Holder, clock: Clock, console: JobConsole, events: Path
) -> None:
    with held_keys(console) as keys:
        for _ in range(5):
            holder.send(held="+", late_s=0.34)
            assert keys.look() is None
            clock.now_s += 0.1
    (refused,) = refusals(events)
    assert refused.round_trip_ms == pytest.approx(340.0)
    assert "340" in refused.text


@pytest.mark.promise("held-key-slow-link")
def test_a_stalled_link_is_reported_when_the_key_expires(
    holder: Holder, clock: Clock, console: JobConsole, events: Path
) -> None:
    with held_keys(console) as keys:
        holder.send(held="+", late_s=0.04)
        clock.now_s += 0.21
        assert keys.look() is None
        (refused,) = refusals(events)
        assert refused.round_trip_ms == pytest.approx(250.0)
        holder.send(held="+")
        assert keys.look() is None


@pytest.mark.promise("held-key-tap")
def test_a_late_tap_selects_nothing_and_keys_are_ignored_until_the_next_tap(
    holder: Holder, console: JobConsole
) -> None:
    taps: list[str] = []
    with held_keys(console, taps.append) as keys:
        holder.send(tapped="2", late_s=0.31)
        holder.send(held="+")
        assert keys.look() is None, "the key must not move an axis that was not selected"
        holder.send(held="")
        holder.send(tapped="2")
        holder.send(held="+")
        assert keys.look() is not None
    assert taps == ["2"]


def test_a_key_held_from_one_question_to_the_next_must_be_released(
    holder: Holder, console: JobConsole
) -> None:
    with held_keys(console):
        holder.send(held=" ")
    holder.send(held=" ")
    with held_keys(console) as keys:
        holder.send(held=" ")
        assert keys.look() is None
        holder.send(held="")
        holder.send(held=" ")
        assert keys.look() is not None


def test_a_remote_command_line_cannot_hold_a_key() -> None:
    shown = _EventDisplay(Console())
    event = QuestionEvent(at_s=0.0, question=1, form="hold", text="")
    with raises_code(ConfigError, "RID-KEY-NEEDED"):
        shown(SimpleNamespace(id="1"), event)


@pytest.mark.promise("safety-clock")
def test_progress_is_still_reported_after_the_clock_was_set_back(
    console: JobConsole, events: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    now = Clock()
    monkeypatch.setattr("rid_daq.worker.job_console.safety_now_s", now)
    with console.progress("recording", 10.0, "s") as shown:
        shown.update(1.0, "")
        monkeypatch.setattr("time.time", lambda: 0.0)
        now.now_s += 1.0
        shown.update(2.0, "")
    reports = [event for event in EventTail(events).read_new() if isinstance(event, ProgressEvent)]
    assert [event.done for event in reports] == [1.0, 2.0]
