"""Friction is estimated without bias from aperiodic recordings, simulated by Pinocchio."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.friction_bias import (
    BIAS_PERCENT,
    NARROW_HZ,
    QUICK,
    Exact,
    add_noise,
    bias_percent,
    failures,
    identify_recording,
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


@pytest.mark.slow
def test_intervals_cover_the_truth() -> None:
    assert failures(QUICK, *run(QUICK)) == []
