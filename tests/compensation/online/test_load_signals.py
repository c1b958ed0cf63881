"""A load that is taken up or put down at a signal: a digital input of a drive."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from acquisition.motion.load_changes import LoadChange, LoadChanges
from acquisition.supervision.cycle import SetPoint
from acquisition.supervision.stop_reason import StopCode
from compensation.online import path_kernels as path
from compensation.online.load_kernels import (
    CATCH_UP,
    most_possible_loads,
    possible_loads,
    set_load,
)
from compensation.online.online import OnlineFeedforward
from config.errors import ConfigError, PreflightError
from tests.builders.load_signals import (
    ALONE,
    AT_S,
    BIT,
    LOADED,
    RAMP_S,
    answers_of,
    change,
    changes_of,
    follow,
    forward_of,
    from_time,
    outcomes_of,
    source_of,
    stated_at,
)
from tests.builders.point_streams import (
    T,
    answers_at,
    arrays,
    held_limits,
    planned,
)
from tests.builders.raised_codes import raises_code, raises_invalid


@pytest.mark.parametrize("late_s", [-0.05, 0.0, 0.05])
def test_the_load_follows_the_signal(late_s: float) -> None:
    source = source_of(forward_of(change()))
    points = follow(source, from_time(AT_S + late_s))
    held_limits(points)
    assert source.stop is None
    (came,) = changes_of(source)
    assert came.lateness_s == pytest.approx(late_s, abs=T)
    assert came.came_s is not None
    assert came.lateness_s is not None
    assert any(f"{abs(1e3 * came.lateness_s):.0f} ms" in note for note in source.notes)
    ahead, expected = arrays(points)[2], stated_at(came.came_s)
    begun = math.floor(came.came_s / T)
    # before the signal the load is not known; the ramp is caught up half way
    np.testing.assert_allclose(ahead[: begun - 4], stated_at(5.0)[: begun - 4], atol=1e-9)
    inside = slice(begun + 10, begun + 60)
    effect = np.abs(expected - stated_at(5.0))[inside].max()
    assert np.abs(ahead - expected)[inside].max() < 0.15 * effect


@pytest.mark.fault(52)
def test_a_missed_signal_stops_the_robot_on_its_path_at_once(
    measured: Callable[[str], None],
) -> None:
    source = source_of(forward_of(change()))
    points = follow(source, lambda _: False)
    held_limits(points)
    assert source.stop is not None
    assert (source.stop.code, source.stop.joint) == (StopCode.LOAD_SIGNAL, "axis2")
    nearest = np.abs(arrays(points)[0][:, np.newaxis] - planned().position).max(axis=2).min(axis=1)
    assert nearest.max() < 1.1 * np.abs(np.diff(planned().position, axis=0)).max()
    index = [point.sample_index * T for point in points]
    assert AT_S + 0.2 < index[-1] < AT_S + 0.2 + 0.6
    assert changes_of(source)[0].came_s is None
    assert source._signals is not None
    assert source._signals.notes == []
    rest_s = index[-1] - (AT_S + 0.2)
    measured(f"no signal: at rest on the path {1e3 * rest_s:.0f} ms after the window's end")


def test_a_missed_signal_can_leave_the_robot_without_the_load() -> None:
    source = source_of(forward_of(change(missed="unloaded")))
    points = follow(source, lambda _: False)
    assert source.stop is None
    np.testing.assert_allclose(arrays(points)[2], stated_at(5.0), atol=1e-9)
    assert len(source.notes) == 1


@pytest.mark.fault(52)
@pytest.mark.parametrize("signal_s", [0.5, AT_S + 0.4])
def test_a_signal_outside_its_window_stops_the_robot(
    signal_s: float, measured: Callable[[str], None]
) -> None:
    source = source_of(forward_of(change(missed="unloaded")))
    points = follow(source, from_time(signal_s))
    held_limits(points)
    assert source.stop is not None
    assert source.stop.code is StopCode.LOAD_SIGNAL
    assert source.stop.value == pytest.approx(signal_s, abs=T)
    rest_s = points[-1].sample_index * T - signal_s
    measured(f"signal at {signal_s:g} s: at rest on the path {1e3 * rest_s:.0f} ms later")


@pytest.mark.parametrize("signal_s", [0.5, AT_S + 0.4])
def test_a_signal_outside_its_window_can_be_followed_and_is_reported(signal_s: float) -> None:
    source = source_of(forward_of(change(missed="unloaded", outside="report")))
    points = follow(source, from_time(signal_s))
    assert source.stop is None
    (came,) = changes_of(source)
    assert not came.in_window
    assert len(source.notes) == 1
    end = math.ceil((signal_s + RAMP_S) / T)
    expected = stated_at(signal_s)[end : end + 60]
    effect = np.abs(expected - stated_at(5.0)[end : end + 60]).max()
    assert np.abs(arrays(points)[2][end : end + 60] - expected).max() < 0.15 * effect


@pytest.mark.fault(52)
@pytest.mark.parametrize("reaction", [{}, {"missed": "unloaded", "outside": "report"}])
def test_a_motion_does_not_begin_while_its_input_is_active(
    reaction: dict[str, Any], measured: Callable[[str], None]
) -> None:
    """The part is there already, or the switch is stuck: the input cannot show the grip."""
    source = source_of(forward_of(change(**reaction)))
    answers = answers_of(planned().position[0], level=True)
    with raises_code(PreflightError, "RID-LOAD-SIGNAL-ACTIVE", "axis2"):
        source.refuse_begin(answers)
    assert outcomes_of(source) == ["already_active"]
    measured("active input: refused before the drives are enabled")


def test_a_motion_begins_with_an_inactive_input() -> None:
    source = source_of(forward_of(change()))
    source.refuse_begin(answers_of(planned().position[0], level=False))
    assert outcomes_of(source) == ["not_reached"]


def test_an_input_that_becomes_active_in_the_approach_leaves_the_robot_at_the_start() -> None:
    source = source_of(forward_of(change(missed="unloaded", outside="report")))
    assert follow(source, lambda _: True) == []
    assert source.stop is not None
    assert (source.stop.code, source.stop.joint) == (StopCode.LOAD_SIGNAL, "axis2")
    (found,) = changes_of(source)
    assert (found.came_s, found.outcome) == (None, "already_active")
    source.watch(answers_of(planned().position[0], level=False))  # the robot rests at the start
    assert source.stop.code is StopCode.LOAD_SIGNAL
    assert outcomes_of(source) == ["already_active"]


def test_a_switch_that_was_active_for_a_while_in_the_approach_does_not_prevent_the_motion() -> None:
    source = source_of(forward_of(change()))
    source.watch(answers_of(planned().position[0], level=True))
    follow(source, from_time(AT_S))
    assert source.stop is None
    assert outcomes_of(source) == ["came"]


@pytest.mark.parametrize("reaction", [{}, {"missed": "unloaded", "outside": "report"}])
@pytest.mark.parametrize("since_s", [0.4, AT_S + 0.05])
def test_an_input_that_is_active_before_its_change_is_awaited_stops_the_robot(
    since_s: float, reaction: dict[str, Any]
) -> None:
    """The second change is awaited from 1.1 s on; its window begins at 1.4 s."""
    first = LoadChange(at_s=AT_S + 0.1, payload="model", ramp_s=RAMP_S)
    source = source_of(forward_of(first, change(1.5, **reaction), loads=(LOADED, ALONE)))
    points = follow(source, from_time(since_s))
    held_limits(points)
    assert source.stop is not None
    assert (source.stop.code, source.stop.joint) == (StopCode.LOAD_SIGNAL, "axis2")
    assert outcomes_of(source) == ["begun", "already_active"]
    assert changes_of(source)[1].came_s is None
    last_s = points[-1].sample_index * T
    assert 1.4 < last_s < 1.4 + 0.6


def test_a_switch_that_reports_two_changes_must_be_released_between_them() -> None:
    """The switch closes at each of two parts."""
    again = change(1.4), change(1.9)
    source = source_of(forward_of(*again, loads=(LOADED, ALONE)))
    follow(source, lambda now_s: 1.4 <= now_s < 1.55 or now_s >= 1.9)
    assert source.stop is None
    assert [each.lateness_s for each in changes_of(source)] == pytest.approx([0, 0], abs=T)

    stuck = source_of(forward_of(*again, loads=(LOADED, ALONE)))
    follow(stuck, from_time(1.4))
    assert stuck.stop is not None
    assert stuck.stop.code is StopCode.LOAD_SIGNAL
    assert outcomes_of(stuck) == ["came", "already_active"]


def test_a_signal_in_the_ramp_of_the_previous_change_has_its_true_time() -> None:
    """The first change comes late, so that its ramp ends in the window of the second one."""
    late = change(missed="unloaded", outside="report")
    source = source_of(forward_of(late, change(1.5, bit=BIT + 1), loads=(LOADED, ALONE)))
    points: list[SetPoint] = []
    while (point := source.at(len(points))) is not None:
        points.append(point)
        time_s = point.sample_index * T
        word = int(time_s >= 1.35) << BIT | int(time_s >= 1.43) << BIT + 1
        source.watch(answers_at(np.array(point.position), inputs=(0, word, 0)))
    assert source.stop is None
    assert [each.came_s for each in changes_of(source)] == pytest.approx([1.35, 1.43], abs=T)
    last = slice(math.ceil(1.9 / T), -10)
    assert np.abs(arrays(points)[2] - stated_at(5.0))[last].max() < 0.02


def test_changes_that_were_not_awaited_were_not_reached() -> None:
    """The first signal is missed and stops the robot before the other changes."""
    stated = LoadChange(at_s=2.0, payload="none", ramp_s=RAMP_S)
    changes, loads = (change(), change(1.5), stated), (LOADED, ALONE, LOADED)
    source = source_of(forward_of(*changes, loads=loads))
    assert outcomes_of(source) == ["not_reached"] * 3
    for row in range(3):
        source.watch(answers_of(planned().position[0], level=False))
        source.at(row)
    assert outcomes_of(source) == ["awaited", "not_reached", "not_reached"]
    source = source_of(forward_of(*changes, loads=loads))
    follow(source, lambda _: False)
    assert source.stop is not None
    assert outcomes_of(source) == ["missed", "not_reached", "not_reached"]
    assert [each.begin_s for each in changes_of(source)] == [None, None, None]


def test_the_signal_must_be_active_for_the_debounce_time() -> None:
    """A bouncing contact counts from the time at which it stays closed."""
    source = source_of(forward_of(change(debounce_s=0.02)))
    bounces = (AT_S, AT_S + 0.016)
    follow(source, lambda now_s: any(0 <= now_s - t < 0.008 for t in bounces) or now_s > 1.048)
    came_s = changes_of(source)[0].came_s
    assert came_s == pytest.approx(1.052, abs=T)


def test_lost_answers_do_not_count_as_a_signal() -> None:
    source = source_of(forward_of(change(debounce_s=0.0)))
    follow(source, from_time(AT_S), lost=lambda now_s: AT_S <= now_s < AT_S + 0.1)
    assert changes_of(source)[0].came_s == pytest.approx(AT_S + 0.1, abs=T)


def test_an_input_can_be_active_at_low_level() -> None:
    source = source_of(forward_of(change(active="low")))
    follow(source, lambda now_s: now_s < AT_S)
    assert changes_of(source)[0].lateness_s == pytest.approx(0.0, abs=T)


def test_what_was_not_taken_up_needs_no_signal_to_be_put_down() -> None:
    up = change(missed="unloaded")
    down = change(1.5, "none", active="low")
    source = source_of(forward_of(up, down, loads=(LOADED, ALONE)))
    points = follow(source, lambda _: False)
    assert source.stop is None
    np.testing.assert_allclose(arrays(points)[2], stated_at(5.0), atol=1e-9)
    assert [each.came_s for each in changes_of(source)] == [None, None]
    assert outcomes_of(source) == ["missed", "not_needed"]
    assert len(source.notes) == 2


def test_a_load_is_taken_up_and_put_down_at_two_signals() -> None:
    source = source_of(
        forward_of(change(), change(1.5, "none", active="low"), loads=(LOADED, ALONE))
    )
    points = follow(source, lambda now_s: AT_S <= now_s < 1.5)
    assert source.stop is None
    lateness = [each.lateness_s for each in changes_of(source)]
    assert lateness == pytest.approx([0.0, 0.0], abs=T)
    held_limits(points)
    last = slice(math.ceil(1.8 / T), -10)
    assert np.abs(arrays(points)[2] - stated_at(5.0))[last].max() < 0.02


def test_a_late_signal_just_before_the_next_change_is_followed() -> None:
    stated = LoadChange(at_s=1.5, payload="none", ramp_s=RAMP_S)
    late = change(missed="unloaded", outside="report")
    source = source_of(forward_of(late, stated, loads=(LOADED, ALONE)))
    points = follow(source, from_time(1.4))
    assert source.stop is None
    assert changes_of(source)[0].came_s == pytest.approx(1.4, abs=T)
    held_limits(points)
    last = slice(math.ceil(1.9 / T), -10)
    assert np.abs(arrays(points)[2] - stated_at(5.0))[last].max() < 0.02


def test_a_signal_that_is_noticed_after_the_next_change_has_begun_stops_the_robot() -> None:
    """Set-points are computed some cycles ahead; the ramp is shorter than this time."""
    stated = LoadChange(at_s=1.21, payload="none", ramp_s=RAMP_S)
    short = change().model_copy(update={"ramp_s": 0.01})
    source = source_of(forward_of(short, stated, loads=(LOADED, ALONE)))
    held_limits(follow(source, from_time(1.19)))
    assert source.stop is not None
    assert source.stop.code is StopCode.LOAD_SIGNAL
    assert outcomes_of(source) == ["came", "begun"]


@pytest.mark.parametrize(("at_s", "outcome"), [(1.31, "begun"), (2.0, "not_reached")])
def test_a_stated_change_while_the_robot_stops_is_reported(at_s: float, outcome: str) -> None:
    """The first signal is missed at 1.2 s; the robot then stops on its path."""
    stated = LoadChange(at_s=at_s, payload="none", ramp_s=RAMP_S)
    source = source_of(forward_of(change(), stated, loads=(LOADED, ALONE)))
    points = follow(source, lambda _: False)
    assert 1.31 < points[-1].sample_index * T < 2.0
    assert outcomes_of(source) == ["missed", outcome]


@pytest.mark.parametrize("second_s", [0.05, 0.1, 0.4])
def test_the_load_has_no_step_if_a_change_begins_before_the_previous_one_is_complete(
    second_s: float,
) -> None:
    """The first change begins late, at 1.35 s, and is noticed at 1.37 s."""
    forward = forward_of(change(), change(2.0), loads=(LOADED, ALONE))
    _, bodies, terms = forward.loads
    begin_s, ramp_s, noticed_s = np.array([1.35, 1.4]), np.array([0.2, second_s]), [1.37, -np.inf]
    times = np.stack([begin_s, begin_s + ramp_s, noticed_s, begin_s, begin_s + ramp_s], axis=1)
    model = forward.torque.arrays
    found = []
    for time_s in np.arange(1.3, 1.9, 1e-3):
        set_load(model, (times, bodies, terms), time_s)
        found.append(model[3].copy())
    low, high = np.minimum(bodies[0], bodies[1]), np.maximum(bodies[0], bodies[1])
    steps = np.abs(np.diff(found, axis=0)).max(axis=0)
    assert (steps <= CATCH_UP * 1e-3 / ramp_s.min() * (high - low) + 1e-12).all()
    assert (np.array(found) >= low - 1e-12).all()
    assert (np.array(found) <= high + 1e-12).all()
    np.testing.assert_array_equal(found[0], bodies[0])
    np.testing.assert_array_equal(found[-1], bodies[2])


@pytest.mark.parametrize(("early_s", "refused_s"), [(0.1, AT_S - 0.1), (0.6, AT_S - 0.6)])
def test_limits_hold_for_both_loads_from_the_earliest_signal_on(
    early_s: float, refused_s: float
) -> None:
    """Axis 3 needs at most 66 N m without the load, and more than 80 N m with it."""
    forward = with_torque_limit(75.0, early_s=early_s)
    source = source_of(forward)
    follow(source, lambda _: False)
    assert source.stop is not None
    assert (source.stop.code, source.stop.joint) == (StopCode.POINTS_REFUSED, "axis3")
    assert source._counts[path.REASON_POINT] == pytest.approx(refused_s / T, abs=1)


def test_limits_hold_for_both_loads_everywhere_if_a_signal_may_come_at_any_time() -> None:
    with raises_code(ConfigError, "RID-STREAM-POINTS", "axis3"):
        source_of(with_torque_limit(75.0, outside="report"))


def with_torque_limit(axis3_nm: float, **signal: Any) -> OnlineFeedforward:
    forward = forward_of(change(missed="unloaded", **signal))
    axes = np.array(forward.axes)
    axes[path.TORQUE, 2] = axis3_nm
    return replace(forward, axes=axes)


def test_possible_loads_depend_on_the_reactions_to_a_missed_signal() -> None:
    changes = (change(), change(2.0, missed="unloaded"), change(3.0))
    signals = forward_of(*changes, loads=(LOADED, ALONE, LOADED)).signals
    loads = forward_of(*changes, loads=(LOADED, ALONE, LOADED)).loads
    assert signals is not None
    begun = signals.begin(loads, 0.03)
    times_s = (0.5, 1.0, 1.5, 2.0, 2.7, 3.0, 3.5)
    assert [possible_loads(begun, time_s) for time_s in times_s] == [
        (0, 0), (0, 1), (1, 1), (1, 2), (1, 2), (1, 3), (3, 3)
    ]  # fmt: skip


def test_windows_must_not_overlap_and_not_begin_before_the_motion() -> None:
    with raises_invalid("", "1.15 s"):
        LoadChanges(changes=(change(), change(1.25)))
    with raises_invalid("", "-0.05 s"):
        change(0.05)


@pytest.mark.parametrize(("missed", "possible"), [("stop", 2), ("unloaded", 13)])
def test_more_possible_loads_than_a_cycle_can_check_are_refused(missed: str, possible: int) -> None:
    changes = [change(float(number), missed=missed) for number in range(1, 13)]
    loads = tuple(ALONE if number % 2 else LOADED for number in range(12))
    forward = forward_of(*changes, loads=loads)
    assert forward.signals is not None
    begun = forward.signals.begin(forward.loads, 0.03)
    assert most_possible_loads(begun) == possible
    assert forward.with_signals(forward.signals).signals is forward.signals  # 8 ms
    fast = replace(forward, cycle_time_s=4e-4)
    if missed == "stop":
        assert fast.with_signals(forward.signals).signals is forward.signals
    else:
        with raises_code(ConfigError, "RID-LOAD-SIGNAL-MANY", "13", "11", "0.4 ms"):
            fast.with_signals(forward.signals)
