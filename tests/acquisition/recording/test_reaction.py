from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from acquisition.recording.reaction import Reaction
from acquisition.recording.recording import Recording
from config.cell.plate import CHANNEL_NAMES
from config.errors import DataQualityError, RecordingError
from tests.builders.raised_codes import raises_code

CYCLE_S, K, PERIODS = 0.008, 250, 12


def recording(
    *,
    drift_n_s: float = 0.0,
    offset_n: float = 0.0,
    noise_n: float = 0.1,
    valid: NDArray[np.bool_] | None = None,
) -> Recording:
    """Return a recording whose plate channels are sines of 10 N with 1, 2 or 3 turns per period."""
    random = np.random.default_rng(0)
    rows = K * PERIODS
    time_s = np.arange(rows, dtype=np.float64) * CYCLE_S
    angle = 2.0 * np.pi * np.arange(rows) / K
    position = np.sin(angle)[:, None] + 1e-5 * random.standard_normal((rows, 1))
    truth = np.column_stack([10.0 * np.sin((k % 3 + 1) * angle + k) for k in range(8)])
    channels = truth + noise_n * random.standard_normal((rows, 8))
    channels += offset_n * np.arange(1.0, 9.0) + drift_n_s * np.outer(time_s, np.arange(-3.0, 5.0))
    reaction = Reaction(
        channel_names=CHANNEL_NAMES,
        channels_n=channels,
        valid=np.ones((rows, 8), dtype=np.bool_) if valid is None else valid,
        base_wrench_matrix=np.ones((6, 8)),
    )
    return Recording(
        joint_names=("j1",),
        time_s=time_s,
        position=position,
        torque_nm=position,
        valid=np.ones(rows, dtype=np.bool_),
        phase=np.full(rows, Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=CYCLE_S,
        samples_per_period=K,
        reaction=reaction,
    )


def all_valid() -> NDArray[np.bool_]:
    return np.ones((K * PERIODS, 8), dtype=np.bool_)


def vary(values: NDArray[np.float64]) -> NDArray[np.float64]:
    return values - values.mean(axis=0)


def test_the_variance_of_the_mean_period_is_divided_by_the_periods() -> None:
    reaction = average_periods(recording()).reaction
    assert reaction is not None
    angle = 2.0 * np.pi * np.arange(K) / K
    truth = np.column_stack([10.0 * np.sin((k % 3 + 1) * angle + k) for k in range(8)])
    error = reaction.channels_n - truth
    assert error.std() == pytest.approx(0.1 / np.sqrt(PERIODS), rel=0.1)
    power = 2.0 * np.trace(reaction.bin_covariance[1:].sum(axis=0)) / 8.0
    assert np.sqrt(power) == pytest.approx(0.1, rel=0.05)


def test_noise_common_to_channels_appears_in_their_covariance() -> None:
    plain = recording(noise_n=0.0)
    assert plain.reaction is not None
    shared = np.random.default_rng(1).standard_normal((len(plain), 1)) @ np.ones((1, 8))
    noisy = replace(plain.reaction, channels_n=plain.reaction.channels_n + shared)
    reaction = average_periods(replace(plain, reaction=noisy)).reaction
    assert reaction is not None
    total = reaction.bin_covariance.sum(axis=0)
    np.testing.assert_allclose(total / total[0, 0], np.ones((8, 8)), atol=1e-6)


def test_drift_is_estimated_over_whole_periods_and_removed() -> None:
    plain, drifting = (
        average_periods(recording(drift_n_s=d, offset_n=o)).reaction
        for d, o in ((0.0, 0.0), (0.05, 20.0))
    )
    assert plain is not None
    assert drifting is not None
    found = drifting.drift_n_s - plain.drift_n_s
    np.testing.assert_allclose(found, 0.05 * np.arange(-3.0, 5.0), atol=1e-9)
    assert (np.abs(plain.drift_n_s) < 4.0 * plain.drift_sigma_n_s).all()
    np.testing.assert_allclose(vary(drifting.channels_n), vary(plain.channels_n), atol=1e-9)


def test_a_zero_jump_is_not_drift() -> None:
    plain = recording()
    assert plain.reaction is not None
    channels = plain.reaction.channels_n.copy()
    channels[K * 6 :, 2] += 30.0
    jumped = average_periods(replace(plain, reaction=replace(plain.reaction, channels_n=channels)))
    before = average_periods(plain)
    assert jumped.reaction is not None
    assert before.reaction is not None
    np.testing.assert_allclose(
        vary(jumped.reaction.channels_n), vary(before.reaction.channels_n), atol=0.02
    )


def test_a_period_with_an_overload_is_excluded_from_the_average() -> None:
    valid = all_valid()
    valid[3 * K + 10 : 3 * K + 30, 4] = False
    average = average_periods(recording(valid=valid))
    assert [(p.index, p.reason.split(":")[0]) for p in average.rejected] == [
        (3, "channel fz1 of the force plate")
    ]
    assert average.reaction is not None
    assert average.reaction.left_out == ()


def test_a_repeatedly_overloaded_channel_is_excluded_instead() -> None:
    valid = all_valid()
    for period in range(PERIODS):
        valid[period * K + 10 : period * K + 30, 4] = False
    average = average_periods(recording(valid=valid))
    assert average.rejected == ()
    assert average.reaction is not None
    assert average.reaction.left_out == ("fz1",)
    assert (average.reaction.channels_n[:, 4] == 0.0).all()
    assert np.isfinite(average.reaction.channels_n).all()


def test_the_torques_are_kept_if_the_plate_fails() -> None:
    valid = all_valid()
    valid[:, :6] = False
    assert average_periods(recording(valid=valid)).reaction is None


def test_single_rows_without_the_plate_are_excluded_from_its_mean() -> None:
    valid = all_valid()
    valid[5 * K + 7] = False
    plain = recording()
    assert plain.reaction is not None
    channels = plain.reaction.channels_n.copy()
    channels[5 * K + 7] = 0.0
    holed = replace(plain, reaction=replace(plain.reaction, channels_n=channels, valid=valid))
    average = average_periods(holed)
    assert average.rejected == ()
    assert average.reaction is not None
    angle = 2.0 * np.pi * 7 / K
    truth = np.array([10.0 * np.sin((k % 3 + 1) * angle + k) for k in range(8)])
    np.testing.assert_allclose(average.reaction.channels_n[7], truth, atol=0.2)


def test_a_collision_on_the_plate_is_out_of_family() -> None:
    plain = recording()
    assert plain.reaction is not None
    channels = plain.reaction.channels_n.copy()
    channels[7 * K + 100 : 7 * K + 110, 5] += 50.0
    average = average_periods(replace(plain, reaction=replace(plain.reaction, channels_n=channels)))
    (rejected,) = average.rejected
    assert rejected.index == 7
    assert "channel fz2 of the force plate differs" in rejected.reason


def test_a_plate_of_another_length_is_refused() -> None:
    plain = recording()
    assert plain.reaction is not None
    short = replace(
        plain.reaction,
        channels_n=plain.reaction.channels_n[:-1],
        valid=plain.reaction.valid[:-1],
    )
    with raises_code(RecordingError, "RID-API-ARGUMENT"):
        replace(plain, reaction=short)


def test_too_few_valid_periods_at_one_sample_are_reported() -> None:
    valid = all_valid()
    for period in range(PERIODS - 1):
        valid[period * K + 7, 3] = False
    with raises_code(DataQualityError, "RID-RECORDING-PERIODS", "fy23"):
        average_periods(recording(valid=valid))


def recording_with_drift(*parts: tuple[int, int, float], limit_n_s: float = 0.5) -> Recording:
    """Return a recording in which channel fz1 drifts in parts: (first sample, last sample, N/s)."""
    plain = recording(noise_n=0.05)
    assert plain.reaction is not None
    channels = plain.reaction.channels_n.copy()
    for first, last, rate in parts:
        channels[:, 4] += rate * CYCLE_S * np.clip(np.arange(K * PERIODS) - first, 0, last - first)
    reaction = replace(plain.reaction, channels_n=channels, drift_limit_n_s=limit_n_s)
    return replace(plain, reaction=reaction)


def test_a_period_of_drift_is_excluded_and_named() -> None:
    """Row 29 of docs/faults.md: exactly the periods whose drift exceeds the limit are rejected."""
    average = average_periods(
        recording_with_drift((3 * K, 4 * K, 0.6), (7 * K + 40, 7 * K + 60, -12.0))
    )
    assert [p.index for p in average.rejected] == [3, 7]
    for period, rate in zip(average.rejected, (0.6, -0.96), strict=True):
        words = period.reason.removeprefix("channel fz1 of the force plate drifted by ")
        assert float(words.split()[0]) == pytest.approx(rate, abs=0.02)
        assert words.endswith("the limit is 0.5 N/s")


@pytest.mark.parametrize("at", [0, 5, 10, 11])
@pytest.mark.parametrize("into", [0.1, 0.5, 0.9])
def test_a_jump_rejects_only_its_own_period(at: int, into: float) -> None:
    """Row 29 of docs/faults.md: a jump can be in any period of the run, also in the last one."""
    first = at * K + int(into * K)
    average = average_periods(recording_with_drift((first, first + 1, 2.0 / CYCLE_S)))
    assert [p.index for p in average.rejected] == [at]


def test_drift_within_the_limit_rejects_nothing() -> None:
    assert average_periods(recording_with_drift((0, PERIODS * K, 0.45))).rejected == ()


def test_a_channel_that_drifts_permanently_is_excluded_instead() -> None:
    """Row 29 of docs/faults.md: only the channel is excluded, and no period."""
    average = average_periods(recording_with_drift((0, PERIODS * K, 0.6)))
    assert average.rejected == ()
    assert average.reaction is not None
    assert average.reaction.left_out == ("fz1",)
