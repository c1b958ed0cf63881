"""A delay of all torques is named, and no gear ratio or torque factor instead of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.processing.smoothing import SmoothedSignals, smooth_nonperiodic
from acquisition.processing.torque_channel import TorqueChannel
from benchmarks.mistakes import recording_of
from benchmarks.mistakes_made import UserFiles
from benchmarks.sound_robots import SoundRecording, sound_run
from config.load import load_robot
from identification.wiring.mistakes import MistakeKind
from identification.wiring.search import find_mistakes
from identification.wiring.signals import WiredSignals

BAND_HZ = 10.0


@pytest.fixture(scope="module")
def sound() -> SoundRecording:
    return sound_run(load_robot("ir361"), np.random.default_rng(0))


def with_delay(sound: SoundRecording, delay_s: float) -> SmoothedSignals:
    """Return the signals of a recording in which all torques are late."""
    times_s = sound.time_s - delay_s
    late = [np.interp(times_s, sound.time_s, column) for column in sound.torque_nm.T]
    changed = replace(sound, torque_nm=np.column_stack(late))
    return smooth_nonperiodic(recording_of(UserFiles.of(changed)), BAND_HZ)


@pytest.mark.parametrize("delay_s", [-0.05, 0.03, 0.05, 0.1])
def test_late_torques_are_named_and_no_other_mistake(sound: SoundRecording, delay_s: float) -> None:
    (found,) = find_mistakes(WiredSignals.of(sound.robot, [with_delay(sound, delay_s)]))
    assert found.mistake.kind is MistakeKind.TORQUE_TIME
    assert found.mistake.joints == ()
    assert found.mistake.delay_s == pytest.approx(delay_s, abs=1e-9)
    assert found.alternatives == ()


@pytest.mark.parametrize("is_filter", [False, True])
def test_a_known_delay_is_no_mistake(sound: SoundRecording, *, is_filter: bool) -> None:
    delays_s = np.full(3, 0.05)
    channel = TorqueChannel.none(3)
    channel = replace(channel, lag_s=delays_s) if is_filter else replace(channel, delay_s=delays_s)
    signals = replace(with_delay(sound, 0.05), channel=channel)
    assert find_mistakes(WiredSignals.of(sound.robot, [signals])) == ()


def test_a_torque_is_shifted_within_its_segment_only(sound: SoundRecording) -> None:
    signals = with_delay(sound, 0.0)
    rows = np.arange(len(signals))
    torque_nm = np.tile(rows[:, np.newaxis], (1, 3)).astype(np.float64)
    halves = replace(signals, torque_nm=torque_nm, segment=(rows >= len(rows) // 2).astype(int))
    wired = WiredSignals.of(sound.robot, [halves])
    first = wired.torque_nm[:, 0] < len(rows) // 2
    later, earlier = (wired.torque_recorded_later(delay_s, (1,)) for delay_s in (0.05, -0.05))
    assert later[first].max() == len(rows) // 2 - 1
    assert earlier[~first].min() == len(rows) // 2
    moved = later - wired.torque_nm
    assert moved.max() == pytest.approx(0.05 / signals.sample_period_s)
    assert not moved[:, [0, 2]].any()
