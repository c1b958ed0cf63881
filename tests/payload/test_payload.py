"""Payload identification: simulated with Pinocchio.

Each procedure recovers the payload within its intervals.
"""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.processing.periods import PeriodAverage, average_periods
from config.errors import ConfigError, EstimationError
from config.robot.robot import RobotDescription
from identification.choices import REPORTED, PayloadLimits
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from identification.payload.body import PARAMETERS, PayloadBody
from identification.payload.equations import Procedure
from identification.payload.estimate import PayloadEstimate
from identification.payload.file import read_payload, write_payload
from identification.payload.known import KnownPayloadValue
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import PayloadOptions, identify_payload, mass_left_on_flange
from identification.payload.verdict import NO_BODY, PayloadResult, check_payload
from tests.builders.raised_codes import raises_code

OPTIONS = ModelOptions(rotors=False)


@pytest.fixture(scope="module")
def alone(robot: RobotDescription, unloaded: PeriodAverage) -> Estimate:
    return fit_periodic(robot, [unloaded], EstimationOptions(model=OPTIONS)).estimate()


def runs(*averages: tuple[PeriodAverage, bool]) -> PeriodicRuns:
    return PeriodicRuns(
        tuple(average for average, _ in averages), tuple(flag for _, flag in averages), 10.0, 0.02
    )


def sigmas_off(estimate: PayloadEstimate, truth: PayloadBody) -> np.ndarray:
    """Return the errors in standard deviations; zero for fixed values."""
    off = estimate.reported - truth.reported
    return np.divide(off, estimate.sigma, out=np.zeros_like(off), where=estimate.sigma > 0.0)


@pytest.mark.parametrize("procedure", ["together", "difference", "model", "apart"])
def test_every_procedure_recovers_the_payload_within_its_intervals(
    lab: SimpleNamespace,
    robot: RobotDescription,
    both: PeriodicRuns,
    loaded: PeriodAverage,
    alone: Estimate,
    procedure: Procedure,
) -> None:
    given = runs((loaded, True)) if procedure == "model" else both
    how = PayloadOptions(procedure, OPTIONS, alone if procedure == "model" else None)
    found = identify_payload(robot, given, how)
    assert found.rank == 10
    assert abs(found.reported[0] - lab.medium.mass_kg) < 0.02
    assert np.max(np.abs(found.reported[1:4] - lab.medium.centre_m)) < 0.001
    assert np.max(np.abs(found.reported[4:] - lab.medium.reported[4:])) < 0.02
    assert np.max(np.abs(sigmas_off(found, lab.medium))) < 3.0
    assert found.is_consistent
    assert found.body.is_consistent


def test_apart_gives_the_payloads_part_of_each_axis_torque(
    lab: SimpleNamespace, robot: RobotDescription, motion: FourierMotion, both: PeriodicRuns
) -> None:
    found = identify_payload(robot, both, PayloadOptions("apart", OPTIONS))
    together = identify_payload(robot, both, PayloadOptions("together", OPTIONS))
    np.testing.assert_allclose(found.payload_nm, together.payload_nm, rtol=0.01)
    with_payload = lab.averaged(robot, motion, lab.medium, seed=3, noise_nm=0.0)
    without = lab.averaged(robot, motion, None, seed=3, noise_nm=0.0)
    made = np.sqrt(np.mean((with_payload.torque_nm - without.torque_nm) ** 2, axis=0))
    # At reversals friction is undetermined, and takes up part of the payload's torque.
    np.testing.assert_allclose(found.payload_nm, made, rtol=0.08)


