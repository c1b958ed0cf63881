"""Friction terms that the robot has but its file does not: they are suggested from held-out
data.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.recording.recording import Recording
from config.errors import EstimationError
from config.robot.friction_terms import FrictionTerm
from identification.equations.segments import thin_rows
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.validation import further_terms
from identification.validation.further_terms import TermTrial, further_term_findings
from identification.validation.held_out import held_out_errors
from identification.validation.robot_terms import with_friction
from tests.builders.presliding_arm import CLASSICAL, arm, measured, motion

WAY = motion(40.0, 1)


def recording_with_offset(offset_nm: float) -> Recording:
    tau = measured({}, WAY).torque_nm.copy()
    tau[:, 1] += offset_nm
    return replace(measured({}, WAY), torque_nm=tau)


def suggested_terms(
    recording: Recording, terms: tuple[FrictionTerm, ...] = CLASSICAL
) -> tuple[str, ...]:
    robot = with_friction(arm(), [terms] * 3)
    return further_term_findings(robot, [smooth_nonperiodic(recording, 10.0)], EstimationOptions())


def test_nothing_is_suggested_for_a_complete_model() -> None:
    assert suggested_terms(recording_with_offset(0.0)) == ()


def test_a_missing_offset_is_suggested_for_its_joint() -> None:
    (finding,) = suggested_terms(recording_with_offset(15.0))
    assert "axis2: offset" in finding
    assert "axis1" not in finding
    assert suggested_terms(recording_with_offset(15.0), (*CLASSICAL, "offset")) == ()


def test_a_missing_load_friction_is_suggested_only_if_it_brakes() -> None:
    plain = measured({}, WAY)
    for share, expected in ((0.2, True), (-0.2, False)):
        tau = plain.torque_nm.copy()
        tau[:, 1] += share * np.abs(tau[:, 1]) * np.sign(WAY[1][:, 1])
        found = suggested_terms(replace(plain, torque_nm=tau))
        assert any("load" in each for each in found) is expected


def test_condensed_equations_give_the_errors_of_a_fit_with_the_term() -> None:
    robot = with_friction(arm(), [CLASSICAL] * 3)
    signals = [thin_rows(smooth_nonperiodic(recording_with_offset(15.0), 10.0))]
    plain = fit_smoothed(robot, signals)
    trial = TermTrial.of(plain)
    for term in ("offset", "cubic"):
        full = fit_smoothed(with_friction(robot, [(*CLASSICAL, term)] * 3), signals)
        own = [trial.equations.errors(trial.kept(each)) for each in (None, term)]
        np.testing.assert_allclose(own, held_out_errors(plain, full), rtol=1e-9)


def test_a_joint_at_rest_prevents_no_suggestion_for_the_others() -> None:
    q, v, a = (each.copy() for each in WAY)
    q[:, 2], v[:, 2], a[:, 2] = 0.3, 0.0, 0.0
    recording = measured({}, (q, v, a))
    tau = recording.torque_nm.copy()
    tau[:, 1] += 15.0
    (finding,) = suggested_terms(replace(recording, torque_nm=tau))
    assert "axis2: offset" in finding


def test_terms_that_change_the_base_parameters_are_not_tried(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(further_terms, "ASKED", {"cubic": "other"})
    plain = fit_smoothed(
        with_friction(arm(), [CLASSICAL] * 3),
        [thin_rows(smooth_nonperiodic(recording_with_offset(0.0), 10.0))],
    )
    renamed = replace(plain.base, names=tuple(f"other_{name}" for name in plain.base.names))
    with pytest.raises(EstimationError) as caught:
        TermTrial.of(replace(plain, problem=replace(plain.problem, base=renamed)))
    assert caught.value.refusal == "RID-MODEL-TERMS-DIFFER"
