"""Live signals for a viewer: new bins, older bins, and losses of a slow viewer."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from rid_daq.service.signals.signal_bins import SignalBins, lanes_of
from rid_daq.service.signals.signal_history import SignalHistory
from rid_daq.service.signals.signal_view import MOST_LATE, MOST_SENT, SignalView
from tests.builders.javascript_types import assert_declared

JOINTS = ("axis1", "axis2")


def add_bins(history: SignalHistory, count: int, joints: tuple[str, ...] = JOINTS) -> None:
    """Append bins; the time and the values of each bin are equal to its number."""
    numbers = np.arange(history.count, history.count + count, dtype=float)
    values = np.repeat(numbers[:, np.newaxis], lanes_of(len(joints)), axis=1).astype(np.float32)
    history.append(joints, SignalBins(numbers, numbers % 7 == 0, values))


def parse(message: bytes | None) -> tuple[dict[str, Any], NDArray[Any], NDArray[Any]]:
    """Return head, times and lanes of a message."""
    assert message is not None
    (length,) = struct.unpack_from("<I", message)
    head = json.loads(message[4 : 4 + length])
    at, count = 4 + length, head["count"]
    assert at % 8 == 0
    times = np.frombuffer(message, "<f8", count, at)
    rows = np.frombuffer(message, "<f4", -1, at + 8 * count).reshape(-1, count)
    return head, times, rows


def test_a_message_contains_times_gaps_and_all_lanes() -> None:
    history = SignalHistory()
    view = SignalView("ir361", history)
    add_bins(history, 0)
    assert view.next_new() is None
    add_bins(history, 8)
    head, times, rows = parse(view.next_new())
    assert (head["cell"], head["joints"], head["first"]) == ("ir361", list(JOINTS), 0)
    assert_declared(head, "SignalsHead")
    assert times.tolist() == list(range(8))
    assert rows[0].tolist() == [1, 0, 0, 0, 0, 0, 0, 1]
    assert len(rows) == 1 + len(head["cell_lanes"]) + len(JOINTS) * len(head["lanes"])
    assert (rows[1:] == times).all()
    assert view.next_new() is None


def test_a_new_viewer_receives_new_bins_and_all_older_ones() -> None:
    history = SignalHistory(2000)
    add_bins(history, 1500)
    view = SignalView("ir361", history)
    add_bins(history, 3)
    assert parse(view.next_new())[0]["first"] == 1500
    got: set[int] = set()
    while (message := view.next_older()) is not None:
        head, times, _ = parse(message)
        assert head["count"] <= MOST_SENT
        assert head["lost"] == 0
        got.update(times.astype(int).tolist())
    assert got == set(range(1500))
    assert view.next_new() is None


def test_a_slow_viewer_loses_bins_and_is_told_how_many() -> None:
    history = SignalHistory(1000)
    view = SignalView("ir361", history)
    add_bins(history, 5)
    view.next_new()
    add_bins(history, 50 + MOST_LATE)
    head, times, _ = parse(view.next_new())
    assert head["lost"] == 50
    assert head["count"] == MOST_LATE
    assert times[0] == head["first"] == 55
    assert view.next_new() is None


def test_a_viewer_that_returns_receives_only_what_it_has_missed() -> None:
    history = SignalHistory()
    add_bins(history, 100)
    view = SignalView("ir361", history, history.key, 90)
    head, _, _ = parse(view.next_new())
    assert (head["first"], head["count"]) == (90, 10)
    assert view.next_new() is view.next_older() is None
    forgetful = SignalView("ir361", history, "another key", 90)
    assert forgetful.next_new() is None
    assert parse(forgetful.next_older())[0]["count"] == 100


def test_other_joints_begin_a_new_history() -> None:
    history = SignalHistory()
    view = SignalView("ir361", history)
    add_bins(history, 10)
    before = parse(view.next_new())[0]
    add_bins(history, 4, ("axis1", "axis2", "axis3"))
    head, _, _ = parse(view.next_new())
    assert head["key"] != before["key"]
    assert (head["first"], head["count"], len(head["joints"])) == (0, 4, 3)


def test_a_history_keeps_the_newest_bins_at_any_size_of_an_addition() -> None:
    for sizes in ((250,), (60, 70), (99, 1, 5)):
        history = SignalHistory(100)
        for size in sizes:
            add_bins(history, size)
        count = sum(sizes)
        assert (history.count, history.oldest) == (count, count - 100)
        kept = history.bins(history.oldest, 100)
        assert kept.end_s.tolist() == list(range(count - 100, count))