def test_a_body_in_the_unloaded_run_is_identified_by_a_model(
    lab: SimpleNamespace,
    robot: RobotDescription,
    motion: FourierMotion,
    both: PeriodicRuns,
    alone: Estimate,
) -> None:
    how = PayloadOptions("together", OPTIONS, alone)
    sound = lab.averaged(robot, motion, None, seed=7)
    mass, sigma = mass_left_on_flange(robot, runs((sound, False)), how) or (np.inf, 0.0)
    assert abs(mass) < 4.0 * sigma
    rest = PayloadBody(0.3, np.array([0.0, 0.0, 0.04]), 1e-3 * np.eye(3))
    heavy = lab.averaged(robot, motion, rest, seed=8)
    mass, sigma = mass_left_on_flange(robot, runs((heavy, False)), how) or (0.0, 0.0)
    assert mass == pytest.approx(0.3, abs=0.02)
    assert mass > 4.0 * sigma
    assert mass_left_on_flange(robot, both, PayloadOptions("together", OPTIONS)) is None


def test_a_heavy_load_in_the_unloaded_run_is_named_as_the_likely_mistake(
    lab: SimpleNamespace, robot: RobotDescription, motion: FourierMotion, loaded: PeriodAverage
) -> None:
    other = PayloadBody(5.8, np.array([0.0, 0.0, 0.1]), 0.02 * np.eye(3))
    pair = runs((lab.averaged(robot, motion, other, seed=3), False), (loaded, True))
    found = identify_payload(robot, pair, PayloadOptions("together", OPTIONS))
    failed = [line for line in check_payload(found, PayloadLimits()) if not line.passed]
    assert [line.advice for line in failed] == [NO_BODY]


def test_a_model_of_another_robot_is_refused(
    lab: SimpleNamespace, both: PeriodicRuns, alone: Estimate
) -> None:
    other = lab.six_axes(gravity_m_s2=(0.0, 9.81, 0.0))
    with raises_code(EstimationError, "RID-ROBOT-OTHER", "gravity_m_s2"):
        identify_payload(other, both, PayloadOptions("model", OPTIONS, alone))


def test_friction_may_differ_between_the_runs(
    lab: SimpleNamespace, robot: RobotDescription, motion: FourierMotion, loaded: PeriodAverage
) -> None:
    warm = lab.averaged(robot, motion, None, seed=1, friction=0.6)
    found = identify_payload(
        robot, runs((warm, False), (loaded, True)), PayloadOptions("difference", OPTIONS)
    )
    # In the wrist's axes, 40 % of the friction is more than the torque due to the payload.
    assert 0.4 * lab.coulomb_nm[3] > 3.0
    assert np.max(np.abs(sigmas_off(found, lab.medium))) < 3.0


def test_a_known_mass_is_fixed_and_improves_the_other_values(
    robot: RobotDescription, both: PeriodicRuns
) -> None:
    free = identify_payload(robot, both, PayloadOptions("together", OPTIONS))
    exact = PayloadOptions("together", OPTIONS, known=(KnownPayloadValue("m", 9.579, 0.0),))
    held = identify_payload(robot, both, exact)
    assert held.reported[0] == 9.579
    assert held.sigma[0] == 0.0
    assert held.body.mass_kg == 9.579
    assert held.contradictions is not None
    assert held.contradictions[0] < 2.0
    assert np.all(held.sigma[1:4] <= 1.1 * free.sigma[1:4])
    by_scales = PayloadOptions("together", OPTIONS, known=(KnownPayloadValue("m", 9.6, 0.002),))
    weighed = identify_payload(robot, both, by_scales)
    # The result is between the free estimate and the weighed mass.
    assert free.reported[0] < weighed.reported[0] < 9.6
    assert weighed.sigma[0] < min(0.002, free.sigma[0])


def test_a_known_centre_and_inertia_about_it_are_fixed(
    lab: SimpleNamespace, robot: RobotDescription, both: PeriodicRuns
) -> None:
    known = (KnownPayloadValue("cz", -0.202, 0.0), KnownPayloadValue("Ixx", 0.612, 0.0))
    found = identify_payload(robot, both, PayloadOptions("together", OPTIONS, known=known))
    assert found.reported[3] == pytest.approx(-0.202, abs=1e-15)
    assert found.reported[4] == pytest.approx(0.612, abs=1e-14)
    assert tuple(found.sigma[3:5]) == (0.0, 0.0)
    assert np.max(np.abs(sigmas_off(found, lab.medium)[[0, 1, 2, 5, 6, 7, 8, 9]])) < 3.0


