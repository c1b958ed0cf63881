"""Clipped torques are found by the motion and the other joints, also with noise."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.processing.smoothing import smooth_nonperiodic
from benchmarks.mistakes import recording_of
from benchmarks.mistakes_made import UserFiles
from benchmarks.sound_robots import SoundRecording, sound_run, sound_runs
from config.load import load_robot
from identification.equations.compared_joints import candidate_equations
from identification.model.options import ModelOptions
from identification.wiring.clipped_torques import ClippedTorque, find_clipped_torques

BAND_HZ, STANDSTILL_RAD_S = 10.0, 0.02


def find(sound: SoundRecording) -> tuple[ClippedTorque, ...]:
    signals = [smooth_nonperiodic(recording_of(UserFiles.of(sound)), BAND_HZ)]
    equations = candidate_equations(sound.robot, signals, ModelOptions(), STANDSTILL_RAD_S)
    assert equations is not None
    return find_clipped_torques(sound.robot, equations)


@pytest.mark.parametrize("joint", range(4))
def test_a_torque_that_is_clipped_before_noise_is_added_is_found(joint: int) -> None:
    random = np.random.default_rng(0)
    sound = sound_run(load_robot("kr15"), np.random.default_rng([0, 0]))
    torque_nm = sound.torque_nm.copy()
    own_nm = torque_nm[:, joint]
    limits_nm = np.quantile(own_nm, [0.1, 0.9])
    noise_nm = 0.01 * own_nm.std() * random.standard_normal(len(own_nm))
    torque_nm[:, joint] = np.clip(own_nm, *limits_nm) + noise_nm
    (found,) = find(replace(sound, torque_nm=torque_nm))
    assert found.joint == f"axis{joint + 1}"
    tolerance_nm = 0.02 * float(np.ptp(limits_nm))
    assert sorted(found.limits_nm) == pytest.approx(limits_nm, abs=tolerance_nm)


def test_sound_torques_are_not_clipped() -> None:
    for sound in sound_runs(9):
        assert find(sound) == ()
