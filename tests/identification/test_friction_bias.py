"""Friction is estimated without bias from aperiodic recordings, simulated by Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.friction_bias import (
    BIAS_PERCENT,
    BITS,
    NARROW_HZ,
    QUICK,
    WHITE,
    Exact,
    add_noise,
    at_rate,
    bias_percent,
    failures,
    identify_recording,
    identify_rounded,
    round_positions,
    run,
)
from benchmarks.simulated_arm import MOTIONS, Kind, SimulatedArm, simulate
from identification.accuracy.identifiability import noiseless_findings
from identification.choices import BAND_HZ


@pytest.fixture(scope="module", params=MOTIONS)
def exact(request: pytest.FixtureRequest) -> Exact:
    kind: Kind = request.param
    arm = SimulatedArm.of("three")
    return Exact(arm, kind, 1, simulate(arm, kind, 1, 20.0))


@pytest.mark.parametrize("rate_hz", [500, 100])
@pytest.mark.parametrize("band_hz", [BAND_HZ, NARROW_HZ])
def test_friction_has_no_bias(exact: Exact, rate_hz: int, band_hz: float) -> None:
    assert bias_percent(exact, rate_hz, band_hz) <= BIAS_PERCENT[rate_hz]


@pytest.fixture(scope="module")
def coupled() -> Exact:
    """Return a noise-free recording of six joints that reverse at unrelated times.

    The links are strongly coupled by inertia.
    """
    arm = SimulatedArm.of("six")
    return Exact(arm, "quick reversals", 4, simulate(arm, "quick reversals", 4, 40.0))


@pytest.mark.parametrize("rate_hz", [200, 100])
@pytest.mark.parametrize("band_hz", [BAND_HZ, NARROW_HZ])
def test_reversals_of_other_joints_cause_no_bias(
    coupled: Exact, rate_hz: int, band_hz: float
) -> None:
    assert bias_percent(coupled, rate_hz, band_hz) <= BIAS_PERCENT[rate_hz]


def test_torques_without_noise_give_a_warning(exact: Exact) -> None:
    alone = add_noise(exact.recording, "encoder alone", np.random.default_rng(0))
    noisy = add_noise(exact.recording, "white", np.random.default_rng(0))
    assert noiseless_findings(identify_recording(exact, alone))
    assert not noiseless_findings(identify_recording(exact, noisy))


def test_intervals_contain_the_effect_of_rounded_positions(exact: Exact) -> None:
    step_deg = 0.1
    whole = at_rate(exact.recording, 100)
    rough = round_positions(whole, step_deg, WHITE, np.random.default_rng(1))
    plain = identify_recording(exact, rough)
    careful, rounded = identify_rounded(exact, rough, step_deg)
    truth = exact.arm.truth(plain.base)
    inside, inside_before = (
        np.mean(np.abs(each.values - truth) <= 2.0 * each.sigma) for each in (careful, plain)
    )
    assert inside_before < 0.9
    assert inside >= 0.93
    assert rounded is not None
    assert rounded.is_material
    assert rounded.band_hz < BAND_HZ
    assert np.median(careful.sigma / plain.sigma) < 1.0


def test_fine_positions_change_nothing(exact: Exact) -> None:
    alone = add_noise(at_rate(exact.recording, 100), "white", np.random.default_rng(0))
    found, rounded = identify_rounded(exact, alone, 360.0 / 2**BITS)
    assert rounded is None
    np.testing.assert_array_equal(found.sigma, identify_recording(exact, alone).sigma)


@pytest.mark.slow
def test_intervals_cover_the_truth() -> None:
    assert failures(QUICK, *run(QUICK)) == []
