"""Choice of torque channel and friction terms: the true terms of simulated arms are chosen, and no
others.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from acquisition.processing.smoothing import SmoothedSignals, smooth_nonperiodic
from acquisition.processing.torque_channel import TorqueChannel
from benchmarks.honest_choice import (
    BAND_HZ,
    DURATION_S,
    FRICTIONS,
    TUNING_SEEDS,
    Case,
    cases,
    recording,
)
from benchmarks.known_arms import ARMS, STEP_S, drive
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.equations.candidate_equations import Reach
from identification.estimation.file import read_estimate, write_estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.validation import common_filter
from identification.validation.model_choice import ModelChoice, choose_model
from tests.builders.presliding_arm import arm, with_presliding
from tests.builders.presliding_arm import motion as remembering_motion
from tests.builders.presliding_arm import recording as remembering_recording

AVERAGE_ROWS = 20  # 80 ms
PLAIN = ("coulomb", "viscous")


def robot() -> RobotDescription:
    return ARMS["three"].description()


@cache
def signals(case: Case) -> tuple[SmoothedSignals, ...]:
    runs = (
        drive("three", "points", 10 * case.seed + k, FRICTIONS[case.friction], DURATION_S)
        for k in range(2)
    )
    return tuple(
        smooth_nonperiodic(recording(case, driven, k, robot())[0], BAND_HZ)
        for k, driven in enumerate(runs)
    )


def friction(choice: ModelChoice) -> list[tuple[str, ...]]:
    return [joint.friction for joint in choice.robot(robot()).joints]


@pytest.mark.slow
def test_load_and_stribeck_friction_are_found_together() -> None:
    choice = choose_model(robot(), signals(Case("three", "both", "none", 1)))
    assert [set(terms) for terms in friction(choice)] == [{*PLAIN, "load", "stribeck"}] * 3
    assert not choice.channel.changes
    assert np.all(choice.error_nm[1] < 0.5 * choice.error_nm[0])
    assert choice.stribeck_rad_s == pytest.approx([0.08] * 3, rel=0.5)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 11])
def test_the_load_without_rotors_needs_no_stribeck_friction(seed: int) -> None:
    choice = choose_model(robot(), signals(Case("three", "load", "none", seed)))
    assert [set(terms) for terms in friction(choice)] == [{*PLAIN, "load"}] * 3


def test_delays_are_found_before_friction_with_an_interval() -> None:
    case = Case("three", "plain", "delay", 1)
    choice = choose_model(robot(), signals(case))
    assert friction(choice) == [PLAIN] * 3
    assert choice.channel.kind == "delay"
    error_s = np.abs(choice.channel.delay_s - case.delays_s())
    np.testing.assert_array_less(error_s, 3.0 * choice.channel.delay_sigma_s + 1e-12)


@pytest.mark.slow
def test_a_filter_is_not_explained_by_friction() -> None:
    choice = choose_model(robot(), signals(Case("three", "plain", "lag5", 1)))
    assert friction(choice) == [PLAIN] * 3
    assert choice.channel.kind == "lag"
    np.testing.assert_allclose(choice.channel.lag_s, 1.0 / (10.0 * np.pi), rtol=0.05)


@cache
def short_recordings(cutoff_hz: float | None = None) -> SmoothedSignals:
    """Return 14 s of a recording; a cut-off low-passes its torques without phase shift."""
    driven = drive("three", "sines", 1, FRICTIONS["plain"], 14.0)
    if cutoff_hz is not None:
        sections = butter(2, cutoff_hz, fs=1.0 / STEP_S, output="sos")
        driven = replace(driven, torque_nm=sosfiltfilt(sections, driven.torque_nm, axis=0))
    run, _ = recording(Case("three", "plain", "none", 1), driven, 0, robot())
    return smooth_nonperiodic(run, BAND_HZ)


def test_half_a_minute_is_enough_for_a_filter_common_to_all_joints() -> None:
    plain, found = (choose_model(robot(), [short_recordings(hz)]) for hz in (None, 1.66))
    assert not plain.channel.changes
    assert (found.channel.kind, found.channel.order) == ("zero-phase", 2)
    np.testing.assert_allclose(0.5 / np.pi / found.channel.width_s, 1.66, rtol=0.05)
    assert friction(found) == [PLAIN] * 3


def shear_thinning_recording(share: float, duration_s: float) -> SmoothedSignals:
    """Return a recording in which shear thinning from 0.4 rad/s on replaces viscous friction.

    Args:
        share: Viscous coefficient at low speed, divided by the one of the replaced linear friction.
    """
    driven = drive("three", "sines", 1, FRICTIONS["plain"], duration_s)
    v, viscous = driven.velocity, np.array(ARMS["three"].viscous)
    more = viscous * (share * 0.4 * np.arcsinh(v / 0.4) - v)
    driven = replace(driven, torque_nm=driven.torque_nm + more)
    run, _ = recording(Case("three", "plain", "none", 1), driven, 0, robot())
    return smooth_nonperiodic(run, BAND_HZ)


@pytest.mark.parametrize("duration_s", [14.0, DURATION_S])
def test_shear_thinning_replaces_viscous_friction(duration_s: float) -> None:
    choice = choose_model(robot(), [shear_thinning_recording(2.0, duration_s)])
    assert [set(terms) for terms in friction(choice)] == [{"coulomb", "shear_thinning"}] * 3
    assert choice.thinning_rad_s == pytest.approx([0.4] * 3, rel=0.3)
    assert np.all(choice.error_nm[1] < choice.error_nm[0])


@pytest.mark.parametrize("away_s", [1.0, 20.0])
def test_a_filter_is_not_chosen_without_rows_away_from_standstill(
    away_s: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(common_filter, "AWAY", Reach(away_s, away_s))
    assert choose_model(robot(), [short_recordings(1.66)]).channel.order == 1


def moving_average(run: SmoothedSignals) -> SmoothedSignals:
    """Return a recording with the moving average of its torque over 80 ms, as from a PLC."""
    assert run.unfiltered is not None
    torque = run.unfiltered.torque_nm
    before = np.repeat(torque[:1], AVERAGE_ROWS, axis=0)
    total = np.cumsum(np.vstack([before, torque]), axis=0)
    mean = (total[AVERAGE_ROWS:] - total[:-AVERAGE_ROWS]) / AVERAGE_ROWS
    return replace(run, unfiltered=replace(run.unfiltered, torque_nm=mean))


@pytest.mark.slow
def test_a_moving_average_is_not_explained_by_friction() -> None:
    case = Case("three", "plain", "none", 1)
    choice = choose_model(robot(), [moving_average(run) for run in signals(case)])
    assert friction(choice) == [PLAIN] * 3
    assert choice.channel.filters


def test_no_channel_is_fitted_without_a_known_clock() -> None:
    choice = choose_model(robot(), signals(Case("three", "plain", "delay", 1)), kinds=("none",))
    assert not choice.channel.changes


def test_a_recording_too_short_for_a_choice_is_refused() -> None:
    run = signals(Case("three", "plain", "none", 1))[0]
    assert run.unfiltered is not None
    rows = slice(0, 300)
    short = replace(
        run.unfiltered,
        **{
            name: getattr(run.unfiltered, name)[rows]
            for name in ("time_s", "position", "velocity", "acceleration", "torque_nm", "segment")
        },
    )
    with pytest.raises(EstimationError):
        choose_model(robot(), [replace(run, unfiltered=short)])


def test_tuning_uses_seeds_of_its_own() -> None:
    quick = list(cases(TUNING_SEEDS, quick=True))
    assert len({case.seed for case in quick}) == 1
    assert len(list(cases(TUNING_SEEDS, quick=False))) == 84


def test_an_estimate_file_contains_its_channel(tmp_path: Path) -> None:
    way = remembering_motion(30.0, 1)
    estimate = fit_smoothed(
        with_presliding((1,), 0.01), [remembering_recording({}, way)]
    ).estimate()
    a, b, c, d, e, f = values = [np.full(3, 1e-3 * k) for k in range(1, 7)]
    channel = TorqueChannel(a, b, c, d, e, f, order=2)
    write_estimate(tmp_path / "model.json", replace(estimate, channel=channel))
    found = read_estimate(tmp_path / "model.json").channel
    assert found is not None
    np.testing.assert_array_equal(found.lag_s, values[2])
    np.testing.assert_array_equal(found.width_sigma_s, values[5])
    assert found.order == 2
    assert arm().joint_names == estimate.robot.joint_names
