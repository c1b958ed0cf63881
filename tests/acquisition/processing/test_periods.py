"""Period average (3.9, 3.10): transients excluded, lost rows tolerated, bad periods rejected."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.motion.samples import Phase
from acquisition.processing.periods import PeriodAverage, average_periods
from acquisition.recording.recording import Recording
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError, RecordingError
from tests.builders.raised_codes import raises_code

K = 200
RUN_IN = 37
NOISE = np.array([1e-4, 2e-4, 0.5, 0.1])  # position a, b; torque a, b


def one_period() -> np.ndarray:
    turns = 2.0 * np.pi * np.arange(K) / K
    return np.stack(
        [np.sin(turns), np.cos(2 * turns), 10.0 * np.sin(turns) + 30.0, 5.0 * np.sin(3 * turns)],
        axis=1,
    )


def record(periods: int = 8, seed: int = 0, noise: float = 1.0) -> Recording:
    """Return a recording with run-in, one transient period (far from the others), main periods and
    run-out.
    """
    phase = np.repeat(
        np.array([Phase.RUN_IN, Phase.TRANSIENT, Phase.MAIN, Phase.RUN_OUT], dtype=np.uint8),
        [RUN_IN, K, periods * K, 20],
    )
    rows = len(phase)
    clean = one_period()[(np.arange(rows) - RUN_IN) % K]
    clean[: RUN_IN + K] += 1.0
    values = clean + noise * NOISE * np.random.default_rng(seed).standard_normal((rows, 4))
    return Recording(
        joint_names=("a", "b"),
        time_s=np.arange(rows, dtype=np.float64) * 0.01,
        position=values[:, :2],
        torque_nm=values[:, 2:],
        valid=np.ones(rows, dtype=bool),
        phase=phase,
        sample_index=np.arange(rows),
        source="cell",
        sample_period_s=0.01,
        samples_per_period=K,
        torque_filter=ButterworthFilter(order=8, cutoff_hz=40.0),
    )


def remove_rows(recording: Recording, rows: np.ndarray) -> Recording:
    keep = np.ones(len(recording), dtype=bool)
    keep[rows] = False
    return replace(
        recording,
        time_s=recording.time_s[keep],
        position=recording.position[keep],
        torque_nm=recording.torque_nm[keep],
        valid=recording.valid[keep],
        phase=recording.phase[keep],
        answered=None if recording.answered is None else recording.answered[keep],
        sample_index=recording.sample_index[keep],
    )


def invalidate_rows(recording: Recording, rows: np.ndarray) -> Recording:
    valid = recording.valid.copy()
    valid[rows] = False
    return replace(recording, valid=valid)


def drop_answers(recording: Recording, rows: np.ndarray, joint: int) -> Recording:
    """Return the recording with absurd values of one joint in the given rows, which are marked as
    not answered.
    """
    answered = np.array(recording.joint_valid)
    answered[rows, joint] = False
    position, torque = recording.position.copy(), recording.torque_nm.copy()
    position[rows, joint], torque[rows, joint] = 1e6, -1e6
    return replace(
        recording,
        answered=answered,
        valid=np.asarray(answered.all(axis=1)),
        position=position,
        torque_nm=torque,
    )


def add_collision(recording: Recording, period: int, size: float, rows: int) -> Recording:
    start = RUN_IN + K * (1 + period) + 50
    torque = recording.torque_nm.copy()
    torque[start : start + rows, 1] += size
    return replace(recording, torque_nm=torque)


def main_row(period: int, sample: int = 0) -> int:
    return RUN_IN + K * (1 + period) + sample


class TestMeanAndNoise:
    def test_the_mean_is_within_the_noise_of_the_mean(self) -> None:
        average = average_periods(record(periods=16))
        channels = np.concatenate([average.position, average.torque_nm], axis=1)
        error = np.abs(channels - one_period()).max(axis=0)
        assert (error < 5.0 * NOISE / 4.0).all()
        assert average.periods_kept == 16
        assert average.rejected == ()
        assert average.samples_per_period == K
        assert average.period_s == pytest.approx(2.0)

    def test_the_variance_is_that_of_3_10(self) -> None:
        recording = record(periods=6)
        average = average_periods(recording)
        main = recording.torque_nm[recording.phase == Phase.MAIN].reshape(6, K, 2)
        expected = np.square(main - main.mean(axis=0)).sum(axis=(0, 1)) / (K * 5)
        np.testing.assert_allclose(average.torque_variance, expected)
        np.testing.assert_allclose(np.sqrt(average.torque_variance), NOISE[2:], rtol=0.1)
        np.testing.assert_allclose(np.sqrt(average.position_variance), NOISE[:2], rtol=0.1)

    def test_bin_variances_sum_to_the_variance(self) -> None:
        average = average_periods(record())
        both_sides = np.concatenate(
            [average.torque_bin_variance, average.torque_bin_variance[1:-1]]
        ).sum(axis=0)
        np.testing.assert_allclose(both_sides, average.torque_variance)

    def test_the_bin_variance_shows_coloured_noise(self) -> None:
        recording = record(periods=40, noise=0.01)
        phase = np.random.default_rng(1).uniform(0, 2 * np.pi, 40)
        hum = np.zeros((len(recording), 2))
        for period in range(40):
            # at harmonic 30, with another phase in each period
            turns = 2 * np.pi * 30 * np.arange(K) / K
            hum[main_row(period) : main_row(period + 1), 0] = 0.2 * np.sin(turns + phase[period])
        average = average_periods(replace(recording, torque_nm=recording.torque_nm + hum))
        spectrum = average.torque_bin_variance[:, 0]
        assert spectrum.argmax() == 30
        assert spectrum[30] == pytest.approx((0.2 / 2) ** 2, rel=0.1)
        assert np.sort(spectrum)[-2] < 1e-4 * spectrum[30]

    def test_transients_and_ramps_are_excluded(self) -> None:
        average = average_periods(record(noise=0.0))  # the transient period is off by 1.0
        np.testing.assert_allclose(average.position, one_period()[:, :2], atol=1e-12)

    def test_the_torque_filter_is_kept_for_later_compensation(self) -> None:
        average = average_periods(record())
        assert average.torque_filter == ButterworthFilter(order=8, cutoff_hz=40.0)


class TestLostRows:
    @settings(max_examples=25)
    @given(seed=st.integers(0, 1000), lost=st.integers(1, 4), erase=st.booleans())
    def test_single_losses_neither_shift_nor_bias_the_mean(
        self, seed: int, lost: int, erase: bool
    ) -> None:
        recording = record(noise=1e-6)
        inner = np.arange(main_row(0) + 1, main_row(8) - 1)
        rows = np.random.default_rng(seed).choice(inner[::5], lost, replace=False)
        damaged = remove_rows(recording, rows) if erase else invalidate_rows(recording, rows)
        average = average_periods(damaged)
        np.testing.assert_allclose(average.position, one_period()[:, :2], atol=1e-6)
        assert average.missing_samples == lost
        assert average.periods_kept == 8

    def test_values_of_invalid_rows_are_not_used(self) -> None:
        recording = record(noise=0.0)
        position = recording.position.copy()
        position[main_row(2, 77)] = 1e6
        damaged = invalidate_rows(
            replace(recording, position=position), np.array([main_row(2, 77)])
        )
        np.testing.assert_allclose(
            average_periods(damaged).position, one_period()[:, :2], atol=1e-12
        )

    def test_a_lost_first_row_of_the_main_phase_is_reconstructed(self) -> None:
        average = average_periods(remove_rows(record(noise=0.0), np.array([main_row(0)])))
        np.testing.assert_allclose(average.position, one_period()[:, :2], atol=1e-12)
        assert average.missing_samples == 1

    def test_an_ambiguous_start_is_refused(self) -> None:
        gone = np.array([main_row(0) - 1, main_row(0), main_row(8) - 1, main_row(8)])
        with raises_code(DataQualityError, "RID-RECORDING-ROWS-LOST"):
            average_periods(remove_rows(record(), gone))

    def test_a_gap_rejects_its_period(self) -> None:
        gap = np.arange(main_row(3, 100), main_row(3, 104))
        average = average_periods(invalidate_rows(record(), gap))
        assert [period.index for period in average.rejected] == [3]
        assert "4 of 200 samples missing, 4 in a row" in average.rejected[0].reason
        assert average.periods_kept == 7

    def test_the_reason_names_the_place_of_the_longest_gap(self) -> None:
        lost = np.concatenate([[main_row(3, 7)], np.arange(main_row(3, 100), main_row(3, 104))])
        average = average_periods(invalidate_rows(record(), lost))
        assert average.rejected[0].reason == "5 of 200 samples missing, 4 in a row from sample 100"

    def test_more_than_two_percent_of_all_rows_is_refused(self) -> None:
        rows = np.arange(main_row(0, 3), main_row(8), 40)
        with raises_code(DataQualityError, "RID-RECORDING-ROWS-LOST", "40", "1600"):
            average_periods(invalidate_rows(record(), rows))

    def test_a_stopped_run_keeps_its_complete_periods(self) -> None:
        stopped = remove_rows(record(), np.arange(main_row(5, 120), main_row(8) + 20))
        average = average_periods(stopped)
        assert average.periods_kept == 5
        assert average.rejected[0].index == 5
        assert average.rejected[0].reason == "ended after 120 of 200 samples"


class TestLostAnswers:
    """The answers of each drive are judged separately, because with more joints more rows lack some
    answer.
    """

    @settings(max_examples=25)
    @given(seed=st.integers(0, 1000))
    def test_one_and_a_half_percent_of_each_joints_answers_may_be_lost(self, seed: int) -> None:
        recording, rng = record(noise=1e-6), np.random.default_rng(seed)
        for joint in range(2):
            for period in range(8):
                rows = main_row(period) + rng.choice(np.arange(1, K - 1), 3, replace=False)
                recording = drop_answers(recording, rows, joint)
        average = average_periods(recording)
        assert average.rejected == ()
        assert 24 < average.missing_samples <= 48
        np.testing.assert_allclose(average.position, one_period()[:, :2], atol=1e-6)
        np.testing.assert_allclose(average.torque_nm, one_period()[:, 2:], atol=1e-5)

    def test_a_period_with_too_many_lost_answers_of_a_joint_is_rejected(self) -> None:
        damaged = drop_answers(record(), main_row(3) + np.arange(7, 57, 10), 1)
        average = average_periods(damaged)
        assert [period.index for period in average.rejected] == [3]
        assert average.rejected[0].reason == (
            "joint 'b': 5 of 200 samples missing, 1 in a row from sample 7"
        )

    def test_more_than_two_percent_of_a_joints_answers_is_refused(self) -> None:
        recording = record()
        for period, lost in enumerate((8, 4, 9, 7, 8, 0, 4, 9)):
            recording = drop_answers(recording, main_row(period) + 5 * np.arange(1, lost + 1), 0)
        with raises_code(DataQualityError, "RID-RECORDING-ROWS-LOST", "'a'", "49", "1600"):
            average_periods(recording)

    def test_contradictory_rows_and_answers_are_refused(self) -> None:
        damaged = drop_answers(record(), np.array([50]), 0)
        with raises_code(RecordingError, "RID-API-ARGUMENT"):
            replace(damaged, valid=np.ones(len(damaged), dtype=bool))


class TestOutOfFamily:
    def test_a_collision_rejects_its_period_and_names_the_joint(self) -> None:
        average = average_periods(add_collision(record(), period=5, size=1.5, rows=10))
        assert [period.index for period in average.rejected] == [5]
        assert "torque of joint 'b' differs" in average.rejected[0].reason
        np.testing.assert_allclose(average.torque_nm[:, 1], one_period()[:, 3], atol=0.25)

    @settings(max_examples=30)
    @given(seed=st.integers(0, 10_000), periods=st.integers(3, 20))
    def test_ordinary_noise_rejects_nothing(self, seed: int, periods: int) -> None:
        assert average_periods(record(periods, seed)).rejected == ()

    def test_a_slow_drift_rejects_nothing(self) -> None:
        recording = record(periods=16)
        drift = np.linspace(0.0, 5.0, len(recording))[:, np.newaxis]
        drifting = replace(recording, torque_nm=recording.torque_nm + drift)
        assert average_periods(drifting).rejected == ()

    def test_negligible_differences_reject_nothing(self) -> None:
        recording = record(noise=0.0)
        position = recording.position.copy()
        position[main_row(2, 10), 0] += 5e-5  # one encoder count, in a recording without noise
        assert average_periods(replace(recording, position=position)).rejected == ()

    def test_a_joint_at_rest_that_creeps_by_a_count_rejects_nothing(self) -> None:
        recording = record()
        position = recording.position.copy()
        position[:, 1] = 0.7
        position[main_row(2, 10) : main_row(2, 60), 1] += 2.4e-5
        assert average_periods(replace(recording, position=position)).rejected == ()

    def test_a_joint_with_a_small_motion_is_compared_with_that_motion(self) -> None:
        """The prismatic joint moves by some millimetres, the other joint by some radians."""
        recording = record(noise=1e-6)
        position = recording.position.copy()
        position[:, 1] *= 2e-3
        position[main_row(2, 10) : main_row(2, 60), 1] += 6e-5
        average = average_periods(replace(recording, position=position))
        assert [period.index for period in average.rejected] == [2]

    def test_too_many_bad_periods_are_refused_with_all_reasons(self) -> None:
        recording = record(periods=16)
        for period in range(0, 12, 2):
            recording = add_collision(recording, period, 3.0 + period, 10)
        with raises_code(DataQualityError, "RID-RECORDING-PERIODS", "11"):
            average_periods(recording)
        assert average_periods(recording, rejected_limit=6).periods_kept == 10


class TestRefusals:
    def test_of_one_period_no_noise_can_be_estimated(self) -> None:
        with raises_code(DataQualityError, "RID-RECORDING-PERIODS"):
            average_periods(record(periods=1))

    def test_a_recording_that_is_not_periodic_is_refused(self) -> None:
        with raises_code(DataQualityError, "RID-RECORDING-NOT-PERIODIC"):
            average_periods(replace(record(), samples_per_period=None))

    def test_a_recording_that_ended_before_the_main_periods_is_refused(self) -> None:
        with raises_code(DataQualityError, "RID-RECORDING-PERIODS"):
            average_periods(remove_rows(record(), np.arange(main_row(0), main_row(8) + 20)))

    def test_an_average_of_one_period_is_refused(self) -> None:
        average = average_periods(record())
        with raises_code(DataQualityError, "RID-RECORDING-PERIODS"):
            replace(average, periods_kept=1)
        assert isinstance(average, PeriodAverage)


def test_temperature_is_the_mean_over_the_accepted_periods() -> None:
    """The drive warms up by 1 K per period; temperatures of a rejected period do not count."""
    recording = record(periods=5)
    period = (np.arange(len(recording)) - RUN_IN) // K - 1
    warm = replace(recording, temperature_k=np.stack([300.0 + period, 310.0 + 0.0 * period], 1))
    assert average_periods(recording).temperature_k is None
    assert average_periods(warm).temperature_k == pytest.approx([302.0, 310.0])

    average = average_periods(add_collision(warm, period=4, size=50.0, rows=10))
    assert [rejected.index for rejected in average.rejected] == [4]
    assert average.temperature_k == pytest.approx([301.5, 310.0])
