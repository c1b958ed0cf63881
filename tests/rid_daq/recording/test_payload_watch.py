"""When a payload session ends a motion early: once friction has settled, once the mass is sure."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from acquisition.processing.periods import PeriodAverage
from acquisition.processing.torque_channel import TorqueChannel
from acquisition.session.early_stop import NewPeriods
from config.errors import ConfigError, EstimationError
from config.load import load_cell, load_robot
from identification.estimation.estimate import Estimate
from identification.payload.procedures import PayloadOptions
from rid_daq.operations.payload import guided_session, session_watches
from rid_daq.operations.payload.guided_session import run_payload_session
from rid_daq.operations.payload.payload_estimate import PayloadRequest
from rid_daq.operations.payload.payload_session import PayloadSessionRequest
from rid_daq.operations.payload.session_watches import MassWatch, WarmUpWatch
from rid_daq.recording.average_so_far import AverageSoFar
from rid_daq.terminal.console import Console
from tests.builders.known_model import known
from tests.builders.raised_codes import raises_code
from tests.builders.warm_model import by_temperature

JOINTS = ("axis1", "axis2")
NEW = cast(NewPeriods, SimpleNamespace(recording=SimpleNamespace(joint_names=JOINTS), first_row=0))


def watched(
    watch: WarmUpWatch, monkeypatch: pytest.MonkeyPatch, *pieces: list[list[float]]
) -> list[bool]:
    """Return what the watch says after each piece of more periods, given by their powers [W]."""
    said = []
    for piece in pieces:
        power = np.array(piece).reshape(-1, len(JOINTS))
        monkeypatch.setattr(session_watches, "period_powers", lambda *_, power=power: power)
        said.append(watch.add_periods(NEW))
    return said


def test_a_cold_robot_is_warmed_until_no_joint_changes_any_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    watch = WarmUpWatch(1.0)
    falling = [[10.0, 20.0 - k] for k in range(6)]
    even = [[10.0, 15.0]] * 6
    assert watched(watch, monkeypatch, falling, even[:2], even) == [False, False, True]
    assert watch.settled
    assert watch.periods == 14


def test_one_joint_that_still_changes_is_enough_to_go_on_and_is_named(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    watch = WarmUpWatch(1.0)
    assert watched(watch, monkeypatch, [[10.0, 20.0 * 0.97**k] for k in range(6)]) == [False]
    assert watch.worst == "axis2"
    assert "friction of axis2 changes by 3" in watch.line()
    assert "(goal: 1 %)" in watch.line()


def test_three_periods_settle_nothing_however_even_they_are(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    watch = WarmUpWatch(1.0)
    assert watched(watch, monkeypatch, [[10.0, 10.0]] * 3, []) == [False, False]
    assert watch.sentences() == ["warming up"]
    assert watched(watch, monkeypatch, [[10.0, 10.0]]) == [True]


def test_friction_that_grows_is_not_settled_either(monkeypatch: pytest.MonkeyPatch) -> None:
    watch = WarmUpWatch(1.0)
    assert watched(watch, monkeypatch, [[10.0 * 1.03**k, 10.0] for k in range(6)]) == [False]


def test_who_draws_the_warm_up_is_told_each_period_once(monkeypatch: pytest.MonkeyPatch) -> None:
    told: list[tuple[object, ...]] = []
    watch = WarmUpWatch(2.0, lambda *what: told.append(what))
    watched(watch, monkeypatch, [[1.0, 2.0]], [], [[3.0, 4.0]])
    assert told == [(JOINTS, [[1.0, 2.0]], 2.0), (JOINTS, [[3.0, 4.0]], 2.0)]


def weighing(goal_kg: float | None, monkeypatch: pytest.MonkeyPatch, sigma_kg: float) -> MassWatch:
    """Return a watch whose estimate is 9.3 kg with a standard deviation."""
    watch = MassWatch(load_robot("ir361"), None, PayloadRequest(), goal_kg)
    average = cast(PeriodAverage, SimpleNamespace())
    monkeypatch.setattr(AverageSoFar, "with_new_periods", lambda _self, _new: average)
    estimate = SimpleNamespace(sigma=np.array([sigma_kg]), reported=np.array([9.3]))
    monkeypatch.setattr(session_watches, "identify_payload", lambda *_: estimate)
    return watch


PERIODS = cast(NewPeriods, SimpleNamespace(periods=5))


@pytest.mark.parametrize(
    ("goal_kg", "enough"), [(0.1, True), (0.04, True), (0.0399, False), (None, False)]
)
def test_a_mass_is_sure_where_two_standard_deviations_are_within_the_goal(
    goal_kg: float | None, enough: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    watch = weighing(goal_kg, monkeypatch, sigma_kg=0.02)
    assert watch.sentences() == []
    assert watch.add_periods(PERIODS) is enough
    assert watch.line() == "5 periods: 9.300 ± 0.040 kg"


def test_an_estimate_that_fails_says_why_and_ends_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    watch = weighing(1e9, monkeypatch, sigma_kg=0.0)

    def fail(*_: object) -> None:
        raise EstimationError("the motion does not show the mass")

    monkeypatch.setattr(session_watches, "identify_payload", fail)
    assert not watch.add_periods(PERIODS)
    assert watch.sentences() == ["the motion does not show the mass"]


def says_of_time(what: str) -> Estimate:
    """Return a model that says what no mean period shows."""
    if what == "the warming of the joints":
        return by_temperature(load_cell("ir361"), measured=False)
    narrow = replace(TorqueChannel.none(3), width_s=np.full(3, 0.05))
    return replace(known(load_cell("ir361"), {}), channel=narrow)


@pytest.mark.parametrize("what", ["the warming of the joints", "a low-pass filter of the torques"])
def test_a_mass_is_not_followed_by_a_model_that_holds_in_time_alone(
    what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    how = PayloadRequest(PayloadOptions("model", robot=says_of_time(what)))
    weighing(None, monkeypatch, sigma_kg=0.001)
    watch = MassWatch(load_robot("ir361"), None, how, 0.1)
    assert not watch.add_periods(PERIODS)
    assert watch.line() == "mass not estimated during the run"
    (sentence,) = watch.sentences()
    assert sentence.startswith("The mass was not estimated while the robot moved")
    assert what in sentence


@pytest.mark.parametrize("what", ["the warming of the joints", "a low-pass filter of the torques"])
def test_until_mass_with_such_a_model_is_refused_before_there_is_a_session(
    what: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(guided_session, "read_estimate_for", lambda *_: says_of_time(what))
    request = PayloadSessionRequest(
        cell="ir361",
        runs=tmp_path / "runs",
        model=Path("warm.json"),
        until_mass_kg=0.012,
        yes=True,
    )
    with raises_code(ConfigError, "RID-OPTION-NO-EFFECT", "0.012", "warm.json", what):
        run_payload_session(request, Console())
    assert not (tmp_path / "runs").exists()
