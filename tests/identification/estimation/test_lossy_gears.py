"""Gear losses show the inertia of a rotor, whose torque the gear does not transmit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pytest

from acquisition.processing.periods import average_periods
from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.recording.recording import Recording
from benchmarks import honest_choice
from benchmarks.honest_choice import BAND_HZ, FRICTIONS, Case, recording
from benchmarks.known_arms import ARMS, drive
from dynamics.model.robot_model import RobotModel
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate, write_estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.fitted_signals import FittedSignals, fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.estimation.transformed import with_rotors_in_links
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions
from identification.validation.estimate_difference import compare_estimates
from identification.validation.further_terms import TermTrial
from identification.validation.robot_terms import with_friction

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

LOSS = 0.09


@pytest.fixture(scope="module")
def fitted() -> Callable[[str], FittedSignals]:
    """Return a function that fits load-dependent friction to two motions of the known arm."""

    def fit(friction: str) -> FittedSignals:
        robot = ARMS["three"].description()
        kinds = ("sines", "points")
        signals = []
        for number, kind in enumerate(kinds):
            driven = drive("three", kind, 20 + number, FRICTIONS[friction], 30.0)
            run, _ = recording(Case("three", friction, "none", 2), driven, number, robot)
            signals.append(smooth_nonperiodic(run, BAND_HZ))
        lossy = with_friction(robot, [("coulomb", "viscous", "load")] * 3)
        return fit_smoothed(lossy, signals)

    return fit


def value(estimate: Estimate, name: str) -> float:
    return float(estimate.values[estimate.base.names.index(name)])


@pytest.mark.parametrize("bits", [17, 19])
def test_friction_and_loss_of_gears_with_heavy_rotors_are_right(
    fitted: Callable[[str], FittedSignals], bits: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Joint 1 turns about the vertical, so that its load changes its sign; joint 2 lifts the arm.

    Their Coulomb friction is 12 and 14 N m, the inertia of their rotors 2.8 and 3.1 kg m^2.
    """
    monkeypatch.setattr(honest_choice, "BITS", bits)
    estimate = fitted("load").estimate()
    assert value(estimate, "Ia1") == pytest.approx(2.8, abs=0.1)
    assert value(estimate, "Ia2") == pytest.approx(3.1, abs=0.2)
    assert value(estimate, "fc_joint1") == pytest.approx(12.0, abs=0.03)
    assert value(estimate, "fc_joint2") == pytest.approx(14.0, abs=0.15)
    assert estimate.model.nonlinear_values[:2] == pytest.approx(LOSS, abs=0.003)


def test_without_a_loss_the_rotors_stay_with_the_links(
    fitted: Callable[[str], FittedSignals],
) -> None:
    assert {"Ia1", "Ia2"}.isdisjoint(fitted("plain").base.names)


def _lossy(arm: KnownArm, losses: Sequence[float]) -> RobotModel:
    robot = with_friction(arm.robot, [(*joint.friction, "load") for joint in arm.robot.joints])
    return RobotModel.from_description(robot).with_nonlinear(losses)


def test_periods_separate_the_rotors_too(
    arm: KnownArm, measure: Callable[..., Recording], tmp_path: Path
) -> None:
    model = _lossy(arm, [LOSS] * 3)
    robot = with_friction(arm.robot, [(*joint.friction, "load") for joint in arm.robot.joints])
    average = average_periods(measure(noise_nm=0.1, model=model))
    estimate = fit_periodic(robot, [average]).estimate()
    assert estimate.options.separate_rotors == (0, 1, 2)
    truth = base_parameters(model, lossy=(0, 1, 2))
    assert len(truth) > len(base_parameters(model))
    assert estimate.base.names == truth.names
    z = (estimate.values - truth.from_standard(arm.standard)) / estimate.sigma
    assert np.abs(z).max() < 4.0
    write_estimate(tmp_path / "model.json", estimate)
    again = read_estimate(tmp_path / "model.json")
    assert again.base.names == truth.names
    assert again.options == estimate.options


def test_stated_rotors_are_used(arm: KnownArm, measure: Callable[..., Recording]) -> None:
    robot = with_friction(arm.robot, [(*joint.friction, "load") for joint in arm.robot.joints])
    average = average_periods(measure(noise_nm=1.0, model=_lossy(arm, [LOSS] * 3)))

    def names(rotors: tuple[int, ...]) -> set[str]:
        options = EstimationOptions(ModelOptions(separate_rotors=rotors))
        fitted = fit_periodic(robot, [average], options)
        assert set(rotors) <= set(fitted.options.separate_rotors or ())
        return set(fitted.base.names)

    assert names((1,)) - names(()) == {"Im2"}


def test_estimates_with_and_without_separate_rotors_can_be_compared(
    arm: KnownArm, measure: Callable[..., Recording]
) -> None:
    robot = with_friction(arm.robot, [(*joint.friction, "load") for joint in arm.robot.joints])
    average = average_periods(measure(noise_nm=0.1, model=_lossy(arm, [LOSS] * 3)))
    separate, merged = (
        fit_periodic(
            robot, [average], EstimationOptions(ModelOptions(separate_rotors=rotors))
        ).estimate()
        for rotors in ((0, 1, 2), ())
    )
    difference = compare_estimates(separate, merged)
    assert difference.only_first == difference.only_second == ()
    assert "Izz1" in difference.names
    own = with_rotors_in_links(separate)
    assert own.base.expressions == merged.base.expressions
    known = base_parameters(arm.model)
    truth = known.from_standard(arm.standard)[known.names.index("Izz1")]
    index = own.base.names.index("Izz1")
    assert own.values[index] == pytest.approx(truth, abs=4.0 * own.sigma[index])


def test_further_terms_are_tried_beside_separate_rotors(
    fitted: Callable[[str], FittedSignals],
) -> None:
    plain = fitted("load")
    assert plain.options.separate_rotors == (0, 1, 2)
    trial = TermTrial.of(plain)
    assert len(trial.own) == len(plain.base)
    before = trial.equations.errors(trial.kept())
    assert np.sqrt(np.nanmean(before)) == pytest.approx(np.mean(plain.fit.residual_nm), rel=0.3)
