"""Late torques that no bus explains: delays and filters are found in simulated recordings."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial

import numpy as np
import pytest
from scipy.interpolate import CubicSpline
from scipy.signal import bilinear, butter, filtfilt, lfilter

from acquisition.processing.smoothing import SmoothedSignals, smooth_nonperiodic
from acquisition.processing.torque_channel import TorqueChannel
from acquisition.recording.recording import Recording
from benchmarks.closed_loop import closed_loop
from benchmarks.honest_choice import DURATION_S, FRICTIONS, Case
from benchmarks.honest_choice import recording as logged
from benchmarks.known_arms import ARMS, STEP_S, Driven, drive
from benchmarks.mistakes import recording_of
from benchmarks.mistakes_made import UserFiles
from benchmarks.sound_robots import sound_run, sound_runs
from config.arrays import FloatArray
from config.load import load_cell, load_robot
from config.robot.robot import RobotDescription
from identification.equations.bus_delay import longest_delay_s
from identification.equations.compared_joints import candidate_equations
from identification.equations.deconvolution import smoothed_recording
from identification.model.options import ModelOptions
from identification.wiring.late_torques import LateTorque, find_late_torques
from tests.builders.late_torque import MOTION, late

CELL = load_cell("ir361")
Effect = Callable[[FloatArray], FloatArray]


def first_order(torque_nm: FloatArray, corner_hz: float) -> FloatArray:
    omega = 2.0 * np.pi * corner_hz
    b, a = bilinear([omega], [1.0, omega], 1.0 / STEP_S)
    return np.asarray(lfilter(b, a, torque_nm - torque_nm[0], axis=0) + torque_nm[0])


def zero_phase(torque_nm: FloatArray, corner_hz: float) -> FloatArray:
    omega = 2.0 * np.pi * corner_hz
    b, a = bilinear([omega], [1.0, omega], 1.0 / STEP_S)
    return np.asarray(filtfilt(b, a, torque_nm, axis=0))


def delayed(torque_nm: FloatArray, delay_s: float) -> FloatArray:
    time_s = STEP_S * np.arange(len(torque_nm))
    return np.asarray(CubicSpline(time_s, torque_nm)(np.maximum(time_s - delay_s, 0.0)))


CYCLE_S, BAND_HZ, STANDSTILL_RAD_S = 0.008, 10.0, 0.02
BY_MS = {"axis1": 50.0, "axis2": 80.0, "axis3": -60.0}


@pytest.fixture(scope="module")
def recording() -> Recording:
    assert CELL.plant is not None
    return closed_loop(CELL, CELL.plant, MOTION.plan(CELL.robot, CYCLE_S), 7)


def found_in(
    robot: RobotDescription, signals: SmoothedSignals, channel: TorqueChannel | None = None
) -> tuple[LateTorque, ...]:
    equations = candidate_equations(robot, [signals], ModelOptions(), STANDSTILL_RAD_S)
    assert equations is not None
    limit_s = longest_delay_s(signals.sample_period_s)
    return find_late_torques(robot, equations, limit_s, channel)


def find(recording: Recording, delay_ms: Sequence[float]) -> dict[str, float]:
    signals = smoothed_recording(late(recording, delay_ms), BAND_HZ)
    found = found_in(CELL.robot, signals)
    return {each.joint: 1e3 * each.delay_s for each in found if each.is_long}


def test_long_delays_of_every_joint_are_found(recording: Recording) -> None:
    found = find(recording, list(BY_MS.values()))
    assert list(found) == list(BY_MS)
    assert list(found.values()) == pytest.approx(list(BY_MS.values()), abs=6.0)


def test_one_late_joint_does_not_accuse_the_others(recording: Recording) -> None:
    assert list(find(recording, (0.0, 50.0, 0.0))) == ["axis2"]


@cache
def driven(seed: int) -> Driven:
    """Return rest-to-rest motions of an arm that Pinocchio simulates."""
    return drive("three", "points", seed, FRICTIONS["plain"], DURATION_S)


def find_effect(effect: Effect, seed: int) -> tuple[LateTorque, ...]:
    robot, case = ARMS["three"].description(), Case("three", "plain", "none", 42)
    changed = replace(driven(seed), torque_nm=effect(driven(seed).torque_nm))
    signals = smooth_nonperiodic(logged(case, changed, 0, robot)[0], BAND_HZ)
    return found_in(robot, signals)


@pytest.mark.parametrize("corner_hz", [1.0, 2.0, 3.0])
def test_a_slow_first_order_filter_is_called_a_filter(corner_hz: float) -> None:
    found = find_effect(partial(first_order, corner_hz=corner_hz), 420)
    assert [each.kind for each in found] == ["filter"] * 3
    own_hz = [1.0 / (2.0 * np.pi * each.lag_s) for each in found]
    assert own_hz == pytest.approx([corner_hz] * 3, rel=0.07)


@pytest.mark.parametrize("delay_s", [0.05, 0.12])
def test_a_delay_is_not_called_a_filter(delay_s: float) -> None:
    found = find_effect(partial(delayed, delay_s=delay_s), 420)
    assert [each.kind for each in found] == ["delay"] * 3
    assert [each.delay_s for each in found] == pytest.approx([delay_s] * 3, abs=0.002)


def test_a_zero_phase_filter_is_not_called_a_delay() -> None:
    assert find_effect(partial(zero_phase, corner_hz=5.0), 420) == ()


def test_a_delay_in_addition_to_a_known_filter_is_found() -> None:
    """A filter of second order at 3 Hz delays by 75 ms; a lag of 28 ms explains only a part."""
    robot, case = ARMS["three"].description(), Case("three", "plain", "none", 42)
    b, a = butter(2, 2.0 * 3.0 * STEP_S)
    torque = driven(420).torque_nm
    filtered = lfilter(b, a, torque - torque[0], axis=0) + torque[0]
    run, _ = logged(case, replace(driven(420), torque_nm=filtered), 0, robot)
    signals = smooth_nonperiodic(run, BAND_HZ)
    lag_s = np.full(3, 0.028)
    channel = replace(TorqueChannel.none(3), lag_s=lag_s, lag_sigma_s=0.01 * lag_s)
    found = found_in(robot, signals, channel)
    assert [each.is_filtered for each in found] == [True] * 3
    assert [each.delay_s for each in found] == pytest.approx([0.05] * 3, abs=0.01)


@pytest.mark.parametrize("delay_ms", [(0.0, 0.0, 0.0), (30.0, 16.0, -24.0)])
def test_delays_that_a_bus_and_a_logger_can_cause_are_not_long(
    recording: Recording, delay_ms: tuple[float, ...]
) -> None:
    assert find(recording, delay_ms) == {}


def find_of_invented_arm(joint: int, effect: Effect) -> list[tuple[str, str, bool]]:
    """Return the late torques of a motion of five harmonics, which each joint alone explains."""
    sound = sound_run(load_robot("kr15"), np.random.default_rng([0, 0]))
    torque_nm = sound.torque_nm.copy()
    torque_nm[:, joint] = effect(torque_nm[:, joint])
    run = recording_of(UserFiles.of(replace(sound, torque_nm=torque_nm)))
    signals = smooth_nonperiodic(run, BAND_HZ)
    found = found_in(sound.robot, signals)
    return [(each.joint, each.kind, each.is_long) for each in found]


@pytest.mark.parametrize("joint", [0, 1, 4])
def test_a_torque_that_is_later_than_the_others_is_found(joint: int) -> None:
    name = f"axis{joint + 1}"
    assert find_of_invented_arm(joint, lambda nm: np.roll(nm, 3)) == [(name, "either", False)]
    (found,) = find_of_invented_arm(joint, lambda nm: np.roll(nm, 10))
    assert found[0] == name
    assert found[2]


@pytest.mark.parametrize("joint", [0, 3])
def test_a_torque_that_is_filtered_more_than_the_others_is_found(joint: int) -> None:
    slow = partial(first_order, corner_hz=20.0)  # 2 Hz at the 100 Hz of this recording
    assert find_of_invented_arm(joint, slow) == [(f"axis{joint + 1}", "filter", True)]


def test_nothing_is_found_in_sound_runs_of_invented_arms() -> None:
    for sound in sound_runs(6):
        signals = smooth_nonperiodic(recording_of(UserFiles.of(sound)), BAND_HZ)
        found = found_in(sound.robot, signals)
        assert found == ()
