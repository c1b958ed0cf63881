"""Held-out parts of a recording are predicted by a correct robot file, but not by another's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.processing.smoothing import smooth_nonperiodic
from benchmarks.mistakes import recording_of
from benchmarks.mistakes_made import UserFiles
from benchmarks.sound_robots import SoundRecording, sound_run
from config.load import load_robot
from identification.regression.fit_grade import BAD_SHARE, Grade, grade_fit
from identification.wiring.held_out import held_out_share
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import CondensedEquations

PERIOD = 1000  # rows per period of the motion


def signals_of(sound: SoundRecording, rows: int | None = None) -> WiredSignals:
    stated = UserFiles.of(sound, slice(rows))
    return WiredSignals.of(sound.robot, [smooth_nonperiodic(recording_of(stated), 10.0)])


@pytest.fixture(scope="module", params=["kr15", "ur10e"])
def sound(request: pytest.FixtureRequest) -> SoundRecording:
    return sound_run(load_robot(request.param), np.random.default_rng(11))


@pytest.mark.parametrize("rows", [PERIOD, None])
def test_a_correct_robot_predicts_held_out_parts(sound: SoundRecording, rows: int | None) -> None:
    assert held_out_share(signals_of(sound, rows)).max() < 0.5 * BAD_SHARE


@pytest.mark.parametrize("rows", [PERIOD, None])
def test_the_file_of_another_robot_fails_on_held_out_parts_of_a_periodic_motion(
    sound: SoundRecording, rows: int | None
) -> None:
    other = load_robot({"kr15": "ur10e", "ur10e": "kr15"}[sound.robot.name])
    signals = replace(signals_of(sound, rows), robot=other)
    fitted = CondensedEquations.of(signals).trial(np.eye(6)).residual_share
    left_out = held_out_share(signals)
    assert np.any((fitted < BAD_SHARE) & (left_out > BAD_SHARE))


def test_joints_at_rest_give_no_result() -> None:
    sound = sound_run(load_robot("ir361"), np.random.default_rng(1))
    signals = signals_of(sound, PERIOD)
    still = replace(signals, velocity=0.0 * signals.velocity, moving=signals.moving & False)
    assert held_out_share(still).tolist() == [0.0, 0.0, 0.0]


def test_a_doubtful_fit_is_bad_if_it_fails_on_held_out_parts() -> None:
    residual, torque = np.array([2.8, 2.8, 0.5]), np.full(3, 10.0)
    fits = grade_fit("abc", residual, torque, held_out_share=np.array([0.29, 0.46, 0.46]))
    assert [each.grade for each in fits] == [Grade.DOUBTFUL, Grade.BAD, Grade.GOOD]
    assert "left out of the fit it is 46 %" in fits[1].reason
