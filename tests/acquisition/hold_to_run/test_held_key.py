"""Held-key logic if messages are late, lost, repeated or reordered."""

from __future__ import annotations

import itertools
import json
from dataclasses import dataclass

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from acquisition.hold_to_run.dead_man import DEAD_MAN_S
from acquisition.hold_to_run.held_key import (
    CHALLENGE_LIMIT_S,
    LARGEST_SEQUENCE,
    HeldKey,
    KeyMessage,
    KeyVerdict,
)

NOW_S = 100.0


class Worker:
    """The held-key logic with a simulated clock and a message counter for each sender."""

    def __init__(self) -> None:
        self.key = HeldKey()
        self.key.set_accepting(True)
        self.now_s = NOW_S
        self.numbers: dict[str, int] = {}

    def receive(
        self, key: str, sender: str = "a", *, late_s: float = 0.0, tapped: bool = False
    ) -> KeyVerdict:
        number = self.numbers[sender] = self.numbers.get(sender, 0) + 1
        issued_s = self.now_s - late_s
        return self.key.process(KeyMessage(key, tapped, sender, number, issued_s), self.now_s)

    @property
    def held_key(self) -> str:
        held = self.key.held(self.now_s)
        return "" if held is None else held.key


def test_a_key_counts_while_messages_are_fresh_and_until_its_release() -> None:
    worker = Worker()
    for _ in range(20):
        assert worker.receive("+", late_s=0.04) is KeyVerdict.COUNTS
        assert worker.held_key == "+"
        worker.now_s += 0.1
    worker.receive("")
    assert worker.held_key == ""


@pytest.mark.promise("held-key-fresh")
@pytest.mark.parametrize(
    ("late_s", "lasts_s"), [(0.0, 0.2), (0.05, 0.2), (0.1, 0.2), (0.2, 0.1), (0.29, 0.01)]
)
def test_a_key_counts_for_the_rest_of_the_challenges_age_but_at_most_the_dead_man_time(
    late_s: float, lasts_s: float
) -> None:
    worker = Worker()
    worker.receive("+", late_s=late_s)
    held = worker.key.held(worker.now_s)
    assert held is not None
    assert held.until_s == pytest.approx(NOW_S + lasts_s)


@pytest.mark.promise("held-key-fresh")
@pytest.mark.parametrize("late_s", [0.301, 4.0, -0.001, float("nan"), NOW_S])
def test_a_challenge_that_is_too_old_unknown_or_in_the_future_does_not_count(late_s: float) -> None:
    worker = Worker()
    assert worker.receive("+", late_s=late_s) is KeyVerdict.LATE
    assert worker.held_key == ""


@pytest.mark.promise("held-key-new-press")
def test_after_a_gap_a_key_counts_only_after_a_release_and_a_new_press() -> None:
    worker = Worker()
    worker.receive("+")
    worker.now_s += DEAD_MAN_S
    assert worker.held_key == ""
    assert worker.receive("+") is KeyVerdict.UNRELEASED
    worker.receive("")
    assert worker.receive("+") is KeyVerdict.COUNTS


@pytest.mark.promise("held-key-new-press")
def test_a_press_whose_first_message_is_late_never_counts() -> None:
    worker = Worker()
    worker.receive("")
    assert worker.receive("+", late_s=0.34) is KeyVerdict.LATE
    assert worker.receive("+") is KeyVerdict.UNRELEASED


@pytest.mark.promise("held-key-new-press")
def test_another_key_without_a_release_does_not_count_and_ends_the_press() -> None:
    worker = Worker()
    worker.receive("+")
    assert worker.receive("-") is KeyVerdict.UNRELEASED
    assert worker.held_key == ""
    assert worker.receive("+") is KeyVerdict.UNRELEASED


@pytest.mark.promise("held-key-replay")
def test_a_repeated_or_overtaken_message_does_not_count() -> None:
    worker = Worker()
    first = KeyMessage("+", False, "a", 5, NOW_S)
    assert worker.key.process(first, NOW_S) is KeyVerdict.COUNTS
    assert worker.key.process(first, NOW_S + 0.1) is KeyVerdict.IGNORED
    late = KeyMessage("+", False, "a", 4, NOW_S + 0.1)
    assert worker.key.process(late, NOW_S + 0.1) is KeyVerdict.IGNORED
    assert worker.key.held(NOW_S + DEAD_MAN_S) is None


@pytest.mark.promise("held-key-one-connection")
def test_a_press_belongs_to_one_sender() -> None:
    worker = Worker()
    worker.receive("", "b")
    worker.receive("+", "a")
    worker.now_s += 0.1
    assert worker.receive("+", "b") is KeyVerdict.ELSEWHERE
    worker.now_s += 0.15
    assert worker.held_key == "", "a message of another sender does not keep the key held"
    assert worker.receive("+", "b") is KeyVerdict.UNRELEASED, (
        "sender b pressed the key while it still belonged to sender a"
    )
    worker.receive("", "b")
    assert worker.receive("+", "b") is KeyVerdict.COUNTS
    worker.receive("", "a")
    assert worker.held_key == "+", "the release of another sender's key is ignored"


@pytest.mark.promise("held-key-one-connection")
def test_a_press_does_not_continue_over_another_connection() -> None:
    worker = Worker()
    worker.receive("+", "first connection")
    worker.now_s += 1.0
    assert worker.receive("+", "second connection") is KeyVerdict.UNRELEASED
    assert worker.receive("", "third connection") is KeyVerdict.COUNTS
    assert worker.receive("+", "third connection") is KeyVerdict.COUNTS


