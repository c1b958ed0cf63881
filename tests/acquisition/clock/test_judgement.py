"""Clock check: find repeated rows, rebuild jittered time stamps, keep correct ones."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.clock.judgement import judge_clock
from acquisition.clock.report import ClockState
from acquisition.clock.samples import Samples
from benchmarks.honest_choice import DURATION_S, FRICTIONS, Case, recording
from benchmarks.known_arms import ARMS, drive
from config.arrays import FloatArray
from tests.builders.logged_arm import PERIOD_S, LoggedArm, inserted, row_times, time_error

SEEDS = st.integers(0, 10_000)
FEW = settings(max_examples=12, deadline=None, derandomize=True)


def without_velocities(samples: Samples) -> Samples:
    return replace(samples, velocity=np.full_like(samples.velocity, np.nan))


def jitter(true_s: FloatArray, seed: int, by_s: float) -> FloatArray:
    return true_s + np.random.default_rng(seed).uniform(-by_s, by_s, len(true_s))


class TestSoundClock:
    @FEW
    @given(SEEDS)
    def test_a_sound_clock_keeps_its_stamps_to_the_last_bit(self, seed: int) -> None:
        stamps = row_times() + 1.7e9
        judged = judge_clock(LoggedArm.of(seed).at(row_times(), stamps, seed))
        assert judged.report.clock is ClockState.CONFIRMED
        assert judged.kept.all()
        np.testing.assert_array_equal(judged.time_s, stamps)

    @FEW
    @given(SEEDS)
    def test_a_sound_clock_may_have_uneven_stamps(self, seed: int) -> None:
        stamps = jitter(row_times(), seed, 0.3 * PERIOD_S)
        judged = judge_clock(LoggedArm.of(seed).at(stamps, stamps, seed))
        assert judged.report.clock is ClockState.CONFIRMED
        np.testing.assert_array_equal(judged.time_s, stamps)

    def test_the_clock_of_a_robot_with_a_long_rest_has_no_repeats(self) -> None:
        late = np.clip(row_times() - 5.0, 0.0, 2.0)  # slows down for 2 s, then rests
        samples = LoggedArm.of(3).at(
            np.minimum(row_times(), 5.0) + late - late**2 / 4.0, row_times()
        )
        velocity = samples.velocity * (1.0 - late / 2.0)[:, np.newaxis]
        judged = judge_clock(replace(samples, velocity=velocity))
        assert judged.report.repeated_rows == 0
        assert judged.report.clock is ClockState.CONFIRMED

    def test_the_clock_of_a_robot_at_rest_has_no_findings(self) -> None:
        judged = judge_clock(LoggedArm.of(3).at(np.zeros(500), row_times(500)))
        assert judged.report.clock is ClockState.UNVERIFIED
        assert judged.report.findings(("a", "b", "c", "d")) == ()

    def test_a_clock_with_missing_rows_keeps_its_stamps_and_counts_them(self) -> None:
        stamps = np.delete(row_times(), np.arange(100, 2400, 25))
        judged = judge_clock(LoggedArm.of(4).at(stamps, stamps))
        assert judged.report.missing_rows == 92
        assert judged.report.clock is ClockState.CONFIRMED
        assert "92 rows are missing" in " ".join(judged.report.findings(()))


class TestRepeatedRows:
    @FEW
    @given(SEEDS, st.floats(0.02, 0.3))
    def test_repeated_rows_are_found_and_the_true_times_recovered(
        self, seed: int, share: float
    ) -> None:
        repeat = np.random.default_rng(seed).random(2500) < share
        true_s = inserted(row_times(), repeat)
        samples = LoggedArm.of(seed).at(true_s, row_times(len(true_s)), seed)
        judged = judge_clock(samples)
        made = np.concatenate([[False], np.diff(true_s) == 0.0])
        # the first or last row has a neighbour on one side only
        assert np.count_nonzero(judged.kept == made) <= 2
        assert judged.report.clock is ClockState.REBUILT
        assert judged.report.repeated_share == pytest.approx(made.mean(), abs=1e-3)
        before = time_error(samples.time_s[judged.kept], true_s[judged.kept])
        assert time_error(judged.time_s, true_s[judged.kept]) < 0.1 * before

    def test_nine_of_ten_rows_are_repeats_if_a_50_hz_source_is_read_at_500_hz(self) -> None:
        source = np.arange(0.0, 20.0, 0.02)
        published = source + np.random.default_rng(4).uniform(0.0, 0.012, len(source))
        published[0] = -1.0
        stamps = np.arange(0.0, 19.9, 0.002)
        true_s = source[np.searchsorted(published, stamps, side="right") - 1]
        judged = judge_clock(LoggedArm.of(5).at(true_s, stamps))
        assert judged.report.repeated_share == pytest.approx(0.9, abs=1e-3)
        assert judged.report.tick_s == pytest.approx(0.02)
        assert time_error(judged.time_s, true_s[judged.kept]) < 1e-6

    def test_repeats_instead_of_new_rows_leave_the_other_times_exact(self) -> None:
        true_s = row_times()
        stale = np.arange(5, 2500, 9)
        true_s[stale] = true_s[stale - 1]
        judged = judge_clock(LoggedArm.of(6).at(true_s, row_times()))
        assert judged.report.repeated_rows == len(stale)
        np.testing.assert_allclose(judged.time_s, true_s[judged.kept], atol=1e-6)

    def test_repeats_without_velocities_are_removed_and_the_clock_is_unknown(self) -> None:
        true_s = inserted(row_times(), np.arange(2500) % 10 == 9)
        samples = without_velocities(LoggedArm.of(7).at(true_s, row_times(len(true_s))))
        judged = judge_clock(samples)
        assert judged.report.repeated_rows == 250
        assert judged.report.clock is ClockState.UNKNOWN
        assert not judged.report.is_known
        np.testing.assert_array_equal(judged.time_s, samples.time_s[judged.kept])

    def test_repeated_rows_include_copied_lines(self) -> None:
        judged = judge_clock(LoggedArm.of(8).at(row_times(), row_times()), copies=7)
        assert judged.report.repeated_rows == 7
        assert judged.report.rows == 2507

    def test_repeats_with_one_moving_joint_leave_the_clock_unknown_without_a_robot(self) -> None:
        true_s = inserted(row_times(), np.arange(2500) % 10 == 9)
        samples = LoggedArm.of(9, joints=1).at(true_s, row_times(len(true_s)))
        judged = judge_clock(samples)
        assert judged.report.repeated_rows >= 245
        assert judged.report.clock is ClockState.UNKNOWN


class TestJitteredStamps:
    @FEW
    @given(SEEDS, st.floats(0.15, 0.35))
    def test_jittered_stamps_are_replaced_by_times_with_a_tenth_of_the_error(
        self, seed: int, part: float
    ) -> None:
        true_s = row_times()
        stamps = jitter(true_s, seed, part * PERIOD_S)
        judged = judge_clock(LoggedArm.of(seed).at(true_s, stamps, seed))
        assert judged.report.clock is ClockState.REBUILT
        assert time_error(judged.time_s, true_s) < 0.1 * time_error(stamps, true_s)

    def test_stamps_with_a_coarse_tick_are_replaced(self) -> None:
        stamps = np.floor(row_times() / 0.005 + 1e-9) * 0.005
        judged = judge_clock(LoggedArm.of(11).at(row_times(), stamps))
        assert judged.report.tick_s == pytest.approx(PERIOD_S, rel=1e-3)
        assert time_error(judged.time_s, row_times()) < 1e-6

    def test_jittered_stamps_without_velocities_leave_the_clock_unknown(self) -> None:
        stamps = jitter(row_times(), 12, 0.35 * PERIOD_S)
        judged = judge_clock(without_velocities(LoggedArm.of(12).at(row_times(), stamps)))
        assert judged.report.clock is ClockState.UNKNOWN
        assert judged.report.jitter_rms_s == pytest.approx(
            0.35 * PERIOD_S * (2 / 3) ** 0.5, rel=0.1
        )
        np.testing.assert_array_equal(judged.time_s, stamps)

    @pytest.mark.parametrize("scale", [0.97, 1.03])
    def test_rebuilt_stamps_keep_their_mean_rate_if_the_velocities_are_scaled(
        self, scale: float
    ) -> None:
        stamps = jitter(row_times(), 13, 0.3 * PERIOD_S)
        samples = LoggedArm.of(13).at(row_times(), stamps)
        judged = judge_clock(replace(samples, velocity=scale * samples.velocity))
        assert judged.report.clock is ClockState.REBUILT
        assert np.ptp(judged.time_s) == pytest.approx(np.ptp(row_times()), rel=1e-3)

    def test_stamps_are_not_replaced_if_velocities_are_in_another_unit(self) -> None:
        stamps = jitter(row_times(), 14, 0.3 * PERIOD_S)
        samples = LoggedArm.of(14).at(row_times(), stamps)
        judged = judge_clock(replace(samples, velocity=57.3 * samples.velocity))
        assert judged.report.clock is ClockState.UNKNOWN
        np.testing.assert_array_equal(judged.time_s, stamps)


class TestVelocitiesFromPositions:
    @pytest.mark.parametrize("formula", ["backward", "centred", "filtered"])
    def test_differentiated_positions_with_jittered_stamps_rebuild_no_times(
        self, formula: str
    ) -> None:
        stamps = jitter(row_times(), 15, 0.3 * PERIOD_S)
        samples = LoggedArm.of(15).at(row_times(), stamps)
        steps = np.diff(samples.position, axis=0) / np.diff(stamps)[:, np.newaxis]
        velocity = np.vstack([steps[:1], steps])
        if formula == "centred":
            velocity = np.gradient(samples.position, stamps, axis=0)
        if formula == "filtered":
            for row in range(1, len(velocity)):
                velocity[row] = 0.7 * velocity[row - 1] + 0.3 * velocity[row]
        judged = judge_clock(replace(samples, velocity=velocity))
        assert judged.report.clock is ClockState.UNKNOWN
        assert "were computed from the positions" in judged.report.doubt
        np.testing.assert_array_equal(judged.time_s, stamps)

    def test_differentiated_positions_with_repeated_rows_rebuild_no_times(self) -> None:
        true_s = inserted(row_times(), np.arange(2500) % 10 == 9)
        samples = LoggedArm.of(16).at(true_s, row_times(len(true_s)))
        velocity = np.gradient(samples.position, samples.time_s, axis=0)
        judged = judge_clock(replace(samples, velocity=velocity))
        assert judged.report.clock is ClockState.UNKNOWN
        assert judged.report.repeated_rows == 250


class TestRepeatedPositions:
    def test_repeated_positions_are_reported_by_joint_and_interpolated(self) -> None:
        samples = LoggedArm.of(17).at(row_times(), row_times())
        position = samples.position.copy()
        position[:, 1] = position[np.arange(2500) // 4 * 4, 1]
        judged = judge_clock(replace(samples, position=position))
        assert judged.report.clock is ClockState.UNKNOWN
        assert judged.report.held_share[1] > 0.5
        assert judged.report.held_share[0] == 0.0
        assert "b 69 %" in " ".join(judged.report.findings(("a", "b", "c", "d")))
        inner = slice(8, 2400)
        left = np.abs(judged.position - samples.position)[inner]
        assert np.quantile(left, 0.9) < 0.1 * np.quantile(
            np.abs(position[:, 1] - samples.position[:, 1]), 0.9
        )


def test_unmodelled_friction_does_not_reject_the_rebuilt_times() -> None:
    """Missing friction terms cause model errors, which hide the effect of wrong time stamps."""
    case = Case("three", "both", "repeats", 203)
    driven = drive("three", "points", 2032, FRICTIONS["both"], DURATION_S)
    _, known = recording(case, driven, 2, ARMS["three"].description())
    assert known