def test_an_impossible_fixed_centre_is_refused(robot: RobotDescription, both: PeriodicRuns) -> None:
    how = PayloadOptions("together", OPTIONS, known=(KnownPayloadValue("cx", 5.0, 0.0),))
    with raises_code(EstimationError, "RID-PAYLOAD-CONTRADICTION"):
        identify_payload(robot, both, how)


@pytest.mark.parametrize("mass_kg", [957.9, 4.8])
def test_a_fixed_value_that_contradicts_the_recordings_fails_the_verdict(
    robot: RobotDescription, both: PeriodicRuns, mass_kg: float
) -> None:
    how = PayloadOptions("together", OPTIONS, known=(KnownPayloadValue("m", mass_kg, 0.0),))
    held = identify_payload(robot, both, how)
    assert held.reported[0] == mass_kg
    failed = [line for line in check_payload(held, PayloadLimits()) if not line.passed]
    assert failed[0].text.endswith("kg: distance from the recordings' result")
    assert failed[0].value > 20.0


def test_a_weighed_value_that_contradicts_the_recordings_fails_the_verdict(
    robot: RobotDescription, both: PeriodicRuns
) -> None:
    how = PayloadOptions("together", OPTIONS, known=(KnownPayloadValue("m", 12.0, 0.01),))
    weighed = identify_payload(robot, both, how)
    assert not PayloadResult(weighed, check_payload(weighed, PayloadLimits())).passed
    agreeing = PayloadOptions("together", OPTIONS, known=(KnownPayloadValue("m", 9.579, 0.01),))
    agreed = identify_payload(robot, both, agreeing)
    assert PayloadResult(agreed, check_payload(agreed, PayloadLimits())).passed


@pytest.mark.parametrize(
    ("wiring", "axes"),
    [
        ((0, 2, 1, 3, 4, 5), {"joint2", "joint3"}),
        ((0, 1, 2, 3, 5, 4), {"joint5", "joint6"}),
        ((0, 1, 2, 5, 4, 3), {"joint4", "joint6"}),
        ((0, 1, -2, 3, 4, 5), {"joint3"}),
        ((0, 1, 2, 3, 4, -5), {"joint6"}),
    ],
)
def test_swapped_or_reversed_axes_fail_the_verdict_by_their_residuals(
    lab: SimpleNamespace,
    robot: RobotDescription,
    motion: FourierMotion,
    wiring: tuple[int, ...],
    axes: set[str],
) -> None:
    def wired(payload: PayloadBody | None, seed: int) -> PeriodAverage:
        recording = lab.measured(robot, motion, payload, seed=seed, periods=2)
        torque = recording.torque_nm[:, np.abs(wiring)] * np.where(np.array(wiring) < 0, -1.0, 1.0)
        return average_periods(replace(recording, torque_nm=torque))

    pair = runs((wired(None, 1), False), (wired(lab.medium, 2), True))
    for procedure in ("together", "apart"):
        found = identify_payload(robot, pair, PayloadOptions(procedure, OPTIONS))
        failed = {line.text for line in check_payload(found, PayloadLimits()) if not line.passed}
        bad = {name for name in robot.joint_names if any(name in text for text in failed)}
        assert bad & axes


def test_every_axis_of_a_correct_pair_is_within_its_residual_limit(
    robot: RobotDescription, both: PeriodicRuns
) -> None:
    for procedure in ("together", "apart", "difference"):
        found = identify_payload(robot, both, PayloadOptions(procedure, OPTIONS))
        assert found.residual_share is not None
        assert np.max(found.residual_share) < 0.1


