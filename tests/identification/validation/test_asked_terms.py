"""Friction terms that the robot has but its file does not: they are suggested from held-out
data.
"""

from __future__ import annotations

from dataclasses import replace

from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.recording.recording import Recording
from config.robot.friction_terms import FrictionTerm
from identification.estimation.options import EstimationOptions
from identification.validation.further_terms import further_term_findings
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
