"""External and combined model; Pinocchio computes the load on the force plate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pytest
from numpy.typing import NDArray

from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from config.cell.torque_filter import ButterworthFilter
from config.errors import EstimationError
from dynamics.model.true_parameters import true_parameters
from identification.accuracy.plate_benefit import improvement
from identification.calibration.torque_scale import torque_consistency
from identification.equations.segments import period_signals
from identification.estimation.estimate import Estimate, predict_base_wrench
from identification.estimation.file import read_estimate, write_estimate
from identification.estimation.fitted_periods import FittedPeriods, build_model, fit_periodic
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.base_parameters import ModelKind
from identification.model.options import ModelOptions
from tests.builders.raised_codes import raises_code

if TYPE_CHECKING:
    from tests.identification.conftest import KnownArm

Weigh = Callable[..., Recording]
FILTER = ButterworthFilter(order=8, cutoff_hz=40.0)
SEEDS = 6


def truth_of(kind: ModelKind, cell: Any, arm: KnownArm) -> NDArray[np.float64]:
    model, base, *_ = build_model(arm.robot, ModelOptions(kind=kind))
    return base.from_standard(true_parameters(model, cell.robot, cell.plant))


def identify(arm: KnownArm, recording: Recording, kind: ModelKind = "combined") -> Estimate:
    return fit_periodic(
        arm.robot, [average_periods(recording)], EstimationOptions(model=ModelOptions(kind=kind))
    ).estimate()


def fit_recording(arm: KnownArm, recording: Recording) -> FittedPeriods:
    return fit_periodic(
        arm.robot,
        [average_periods(recording)],
        EstimationOptions(model=ModelOptions(kind="combined")),
    )


@pytest.fixture(scope="module")
def recordings(weigh: Weigh) -> list[Recording]:
    return [weigh(seed, torque_filter=FILTER) for seed in range(SEEDS)]


@pytest.fixture(scope="module")
def combined(arm: KnownArm, recordings: list[Recording]) -> list[Estimate]:
    return [identify(arm, recording) for recording in recordings]


class TestEstimate:
    def test_the_estimate_has_20_rigid_body_parameters_and_every_rotor(
        self, combined: list[Estimate]
    ) -> None:
        base = combined[0].base
        assert sum(base.rigid_body) == 20
        assert [name for name in base.names if name.startswith("Im")] == ["Im1", "Im2", "Im3"]

    @pytest.mark.parametrize("kind", ["external", "combined"])
    def test_two_sigma_cover_the_truth(
        self,
        arm: KnownArm,
        cell: Any,
        recordings: list[Recording],
        combined: list[Estimate],
        kind: ModelKind,
    ) -> None:
        found = combined if kind == "combined" else [identify(arm, r, kind) for r in recordings]
        truth = truth_of(kind, cell, arm)
        off = []
        for e in found:
            assert e.sigma_noise is not None
            off.append((e.values - truth) / e.sigma_noise)
        by_noise = np.array(off)
        quoted = np.array([(e.values - truth) / e.sigma for e in found])
        assert np.mean(np.abs(quoted) < 2.0) >= 0.9
        assert np.mean(np.abs(by_noise) < 2.0) >= 0.92
        weighed = [i for i, name in enumerate(found[0].base.names) if name != "m1"]
        assert 0.7 < np.sqrt(np.mean(by_noise[:, weighed] ** 2)) < 1.2

    def test_the_plate_fits_within_its_noise(self, combined: list[Estimate]) -> None:
        for estimate in combined:
            assert estimate.plate is not None
            assert (estimate.plate.residual < 1.4 * estimate.plate.noise).all()

    def test_offset_and_drift_have_no_effect(
        self, arm: KnownArm, weigh: Weigh, combined: list[Estimate]
    ) -> None:
        """Offsets of 20 N and drifts of 0.05 N/s shift the estimate by less than sigma / 2."""
        drifting = weigh(0, torque_filter=FILTER, plate={"offset_n": 20.0, "drift_n_s": 0.05})
        changed = identify(arm, drifting)
        assert combined[0].sigma_noise is not None
        shift = np.abs(changed.values - combined[0].values) / combined[0].sigma_noise
        assert shift.max() < 0.5
        assert changed.plate is not None
        assert np.abs(changed.plate.drift_n_s).max() == pytest.approx(0.047, abs=0.004)

    def test_a_delay_of_the_plate_is_found_and_compensated(
        self, arm: KnownArm, weigh: Weigh, combined: list[Estimate]
    ) -> None:
        late = identify(arm, weigh(0, torque_filter=FILTER, plate={"delay_s": 0.004}))
        assert late.plate is not None
        (delay_s,), (sigma_s,) = late.plate.delay_s, late.plate.delay_sigma_s
        assert delay_s == pytest.approx(0.004, abs=50e-6)
        assert sigma_s < 20e-6
        assert combined[0].sigma_noise is not None
        shift = np.abs(late.values - combined[0].values) / combined[0].sigma_noise
        assert shift.max() < 0.5

    def test_every_run_has_its_own_delay(self, arm: KnownArm, weigh: Weigh) -> None:
        runs = [
            average_periods(weigh(seed, torque_filter=FILTER, plate={"delay_s": delay_s}))
            for seed, delay_s in ((0, 0.002), (1, 0.010))
        ]
        both = fit_periodic(
            arm.robot, runs, EstimationOptions(model=ModelOptions(kind="combined"))
        ).estimate()
        assert both.plate is not None
        np.testing.assert_allclose(both.plate.delay_s, [0.002, 0.010], atol=50e-6)

    @pytest.mark.parametrize("channel", [0, 3, 4, 7])
    def test_without_one_channel_the_others_suffice(
        self, arm: KnownArm, cell: Any, weigh: Weigh, combined: list[Estimate], channel: int
    ) -> None:
        partial = identify(arm, weigh(0, torque_filter=FILTER, plate={"overloaded": (channel,)}))
        z = (partial.values - truth_of("combined", cell, arm)) / partial.sigma
        assert np.mean(np.abs(z) < 2.0) >= 0.9
        assert partial.plate is not None
        assert len(partial.plate.left_out[0]) == 1
        assert partial.sigma_noise is not None
        assert combined[0].sigma_noise is not None
        assert np.median(partial.sigma_noise / combined[0].sigma_noise) < 3.0

    def test_the_weight_is_as_uncertain_as_the_offset(self, combined: list[Estimate]) -> None:
        assert combined[0].base.expressions[0] == "m1 + m2 + m3"
        assert combined[0].sigma[0] > 500.0

    def test_the_estimate_predicts_the_reaction(
        self, arm: KnownArm, cell: Any, combined: list[Estimate]
    ) -> None:
        random = np.random.default_rng(0)
        motion = random.normal(size=(3, 20, 3))
        found = predict_base_wrench(combined[0], *motion)
        truth = replace(combined[0], values=truth_of("combined", cell, arm))
        error = found - predict_base_wrench(truth, *motion)
        assert np.abs(error - error[0])[:, 2].max() < 0.1  # without the weight

    def test_the_internal_model_predicts_no_reaction(self, arm: KnownArm, weigh: Weigh) -> None:
        internal = identify(arm, weigh(0), "internal")
        assert internal.plate is None
        with raises_code(EstimationError, "RID-MODEL-NOT-COMBINED"):
            predict_base_wrench(internal, *np.zeros((3, 1, 3)))

    @pytest.mark.parametrize("weighting", ["ls", "huber"])
    def test_other_weightings_estimate_the_same_robot(
        self, arm: KnownArm, recordings: list[Recording], combined: list[Estimate], weighting: Any
    ) -> None:
        other = fit_periodic(
            arm.robot,
            [average_periods(recordings[0])],
            EstimationOptions(model=ModelOptions(kind="combined"), weighting=weighting),
        ).estimate()
        moved = (other.values - combined[0].values) / (3.0 * other.sigma + 1e-9)
        assert np.mean(np.abs(moved) < 1.0) > 0.9

    def test_a_recording_without_a_plate_is_refused(
        self, arm: KnownArm, measure: Callable[..., Recording]
    ) -> None:
        with raises_code(EstimationError, "RID-PLATE-MISSING"):
            identify(arm, measure())

    def test_a_recording_without_periods_is_refused(self, arm: KnownArm, weigh: Weigh) -> None:
        signals = period_signals(average_periods(weigh(0)), 10.0)
        with raises_code(EstimationError, "RID-MODEL-KIND"):
            fit_smoothed(
                arm.robot, [signals], EstimationOptions(model=ModelOptions(kind="combined"))
            ).estimate()

    def test_a_plate_of_another_motion_is_refused(
        self, arm: KnownArm, recordings: list[Recording]
    ) -> None:
        reaction = recordings[0].reaction
        assert reaction is not None
        shifted = replace(reaction, channels_n=np.roll(reaction.channels_n, 200, axis=0))
        with raises_code(EstimationError, "RID-PLATE-LATE", "late"):
            identify(arm, replace(recordings[0], reaction=shifted))

    def test_a_combined_estimate_is_stored_in_a_file(
        self, tmp_path: Path, combined: list[Estimate]
    ) -> None:
        write_estimate(tmp_path / "model.json", combined[0])
        found = read_estimate(tmp_path / "model.json")
        assert found.options == combined[0].options
        assert found.plate is not None
        assert combined[0].plate is not None
        np.testing.assert_array_equal(found.plate.noise, combined[0].plate.noise)
        np.testing.assert_array_equal(found.plate.drift_n_s, combined[0].plate.drift_n_s)
        assert found.plate.left_out == ((),)


class TestImprovement:
    def test_no_parameter_is_less_certain_with_both_models(
        self, arm: KnownArm, recordings: list[Recording]
    ) -> None:
        """Table 4.1 of the thesis has the same result."""
        found = improvement(fit_recording(arm, recordings[0]))
        assert len(found.parameters) == 23 + 9
        for parameter in found.parameters:
            for alone in (parameter.sigma_internal, parameter.sigma_external):
                assert alone is None or parameter.sigma_combined <= alone * (1.0 + 1e-9)
            assert parameter.sigma_internal or parameter.sigma_external

    def test_the_determinant_of_the_common_parameters_falls_by_more_than_three(
        self, arm: KnownArm, weigh: Weigh
    ) -> None:
        for noise_n in (0.5, 20.0):
            recording = weigh(0, torque_filter=FILTER, plate={"noise_n": noise_n})
            found = improvement(fit_recording(arm, recording))
            assert len(found.shared) == 12
            assert found.determinant_ratio >= 3.0

    def test_each_model_alone_is_as_certain_as_if_estimated_separately(
        self, arm: KnownArm, recordings: list[Recording]
    ) -> None:
        found = improvement(fit_recording(arm, recordings[0]))
        internal = identify(arm, recordings[0], "internal")
        external = identify(arm, recordings[0], "external")
        by_words = {parameter.expression: parameter for parameter in found.parameters}
        for estimate, which in ((internal, "sigma_internal"), (external, "sigma_external")):
            assert estimate.sigma_noise is not None
            for words, sigma in zip(estimate.base.expressions, estimate.sigma_noise, strict=True):
                assert getattr(by_words[words], which) == pytest.approx(sigma, rel=0.02)

    def test_the_improvement_has_a_description(
        self, arm: KnownArm, recordings: list[Recording]
    ) -> None:
        sentence = improvement(fit_recording(arm, recordings[0])).sentence
        assert "of the 12 parameters that torques and plate each determine" in sentence


class TestTorqueConstants:
    def test_correct_torque_constants_agree_with_the_plate(
        self, arm: KnownArm, recordings: list[Recording]
    ) -> None:
        p_values = []
        for recording in recordings:
            found = torque_consistency(fit_recording(arm, recording))
            assert not any(axis.wrong for axis in found.axes)
            assert "agree" in found.sentence
            p_values.append(found.p_value)
        assert 0.02 < np.mean(p_values) < 0.98

    @pytest.mark.parametrize("axis", [0, 1, 2])
    @pytest.mark.parametrize("factor", [0.95, 1.05])
    def test_a_torque_constant_with_an_error_of_5_percent_is_found_and_its_axis_named(
        self, arm: KnownArm, recordings: list[Recording], axis: int, factor: float
    ) -> None:
        scale = np.ones(3)
        scale[axis] = factor
        recording = replace(recordings[1], torque_nm=recordings[1].torque_nm * scale)
        found = torque_consistency(fit_recording(arm, recording))
        assert [scale.wrong for scale in found.axes] == [j == axis for j in range(3)]
        assert found.axes[axis].ratio == pytest.approx(factor, abs=3.0 * found.axes[axis].sigma)
        assert found.p_value < 1e-6
        assert f"axis{axis + 1} measures" in found.sentence
        assert "check the torque constant" in found.sentence

    def test_a_common_error_of_torque_constants_is_a_finding_about_the_plate(
        self, arm: KnownArm, recordings: list[Recording]
    ) -> None:
        recording = replace(recordings[1], torque_nm=recordings[1].torque_nm * 1.03)
        assert "plate's sensitivity" in torque_consistency(fit_recording(arm, recording)).sentence
