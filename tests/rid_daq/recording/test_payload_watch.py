"""Early end of motions in a payload session: friction has settled, or the mass is accurate."""

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
from rid_daq.operations.payload.session_watches import MassWatch, WarmUpWatch, warm_up_findings
from rid_daq.recording.average_so_far import AverageSoFar
from rid_daq.terminal.console import Console
from tests.builders.known_model import known_estimate
from tests.builders.raised_codes import raises_code
from tests.builders.warm_model import by_temperature

JOINTS = ("axis1", "axis2")
NEW = cast(NewPeriods, SimpleNamespace(recording=SimpleNamespace(joint_names=JOINTS), first_row=0))


def decisions(
    watch: WarmUpWatch, monkeypatch: pytest.MonkeyPatch, *pieces: list[list[float]]
) -> list[bool]:
    """Return True for each group of new periods after which the watch ends the warm-up.

    Args:
        pieces: The groups. A period has one friction power per joint [W].
    """
    decisions_so_far = []
    for piece in pieces:
        power = np.array(piece).reshape(-1, len(JOINTS))
        monkeypatch.setattr(session_watches, "period_powers", lambda *_, power=power: power)
        decisions_so_far.append(watch.add_periods(NEW))
    return decisions_so_far


def test_a_warm_up_ends_when_no_joint_changes_any_more(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    watch = WarmUpWatch(1.0)
    falling = [[10.0, 20.0 - k] for k in range(6)]
    even = [[10.0, 15.0]] * 6
    assert decisions(watch, monkeypatch, falling, even[:2], even) == [False, False, True]
    assert watch.settled
    assert watch.periods == 14
    (finding,) = warm_up_findings(watch.fact)
    assert finding.startswith("Warm-up: settled after 14 periods;")


def test_a_warm_up_of_few_periods_is_reported_as_too_short() -> None:
    found = warm_up_findings(WarmUpWatch(1.0).fact)
    assert found == ["Warm-up: too few periods to tell whether friction has settled."]
    assert warm_up_findings(None) == []


def test_a_warm_up_continues_while_one_joint_changes_and_names_it(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    watch = WarmUpWatch(1.0)
    assert decisions(watch, monkeypatch, [[10.0, 20.0 * 0.97**k] for k in range(6)]) == [False]
    assert watch.worst == "axis2"
    assert "friction of axis2 changes by 3" in watch.line()
    assert "(goal: 1 %)" in watch.line()


def test_three_equal_periods_do_not_end_a_warm_up(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    watch = WarmUpWatch(1.0)
    assert decisions(watch, monkeypatch, [[10.0, 10.0]] * 3, []) == [False, False]
    assert watch.sentences() == ["warming up"]
    assert decisions(watch, monkeypatch, [[10.0, 10.0]]) == [True]


def test_increasing_friction_is_not_settled(monkeypatch: pytest.MonkeyPatch) -> None:
    watch = WarmUpWatch(1.0)
    assert decisions(watch, monkeypatch, [[10.0 * 1.03**k, 10.0] for k in range(6)]) == [False]


def test_each_warm_up_period_is_reported_once_for_the_plot(monkeypatch: pytest.MonkeyPatch) -> None:
    reports: list[tuple[object, ...]] = []
    watch = WarmUpWatch(2.0, lambda *what: reports.append(what))
    decisions(watch, monkeypatch, [[1.0, 2.0]], [], [[3.0, 4.0]])
    assert reports == [(JOINTS, [[1.0, 2.0]], 2.0), (JOINTS, [[3.0, 4.0]], 2.0)]


def mass_watch(
    goal_kg: float | None, monkeypatch: pytest.MonkeyPatch, sigma_kg: float
) -> MassWatch:
    """Return a watch that estimates a mass of 9.3 kg with a given standard deviation."""
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
def test_a_mass_is_accurate_if_two_standard_deviations_are_within_the_goal(
    goal_kg: float | None, enough: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    watch = mass_watch(goal_kg, monkeypatch, sigma_kg=0.02)
    assert watch.sentences() == []
    assert watch.add_periods(PERIODS) is enough
    assert watch.line() == "5 periods: 9.300 ± 0.040 kg"


def test_a_failed_estimate_gives_its_reason_and_does_not_end_the_motion(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    watch = mass_watch(1e9, monkeypatch, sigma_kg=0.0)

    def fail(*_: object) -> None:
        raise EstimationError("the motion does not show the mass")

    monkeypatch.setattr(session_watches, "identify_payload", fail)
    assert not watch.add_periods(PERIODS)
    assert watch.sentences() == ["the motion does not show the mass"]


def model_beyond_mean_period(what: str) -> Estimate:
    """Return a model with an effect that a mean period does not contain."""
    if what == "the warming of the joints":
        return by_temperature(load_cell("ir361"), measured=False)
    narrow = replace(TorqueChannel.none(3), width_s=np.full(3, 0.05))
    return replace(known_estimate(load_cell("ir361"), {}), channel=narrow)


@pytest.mark.parametrize("what", ["the warming of the joints", "a low-pass filter of the torques"])
def test_a_mass_is_not_estimated_in_motion_with_a_time_dependent_model(
    what: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    how = PayloadRequest(PayloadOptions("model", robot=model_beyond_mean_period(what)))
    mass_watch(None, monkeypatch, sigma_kg=0.001)
    watch = MassWatch(load_robot("ir361"), None, how, 0.1)
    assert not watch.add_periods(PERIODS)
    assert watch.line() == "mass not estimated during the run"
    (sentence,) = watch.sentences()
    assert sentence.startswith("The mass was not estimated while the robot moved")
    assert what in sentence


@pytest.mark.parametrize("what", ["the warming of the joints", "a low-pass filter of the torques"])
def test_until_mass_with_a_time_dependent_model_is_refused(
    what: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(
        guided_session, "read_torque_model", lambda *_, **__: (model_beyond_mean_period(what), b"")
    )
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
