"""Analogue part of the simulated amplifier: charge, drift, filter, noise and range."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numba import typeof
from scipy import signal

from config.simulation.plant import SimulatedPlate
from mock_hw.amplifier import analog
from mock_hw.amplifier.analog import AmplifierRows, AmplifierSettings, ChargeAmplifier

Array = np.ndarray[Any, np.dtype[Any]]
PC_N = (-7.5,) * 4 + (-3.8,) * 4
SETTINGS = AmplifierSettings(
    range_n=(2500.0,) * 4 + (10000.0,) * 4,
    sensitivity_pc_n=PC_N,
    low_pass_hz=100.0,
    rate_hz=1000.0,
)
NEWTONS = np.array(SETTINGS.range_n) / 2**15
ZERO = np.zeros(8)


def amplifier_in_operate(
    seed: int = 0, settings: AmplifierSettings = SETTINGS, **truth: object
) -> ChargeAmplifier:
    plate = SimulatedPlate.model_validate({"sensitivity_pc_n": PC_N} | truth)
    amplifier = ChargeAmplifier(plate, seed)
    amplifier.apply(settings)
    return amplifier


def charges_pc(forces: float) -> tuple[float, ...]:
    return tuple(charge(forces).tolist())


def charge(forces: object) -> Array:
    return np.broadcast_to(np.asarray(forces), (8,)) * PC_N


def hold_forces(amplifier: ChargeAmplifier, forces: object, duration_s: float) -> AmplifierRows:
    now_s = amplifier.time_s
    return amplifier.convert(now_s + duration_s, [now_s + 1e-9], [charge(forces)])


def test_a_steady_force_since_operate_is_read_in_counts() -> None:
    amplifier = amplifier_in_operate()
    amplifier.operate(charge(900.0))
    forces = 900.0 + 100.0 * np.arange(8)
    amplifier.start()
    rows = hold_forces(amplifier, forces, 0.2)
    assert len(rows.counts) == 200
    np.testing.assert_allclose(rows.counts[-1] * NEWTONS, 100.0 * np.arange(8), atol=0.2)
    assert rows.counts.dtype == np.int16
    assert not rows.overload.any()


def test_the_filter_is_compiled_before_an_answer_can_be_awaited(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    compiled: Any = analog._run_filter
    types: list[tuple[object, ...]] = []

    def watched(*arguments: object) -> int:
        types.append(tuple(typeof(each) for each in arguments))
        return int(compiled(*arguments))

    monkeypatch.setattr(analog, "_run_filter", watched)
    amplifier = amplifier_in_operate()
    assert len(types) == 1
    amplifier.operate(ZERO)
    amplifier.start()
    hold_forces(amplifier, 100.0, 0.2)
    assert types[1:] == types[:1]


def test_in_reset_the_amplifier_reads_zero_for_any_force() -> None:
    amplifier = amplifier_in_operate()
    amplifier.start()
    assert not hold_forces(amplifier, 5000.0, 0.1).counts.any()
    amplifier.operate(charge(5000.0))
    assert hold_forces(amplifier, 4000.0, 0.1).counts[-1].all()
    amplifier.reset()
    assert not hold_forces(amplifier, 4000.0, 0.2).counts[-1].any()
    assert not amplifier.overload


def test_operate_causes_a_jump_and_then_linear_drift() -> None:
    amplifier = amplifier_in_operate(zero_jump_pc=charges_pc(20.0), drift_pc_s=charges_pc(0.5))
    hold_forces(amplifier, 0.0, 3.0)
    amplifier.operate(ZERO)
    amplifier.start()
    rows = hold_forces(amplifier, 0.0, 100.0)
    newtons = rows.counts * NEWTONS
    np.testing.assert_allclose(newtons[200], 20.1, atol=0.4)
    since_s = rows.time_s - 3.0
    slope = np.polyfit(since_s[200:], newtons[200:], 1)[0]
    np.testing.assert_allclose(slope, 0.5, atol=0.002)
    amplifier.reset()
    hold_forces(amplifier, 0.0, 1.0)
    amplifier.operate(ZERO)
    np.testing.assert_allclose(
        hold_forces(amplifier, 0.0, 0.2).counts[-1] * NEWTONS, 20.1, atol=0.4
    )


def test_a_channel_saturates_at_full_scale_and_its_flag_stays_until_read() -> None:
    amplifier = amplifier_in_operate()
    amplifier.operate(ZERO)
    amplifier.start()
    forces = np.zeros(8)
    forces[2], forces[5] = 2600.0, -10001.0
    rows = hold_forces(amplifier, forces, 0.2)
    assert rows.counts[-1, 2] == 2**15 - 1
    assert rows.counts[-1, 5] == -(2**15)
    assert amplifier.overload == 0b100100
    rows = hold_forces(amplifier, 0.0, 0.2)
    assert (rows.overload == 0b100100).all(), "latched after the end of the force"
    assert amplifier.take_overload() == 0b100100
    assert not hold_forces(amplifier, 0.0, 0.1).overload.any()


def test_the_low_pass_is_the_stated_butterworth_filter() -> None:
    amplifier = amplifier_in_operate()
    amplifier.operate(ZERO)
    amplifier.start()
    step_s = 1e-4
    ends = step_s * np.arange(1, 20001)
    for frequency in (20.0, 100.0, 200.0):
        now_s = amplifier.time_s
        middles = ends - 0.5 * step_s
        force = 1000.0 * np.sin(2 * np.pi * frequency * middles)
        rows = amplifier.convert(now_s + 2.0, now_s + ends, force[:, None] * np.array(PC_N))
        newtons = rows.counts[-1000:, 0] * NEWTONS[0]
        phase = 2 * np.pi * frequency * (rows.time_s[-1000:] - now_s)
        response = 2 * np.mean(newtons * np.exp(-1j * phase)) * 1j / 1000.0
        b, a = signal.butter(2, 2 * np.pi * 100.0, analog=True)
        (expected,) = signal.freqs(b, a, [2 * np.pi * frequency])[1]
        assert response == pytest.approx(expected, abs=2e-3)


def test_noise_is_white_of_the_stated_size_and_reproducible() -> None:
    runs = []
    for seed in (1, 1, 2):
        amplifier = amplifier_in_operate(seed, noise_v=0.01)
        amplifier.start()
        runs.append(amplifier.convert(5.0).counts)
    assert (runs[0] == runs[1]).all()
    assert (runs[0] != runs[2]).any()
    np.testing.assert_allclose(runs[0].std(axis=0) * 10.0 / 2**15, 0.01, rtol=0.05)
    correlation = np.mean(runs[0][1:, 0] * 1.0 * runs[0][:-1, 0]) / np.var(runs[0][:, 0])
    assert abs(correlation) < 0.06


def test_the_amplifier_has_its_own_clock() -> None:
    amplifier = amplifier_in_operate(clock_ppm=100.0, clock_offset_s=0.003)
    amplifier.start()
    rows = [amplifier.convert(end_s) for end_s in np.arange(1, 1001) * 0.017]
    device_s = np.concatenate([row.device_s for row in rows])
    time_s = np.concatenate([row.time_s for row in rows])
    assert len(device_s) == 17002 - 1  # 0.003 s + 17 s * 1.0001, from tick 4 on
    np.testing.assert_allclose(np.diff(device_s), 1e-3, atol=1e-12)
    np.testing.assert_allclose(device_s, 0.003 + 1.0001 * time_s, atol=1e-12)
    assert amplifier.device_s(10.0) == pytest.approx(10.004)


def test_fewer_bits_make_coarser_counts() -> None:
    settings = AmplifierSettings(SETTINGS.range_n, PC_N, 100.0, 2, 1000.0, bits=12)
    amplifier = amplifier_in_operate(settings=settings)
    amplifier.operate(ZERO)
    hold_forces(amplifier, 1000.0, 0.5)
    assert amplifier.present_counts()[0] == round(1000.0 / 2500.0 * 2048)
    assert amplifier.present_counts()[7] == round(1000.0 / 10000.0 * 2048)


def test_another_range_rescales_the_present_charge() -> None:
    amplifier = amplifier_in_operate()
    amplifier.operate(ZERO)
    hold_forces(amplifier, 500.0, 0.5)
    before = amplifier.present_counts()
    amplifier.apply(
        AmplifierSettings(tuple(0.5 * np.array(SETTINGS.range_n)), PC_N, 50.0, 2, 1000.0)
    )
    np.testing.assert_allclose(amplifier.present_counts(), 2 * before, atol=2)
    np.testing.assert_allclose(hold_forces(amplifier, 500.0, 0.1).counts, np.zeros((0, 8)))
    np.testing.assert_allclose(amplifier.present_counts(), 2 * before, atol=2)


def test_time_never_runs_backwards() -> None:
    amplifier = amplifier_in_operate()
    amplifier.convert(1.0)
    with pytest.raises(ValueError, match="before"):
        amplifier.convert(0.5)


@pytest.mark.parametrize(
    "wrong",
    [
        {"range_n": (1.0,) * 7},
        {"range_n": (0.0,) * 8},
        {"sensitivity_pc_n": (0.0,) * 8},
        {"low_pass_hz": 0.0},
        {"rate_hz": -1.0},
        {"bits": 24},
    ],
)
def test_impossible_settings_are_refused(wrong: dict[str, Any]) -> None:
    with pytest.raises(ValueError, match="must"):
        AmplifierSettings(**wrong)
