"""Delayed torques of a periodic run: `--choose` finds the delay, and the following commands use
it.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from acquisition.recording.recording import Recording
from acquisition.runs.folder import RunFolder
from benchmarks.closed_loop import closed_loop
from config.load import load_cell
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.file import read_estimate, write_estimate
from identification.validation.torque_prediction import validate_torques
from rid_daq.operations.estimation.run_estimation import (
    EstimationJob,
    compare_friction,
    estimate_runs,
    signals_of,
)
from rid_daq.report.sections.comparison import ComparisonSection
from rid_daq.runs.run_data import RunData

LATE_S = np.array([0.004, 0.002, -0.003])
CYCLE_S = 0.008


@pytest.fixture(scope="module")
def recordings() -> tuple[Recording, ...]:
    """Record two motions of the simulated arm with delayed torques."""
    cell = load_cell("ir361")
    assert cell.plant is not None
    plant, late = cell.plant.without_unmodelled(), []
    for seed in (0, 1):
        options = TwoHarmonicOptions(5.0, highest_harmonic=6, tries=50, periods=8, seed=seed)
        motion = design_two_harmonic(cell.robot, options, CYCLE_S)
        true = closed_loop(cell, plant, motion.plan(cell.robot, CYCLE_S), seed)
        torque = [
            CubicSpline(true.time_s, column)(true.time_s - by)
            for column, by in zip(true.torque_nm.T, LATE_S, strict=True)
        ]
        late.append(replace(true, torque_nm=np.transpose(torque)))
    return tuple(late)


def test_torque_delays_of_a_periodic_run_are_found_reported_and_used(
    recordings: tuple[Recording, ...], tmp_path: Path
) -> None:
    robot, how = load_cell("ir361").robot, EstimationJob()
    data = [RunData.of(RunFolder(tmp_path, "excitation"), recordings[0], robot, None)]
    comparison = compare_friction(data, how)
    assert comparison.channel is not None
    found_s, sigma_s = comparison.channel.delay_s, comparison.channel.delay_sigma_s
    assert np.all(np.abs(found_s - LATE_S) < 2.0 * sigma_s)
    assert np.all(sigma_s < 0.0005)
    assert all(joint.friction == ("coulomb", "viscous") for joint in comparison.robot(robot).joints)
    section = ComparisonSection.of(comparison)
    assert section.channel is not None
    sentences = section.channel.sentences(section.joints)
    assert [s.partition(" is ")[0] for s in sentences] == [
        f"The torque of {name}" for name in robot.joint_names
    ]
    assert all(re.search(r"\d ms (late|early) \(± ", sentence) for sentence in sentences)

    late = estimate_runs(data, how).estimate
    in_time = estimate_runs(data, how, robot=comparison.robot(robot), chosen=comparison)
    assert np.all(in_time.estimate.residual_nm < 0.8 * late.residual_nm)
    drawn = signals_of(data, how, comparison.channel)[0].torque_nm
    assert np.abs(drawn - signals_of(data, how)[0].torque_nm).max() > 1.0

    write_estimate(tmp_path / "model.json", in_time.estimate)
    kept = read_estimate(tmp_path / "model.json")
    judged, without = validate_torques(kept, recordings[1]), validate_torques(late, recordings[1])
    assert np.all(judged.rms_nm < without.rms_nm)
