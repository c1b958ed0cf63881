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
from benchmarks.honest_choice import BAND_HZ, FRICTIONS, Case, recording
from benchmarks.known_arms import ARMS, drive
from dynamics.model.robot_model import RobotModel
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate, write_estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.fitted_signals import fit_smoothed
from identification.model.base_parameters import base_parameters
from identification.validation.robot_terms import with_friction

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

LOSS = 0.09


@pytest.fixture(scope="module")
def identified() -> Callable[[str], Estimate]:
    """Return an estimate with load-dependent friction, from one of the known arm's motions."""

    def identify(friction: str) -> Estimate:
        robot = ARMS["three"].description()
        kinds = ("sines", "points")
        signals = []
        for number, kind in enumerate(kinds):
            driven = drive("three", kind, 20 + number, FRICTIONS[friction], 30.0)
            run, _ = recording(Case("three", friction, "none", 2), driven, number, robot)
            signals.append(smooth_nonperiodic(run, BAND_HZ))
        lossy = with_friction(robot, [("coulomb", "viscous", "load")] * 3)
        return fit_smoothed(lossy, signals).estimate()

    return identify


def value(estimate: Estimate, name: str) -> float:
    return float(estimate.values[estimate.base.names.index(name)])


def test_friction_and_loss_of_a_gear_with_a_heavy_rotor_are_right(
    identified: Callable[[str], Estimate],
) -> None:
    """Joint 2 carries the arm: 14 N m of Coulomb friction, a rotor of 3.1 kg m^2."""
    estimate = identified("load")
    assert value(estimate, "Ia2") == pytest.approx(3.1, abs=0.2)
    assert value(estimate, "fc_joint2") == pytest.approx(14.0, abs=0.15)
    assert estimate.model.nonlinear_values[1] == pytest.approx(LOSS, abs=0.003)


def test_without_a_loss_the_rotors_stay_with_the_links(
    identified: Callable[[str], Estimate],
) -> None:
    assert {"Ia1", "Ia2"}.isdisjoint(identified("plain").base.names)


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
    truth = base_parameters(model, lossy=(0, 1, 2))
    assert len(truth) > len(base_parameters(model))
    assert estimate.base.names == truth.names
    z = (estimate.values - truth.from_standard(arm.standard)) / estimate.sigma
    assert np.abs(z).max() < 4.0
    write_estimate(tmp_path / "model.json", estimate)
    assert read_estimate(tmp_path / "model.json").base.names == truth.names
