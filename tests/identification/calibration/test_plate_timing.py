"""Delay and clock of a force plate follow from the motion, without its description."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
import pytest

from acquisition.recording.recording import Recording
from benchmarks.sound_plates import weighed_arms
from config.errors import DataQualityError
from identification.calibration.plate_timing import PlateTiming, estimate_plate_timing
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

Estimate = Callable[..., PlateTiming]


@pytest.fixture(scope="module")
def weighed(weigh: Callable[..., Recording]) -> Recording:
    """Return 16 periods on a force plate, loaded by Pinocchio and with noise."""
    return weigh(3)


@pytest.fixture(scope="module")
def timing(weighed: Recording, arm: KnownArm) -> Estimate:
    """Return a function that estimates the plate's timing after a change of stamps or readings."""

    def estimate(
        *, offset_s: float = 0.0, rate: float = 0.0, own: bool = False, mixed: bool = False
    ) -> PlateTiming:
        reaction = weighed.reaction
        assert reaction is not None
        stamp_s = (1.0 + rate) * weighed.time_s + offset_s
        readings = reaction.channels_n[:, ::-1] * 3.0 if mixed else reaction.channels_n
        return estimate_plate_timing(
            weighed,
            arm.robot,
            stamp_s,
            readings,
            reaction.valid,
            reaction.low_pass,
            own_clock=own,
        )

    return estimate


def test_a_delay_on_a_shared_clock_is_in_its_interval(timing: Estimate) -> None:
    zero, late = timing(), timing(offset_s=0.0137)
    assert late.lag_s - zero.lag_s == pytest.approx(0.0137, abs=1e-5)
    assert abs(zero.lag_s) < 2.0 * zero.lag_std_s + 2e-3
    assert late.explained_share > 0.9


def test_offset_and_rate_of_an_own_clock_are_found(timing: Estimate) -> None:
    own = timing(offset_s=1234.5, rate=5e-4, own=True)
    assert abs(own.rate - 5e-4) < max(3.0 * own.rate_std, 5e-5)
    at_s = own.to_recording(1234.5 + (1.0 + 5e-4) * np.array([2.0, 10.0]))
    assert at_s == pytest.approx([2.0, 10.0], abs=5e-3)


def test_a_wrong_order_and_scale_of_channels_has_no_effect(timing: Estimate) -> None:
    assert timing(mixed=True).lag_s == pytest.approx(timing().lag_s, abs=1e-5)


def test_readings_of_another_motion_are_refused(weighed: Recording, arm: KnownArm) -> None:
    noise = np.cumsum(np.random.default_rng(3).standard_normal((len(weighed), 8)), axis=0)
    valid = np.ones(noise.shape, dtype=np.bool_)
    plain = replace(weighed, reaction=None)
    with raises_code(DataQualityError, "RID-PLATE-CLOCK"):
        estimate_plate_timing(plain, arm.robot, weighed.time_s, noise, valid, None, own_clock=False)


def test_stamps_of_another_time_on_a_shared_clock_are_refused(timing: Estimate) -> None:
    with raises_code(DataQualityError, "RID-PLATE-CLOCK", "clock: own"):
        timing(offset_s=1e6)


def test_a_short_motion_of_a_six_axis_arm_shows_the_delay() -> None:
    (found,) = (each for each in weighed_arms(1, 2) if len(each.robot.joints) == 6)
    reaction = found.recording.reaction
    assert reaction is not None
    timing = estimate_plate_timing(
        found.recording,
        found.robot,
        found.recording.time_s + 0.1,
        reaction.channels_n,
        reaction.valid,
        None,
        own_clock=False,
    )
    assert timing.lag_s == pytest.approx(0.1, abs=5e-4)


def test_a_motion_that_repeats_without_a_stated_period_does_not_show_the_offset(
    weighed: Recording, arm: KnownArm
) -> None:
    reaction = weighed.reaction
    assert reaction is not None
    plain = replace(weighed, reaction=None, samples_per_period=None)
    with raises_code(DataQualityError, "RID-PLATE-CLOCK", "period_s"):
        estimate_plate_timing(
            plain,
            arm.robot,
            weighed.time_s,
            reaction.channels_n,
            reaction.valid,
            reaction.low_pass,
            own_clock=True,
        )


def test_ten_seconds_show_the_offset_of_an_own_clock() -> None:
    """A search that starts at a wrong delay fails; the right delay is found from another start."""
    (found,) = (each for each in weighed_arms(1, 2) if len(each.robot.joints) == 6)
    whole = replace(found.recording, samples_per_period=None)
    rows = slice(0, int(np.searchsorted(whole.time_s, whole.time_s[0] + 10.0)))
    short, reaction = whole.part(rows), found.recording.reaction
    assert reaction is not None
    timing = estimate_plate_timing(
        short,
        found.robot,
        short.time_s + 100.0,
        reaction.channels_n[rows],
        reaction.valid[rows],
        None,
        own_clock=True,
    )
    assert timing.lag_s == pytest.approx(100.0, abs=5e-4)