@pytest.mark.promise("held-key-tap")
def test_after_a_late_tap_its_sender_cannot_hold_a_key_until_the_next_tap() -> None:
    worker = Worker()
    assert worker.receive("2", late_s=0.31, tapped=True) is KeyVerdict.LATE
    assert worker.receive("+") is KeyVerdict.TAP_LOST
    worker.receive("")
    assert worker.receive("+") is KeyVerdict.TAP_LOST
    worker.receive("")
    assert worker.receive("2", tapped=True) is KeyVerdict.COUNTS
    assert worker.receive("+") is KeyVerdict.COUNTS


def test_keys_count_only_while_a_job_accepts_them() -> None:
    worker = Worker()
    worker.receive("+")
    worker.key.set_accepting(False)
    assert worker.receive("+") is KeyVerdict.IGNORED
    worker.key.set_accepting(True)
    assert worker.receive("+") is KeyVerdict.UNRELEASED


@pytest.mark.parametrize("tapped", [False, True])
def test_a_message_survives_the_conversion_to_an_order_and_back(tapped: bool) -> None:
    message = KeyMessage("2+", tapped, "7/lease", 12, 345.678)
    assert KeyMessage.from_order(json.loads(json.dumps(message.to_order()))) == message


@pytest.mark.parametrize(
    "wrong",
    [
        {"sequence": -1},
        {"sequence": True},
        {"sequence": 1.5},
        {"sequence": LARGEST_SEQUENCE},
        {"sequence": None},
        {"sender": 3},
        {"issued_s": "now"},
        {"held": "x" * 9},
        {"held": None},
        {"held": ["+"]},
    ],
)
def test_an_incomplete_or_invalid_message_is_rejected(wrong: dict[str, object]) -> None:
    whole = KeyMessage("+", False, "7/lease", 12, 345.678).to_order()
    assert KeyMessage.from_order({**whole, **wrong}) is None
    for name in whole:
        assert KeyMessage.from_order({each: whole[each] for each in whole if each != name}) is None


STEP_MS = 10
CHALLENGE_MS = 30


@dataclass(frozen=True)
class MessageInTransit:
    """A message on its way to the worker, with the number of the key press that it reports."""

    message: KeyMessage
    press: int


@settings(max_examples=300, deadline=None)
@given(
    presses=st.lists(st.tuples(st.integers(0, 60), st.integers(0, 200)), min_size=1, max_size=4),
    delays_to_person=st.lists(st.integers(0, 150), min_size=1, max_size=20),
    delays_to_worker=st.lists(st.integers(0, 150), min_size=1, max_size=20),
    replays=st.sets(st.integers(0, 200)),
    connections=st.lists(st.integers(0, 1), min_size=4, max_size=4),
)
@example(  # a link that stalls for a second while the key is held, and recovers
    presses=[(0, 200)],
    delays_to_person=[0],
    delays_to_worker=[0] * 20 + [100],
    replays=set(),
    connections=[0] * 4,
)
@pytest.mark.promise("held-key-fresh", "held-key-new-press")
def test_with_late_lost_reordered_or_repeated_messages_a_key_counts_only_near_its_press(
    presses: list[tuple[int, int]],
    delays_to_person: list[int],
    delays_to_worker: list[int],
    replays: set[int],
    connections: list[int],
) -> None:
    """Draw pauses, presses and delays in steps of 10 ms.

    While a key is held, the simulated person answers each new challenge.
    """
    held_at: dict[int, int] = {}  # number of a step: number of the press held at that step
    step = 0
    for press, (pause, length) in enumerate(presses, start=1):
        step += pause + 1
        held_at.update(dict.fromkeys(range(step, step + length), press))
        step += length
    on_the_way: dict[int, list[MessageInTransit]] = {}
    challenges: dict[int, list[int]] = {}
    delays = itertools.cycle(delays_to_worker)
    newest, numbers, sent = -1, [0, 0], 0

    def send(key: str, press: int, at: int) -> None:
        nonlocal sent
        connection = connections[press - 1]
        numbers[connection] += 1
        issued_s = 0.01 * newest if newest >= 0 else 0.0
        message = MessageInTransit(
            KeyMessage(key, False, str(connection), numbers[connection], issued_s), press
        )
        arrives = at + next(delays)
        on_the_way.setdefault(arrives, []).append(message)
        if sent in replays:
            on_the_way.setdefault(arrives + 7, []).append(message)
        sent += 1

    key = HeldKey()
    key.set_accepting(True)
    # number that the worker gave to a press: number of the person's press
    counted: dict[int, int] = {}
    for now in range(step + 400):
        if now * STEP_MS % CHALLENGE_MS == 0:
            arrives = now + delays_to_person[now % len(delays_to_person)]
            challenges.setdefault(arrives, []).append(now)
        known = newest
        newest = max([newest, *challenges.pop(now, [])])
        press, before = held_at.get(now, 0), held_at.get(now - 1, 0)
        if press != before:
            if before:
                send("", before, now)
            if press:
                send("", press, now)
        if press and (newest > known or press != before):
            send("+", press, now)
        for arrived in on_the_way.pop(now, []):
            key.process(arrived.message, 0.01 * now)
            counts = key.held(0.01 * now)
            if counts is not None and counts.press not in counted:
                counted[counts.press] = arrived.press
        counts = key.held(0.01 * now)
        if counts is not None:
            near = range(now, now - round(CHALLENGE_LIMIT_S * 1000 / STEP_MS), -1)
            assert any(each in held_at for each in near), (
                "the key still counts as held 0.3 s after its release"
            )
    assert len(set(counted.values())) == len(counted), (
        "the worker counted one press of the person twice"
    )