def test_residuals_of_a_correct_model_equal_the_measured_noise(
    robot: RobotDescription, both: PeriodicRuns, alone: Estimate
) -> None:
    for procedure in ("together", "apart", "difference", "model"):
        known = alone if procedure == "model" else None
        found = identify_payload(robot, both, PayloadOptions(procedure, OPTIONS, known))
        over = [each.over_noise for each in found.fit]
        assert over == [pytest.approx(1.0, abs=0.6)] * len(over), (procedure, over)


def test_a_payload_file_contains_the_noise_and_is_refused_without_it(
    robot: RobotDescription, both: PeriodicRuns, tmp_path: Path
) -> None:
    found = identify_payload(robot, both, PayloadOptions("together", OPTIONS))
    write_payload(
        tmp_path / "new.json", PayloadResult(found, check_payload(found, PayloadLimits()))
    )
    document = json.loads((tmp_path / "new.json").read_text(encoding="utf-8"))
    kept = read_payload(tmp_path / "new.json").estimate
    assert found.noise_nm is not None
    assert kept.noise_nm is not None
    assert kept.noise_nm.tolist() == found.noise_nm.tolist() == document.pop("noise_nm")
    (tmp_path / "without.json").write_text(json.dumps(document), encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        read_payload(tmp_path / "without.json")
    assert "noise_nm" in str(caught.value)


def test_a_contradictory_payload_file_is_refused(
    robot: RobotDescription, both: PeriodicRuns
) -> None:
    twice = PayloadOptions(
        "together",
        OPTIONS,
        known=(KnownPayloadValue("m", 1.0, 0.0), KnownPayloadValue("m", 2.0, 0.0)),
    )
    with raises_code(EstimationError, "RID-OPTION-EXCLUSIVE", "m is"):
        identify_payload(robot, both, twice)
    with raises_code(EstimationError, "RID-OPTION-NAME", "mass"):
        KnownPayloadValue("mass", 1.0, 0.1)
    with raises_code(EstimationError, "RID-OPTION-RANGE", "m"):
        KnownPayloadValue("m", -1.0, 0.1)
    with raises_code(ConfigError, "RID-OPTION-RANGE", "sigma: -0.1"):
        KnownPayloadValue("m", 1.0, -0.1)


def test_parameters_not_identifiable_with_axes_at_rest_are_named(
    lab: SimpleNamespace,
    robot: RobotDescription,
) -> None:
    # Only axis 1 moves. It is vertical: the payload turns about one line, and gravity does no work.
    still = lab.motion_of(robot, axes=(0,))
    pair = runs(
        (lab.averaged(robot, still, None, seed=1), False),
        (lab.averaged(robot, still, lab.medium, seed=2), True),
    )
    found = identify_payload(robot, pair, PayloadOptions("difference", OPTIONS))
    assert found.rank < 10
    assert not all(found.is_determined)
    assert np.all(np.isnan(found.reported[~np.array(found.is_determined)]))
    assert np.all(np.isinf(found.sigma[~np.array(found.is_determined)]))
    with raises_code(EstimationError, "RID-MOTION-UNINFORMATIVE"):
        _ = found.body


def test_the_last_four_axes_identify_all_ten_parameters(
    lab: SimpleNamespace, robot: RobotDescription
) -> None:
    # As in the thesis, axes 3 to 6 move, and axes 1 and 2 are at rest.
    wrist = lab.motion_of(robot, axes=(2, 3, 4, 5))
    pair = runs(
        (lab.averaged(robot, wrist, None, seed=1), False),
        (lab.averaged(robot, wrist, lab.medium, seed=2), True),
    )
    found = identify_payload(robot, pair, PayloadOptions("difference", OPTIONS))
    assert found.rank == 10
    assert np.max(np.abs(sigmas_off(found, lab.medium))) < 3.0


def test_a_wrong_torque_constant_has_the_effect_that_gain_effects_predicts(
    lab: SimpleNamespace, robot: RobotDescription, motion: FourierMotion, both: PeriodicRuns
) -> None:
    how = PayloadOptions("difference", OPTIONS)
    right = identify_payload(robot, both, how)
    gain = np.ones(6)
    gain[2] = 1.02
    wrong = identify_payload(
        robot,
        runs(
            (lab.averaged(robot, motion, None, seed=1, friction=1.1, gain=gain), False),
            (lab.averaged(robot, motion, lab.medium, seed=2, gain=gain), True),
        ),
        how,
    )
    change = wrong.values - right.values
    assert np.allclose(change, 0.02 * right.gain_slopes[:, 2], atol=0.1 * np.abs(change).max())
    # If all torque constants have the same relative error, the mass has this relative error too.
    assert right.gain_effects[0].sum() == pytest.approx(right.reported[0], rel=0.02)
    wide = identify_payload(
        robot, both, PayloadOptions("difference", OPTIONS, torque_constant_sigma=0.02)
    )
    assert wide.sigma[0] > 2.0 * right.sigma[0]


def test_a_payload_in_the_unloaded_run_is_refused(
    robot: RobotDescription, unloaded: PeriodAverage, loaded: PeriodAverage
) -> None:
    swapped = runs((unloaded, True), (loaded, False))
    with raises_code(EstimationError, "RID-PAYLOAD-RUNS", " kg, "):
        identify_payload(robot, swapped, PayloadOptions("difference", OPTIONS))
    with raises_code(EstimationError, "RID-PAYLOAD-NOT-UNLOADED"):
        identify_payload(robot, runs((loaded, True)), PayloadOptions("together", OPTIONS))
    with raises_code(EstimationError, "RID-PAYLOAD-RUNS", "--loaded"):
        identify_payload(robot, runs((loaded, False)), PayloadOptions("together", OPTIONS))
    with raises_code(EstimationError, "RID-OPTION-NEEDS", "model"):
        identify_payload(robot, runs((loaded, True)), PayloadOptions("model", OPTIONS))


def test_runs_of_different_motions_are_refused(
    lab: SimpleNamespace, robot: RobotDescription, loaded: PeriodAverage
) -> None:
    other = lab.averaged(robot, lab.motion_of(robot, seed=3), None, seed=1)
    pair = runs((other, False), (loaded, True))
    with raises_code(EstimationError, "RID-PAYLOAD-PROCEDURE", "`together`"):
        identify_payload(robot, pair, PayloadOptions("difference", OPTIONS))
    together = identify_payload(robot, pair, PayloadOptions("together", OPTIONS))
    assert np.max(np.abs(sigmas_off(together, lab.medium))) < 3.5


def test_an_impossible_estimate_is_replaced_by_the_closest_possible_body(
    lab: SimpleNamespace, robot: RobotDescription, motion: FourierMotion
) -> None:
    # A thin plate is at the limit of physically possible bodies; large noise exceeds the limit.
    plate = PayloadBody.of_reported(
        np.array([3.0, 0.0, 0.0, 0.1, 0.02, 0.02, 0.0399, 0.0, 0.0, 0.0])
    )
    pair = runs(
        (lab.averaged(robot, motion, None, seed=5, noise_nm=12.0), False),
        (lab.averaged(robot, motion, plate, seed=6, noise_nm=12.0), True),
    )
    found = identify_payload(robot, pair, PayloadOptions("together", OPTIONS))
    raw = PayloadBody.of_parameters(found.values)
    assert not raw.is_consistent
    assert found.body.is_consistent
    assert found.is_consistent
    moved = (found.body.reported - found.reported) / found.sigma
    assert np.max(np.abs(moved)) < 3.0


def test_the_names_are_those_of_the_thesis() -> None:
    assert PARAMETERS == ("m", "sx", "sy", "sz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
    assert REPORTED[:4] == ("m", "cx", "cy", "cz")
