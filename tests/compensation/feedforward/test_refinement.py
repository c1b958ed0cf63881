"""Tuning by a reference run and iterative refinement, on the simulated arm."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from acquisition.motion.kinds.circle import CircleMotion
from acquisition.motion.kinds.tool_path import PathMotion
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.recording.recording import Recording
from compensation.compensated_motion import compensated_motion, refuse_torque
from compensation.feedforward.periodic_rows import with_period
from compensation.feedforward.refinement import (
    Refinement,
    refinement,
    stability_bound,
    without_jumps,
)
from compensation.feedforward.repeated_error import RepeatedError, repeated_error
from compensation.feedforward.tracking_error import TrackingError, tracking_error
from compensation.feedforward.tuning import tune
from compensation.loops.velocity_loop import VelocityLoop
from config.arrays import FloatArray
from config.errors import DataQualityError, LimitError
from config.load import LoadedCell
from dynamics.geometry.kinematics import Chain
from identification.estimation.estimate import Estimate
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

Drive = Callable[..., Recording]

SPRING_DELAY_S = 2e-4
"""Allowed error of a delay [s]: presliding at reversals resembles up to 0.1 ms of delay."""
CIRCLE = CircleMotion(
    kind="circle",
    robot="ir361",
    centre_m=(0.575, -0.078, -1.724),
    radius_m=0.2,
    speed_m_s=0.6,
    near=(0.1, -0.1, 0.4),
    periods=6,
)
SPLINE = PathMotion.model_validate(
    {
        "kind": "path",
        "robot": "ir361",
        "start_m": (0.6, -0.2, -1.7),
        "near": (0.1, -0.1, 0.4),
        "speed_m_s": 0.4,
        "blend_m": 0.05,
        "segments": (
            {"kind": "line", "to_m": (0.6, 0.1, -1.7)},
            {
                "kind": "spline",
                "through_m": ((0.8, 0.1, -1.7), (0.7, -0.1, -1.6), (0.6, -0.2, -1.7)),
            },
        ),
    }
)
"""A line and a spline, which are not used for tuning."""


@pytest.fixture(scope="module")
def planned(cell: LoadedCell) -> MotionSamples:
    return CIRCLE.plan(cell.robot, cell.config.cycle_time_s).whole()


@pytest.fixture(scope="module")
def path(cell: LoadedCell) -> MotionSamples:
    return SPLINE.plan(cell.robot, cell.config.cycle_time_s)


def error_of(cell: LoadedCell, drive: Drive, samples: MotionSamples) -> TrackingError:
    recording = drive(samples, 5)
    main = samples.phase == Phase.MAIN
    chain = Chain.from_description(cell.robot)
    return tracking_error(chain, samples.position[main], recording.position[main])


def refined(samples: MotionSamples, found: Refinement) -> MotionSamples:
    ahead = samples.velocity if samples.feedforward is None else samples.feedforward
    more = found.correction
    if samples.samples_per_period is not None:
        more = with_period(samples, np.zeros_like(ahead), more)
    return replace(samples, feedforward=ahead + more)


def repeat(
    cell: LoadedCell,
    drive: Drive,
    loops: list[VelocityLoop],
    model: Estimate,
    planned: MotionSamples,
) -> tuple[list[FloatArray], MotionSamples, Refinement]:
    """Refine over three runs; return each run's RMS errors, the last motion and refinement."""
    samples = compensated_motion(planned, model, loops)
    sizes = []
    for seed in range(3):
        measured = repeated_error(cell.robot, samples, [drive(samples, 20 + seed)])
        found = refinement(samples, measured, model, loops, cell.config.position_gain_per_s)
        sizes.append(measured.rms)
        samples = refined(samples, found)
    return sizes, samples, found


class TestTuning:
    @pytest.mark.parametrize("compensated", [False, True])
    def test_one_run_of_the_circle_corrects_wrong_loops(
        self,
        cell: LoadedCell,
        drive: Drive,
        loops: list[VelocityLoop],
        model: Estimate,
        planned: MotionSamples,
        path: MotionSamples,
        compensated: bool,
    ) -> None:
        wrong = [replace(loop, gain=1.15 * loop.gain, delay_s=0.0, lag_s=0.0) for loop in loops]
        reference = compensated_motion(planned, model, wrong) if compensated else planned
        measured = repeated_error(cell.robot, reference, [drive(reference, 3)])
        gain = cell.config.position_gain_per_s
        found = tune(reference, measured, model, wrong, gain)
        assert found.used == (True, True, True)
        np.testing.assert_allclose(found.scale, 1.15, atol=0.07)
        assert (found.scale_std < 0.05).all()
        assert (found.delay_s > -2.0 * found.delay_std_s - SPRING_DELAY_S).all()
        for motion in (planned, path):
            before = error_of(cell, drive, compensated_motion(motion, model, wrong))
            after = error_of(cell, drive, compensated_motion(motion, model, wrong, found.tuning))
            assert after.mean_m < 0.7 * before.mean_m

    def test_unusable_reference_runs_are_refused(
        self,
        cell: LoadedCell,
        drive: Drive,
        loops: list[VelocityLoop],
        model: Estimate,
        planned: MotionSamples,
        path: MotionSamples,
    ) -> None:
        gain = cell.config.position_gain_per_s
        measured = repeated_error(cell.robot, planned, [drive(planned, 3)])
        other = [replace(loop, gain=2.0 * loop.gain) for loop in loops]
        with raises_code(DataQualityError, "RID-LOOP-OTHER", "axis1"):
            tune(planned, measured, model, other, gain)
        not_periodic = repeated_error(cell.robot, path, [drive(path, seed) for seed in (1, 2)])
        with raises_code(DataQualityError, "RID-RECORDING-NOT-PERIODIC"):
            tune(path, not_periodic, model, loops, gain)

    def test_an_axis_with_little_motion_is_not_tuned(
        self,
        cell: LoadedCell,
        drive: Drive,
        loops: list[VelocityLoop],
        model: Estimate,
        planned: MotionSamples,
    ) -> None:
        random = np.random.default_rng(0)
        measured = repeated_error(cell.robot, planned, [drive(planned, 3)])
        noisy = measured.error.copy()
        noisy[:, 0] += 0.005 * random.normal(size=len(noisy))
        gain = cell.config.position_gain_per_s
        found = tune(planned, replace(measured, error=noisy), model, loops, gain)
        assert found.used == (False, True, True)
        assert found.tuning.scale[0] == 1.0
        assert found.tuning.delay_s[0] == 0.0


class TestRefinement:
    def test_the_error_of_the_circle_falls_and_halves_with_every_repetition(
        self,
        cell: LoadedCell,
        drive: Drive,
        loops: list[VelocityLoop],
        model: Estimate,
        planned: MotionSamples,
    ) -> None:
        """With all unmodelled effects, the mean error falls to less than 1/200, the maximum to
        1/50.
        """
        before = error_of(cell, drive, planned)
        sizes, samples, found = repeat(cell, drive, loops, model, planned)
        after = error_of(cell, drive, samples)
        assert after.mean_m < before.mean_m / 200.0
        assert after.max_m < before.max_m / 50.0
        assert (found.bound.largest < 0.2).all()
        # No comparison with the bound: it does not include presliding, a spring at each reversal.
        assert all((less < 0.5 * more).all() for more, less in pairwise(sizes))

    def test_with_memoryless_friction_the_error_falls_within_the_stated_bound(
        self,
        cell: LoadedCell,
        forgetful: tuple[Drive, list[VelocityLoop], Estimate],
        planned: MotionSamples,
    ) -> None:
        drive, loops, model = forgetful
        sizes, _, found = repeat(cell, drive, loops, model, planned)
        # The bound covers the largest error, which the friction of axis 1 causes.
        assert (found.bound.largest < 0.2).all()
        # The remaining error is noise, which the bound does not include.
        assert sizes[1][0] < found.bound.largest[0] * sizes[0][0] + sizes[2][0]
        assert (sizes[2] > 0.5 * sizes[1]).any()  # hardly any error is left

    def test_a_motion_without_feedforward_is_refined(
        self,
        cell: LoadedCell,
        drive: Drive,
        loops: list[VelocityLoop],
        model: Estimate,
        planned: MotionSamples,
    ) -> None:
        before = error_of(cell, drive, planned)
        measured = repeated_error(cell.robot, planned, [drive(planned, 3)])
        found = refinement(planned, measured, model, loops, cell.config.position_gain_per_s)
        assert not found.finished
        after = error_of(cell, drive, refined(planned, found))
        assert after.mean_m < before.mean_m / 10.0

    def test_a_motion_that_is_not_periodic_is_refined_over_runs(
        self,
        cell: LoadedCell,
        drive: Drive,
        loops: list[VelocityLoop],
        model: Estimate,
        path: MotionSamples,
    ) -> None:
        samples = compensated_motion(path, model, loops)
        before = error_of(cell, drive, samples)
        measured = repeated_error(cell.robot, samples, [drive(samples, seed) for seed in (1, 2, 3)])
        found = refinement(samples, measured, model, loops, cell.config.position_gain_per_s)
        after = error_of(cell, drive, refined(samples, found))
        assert after.mean_m < before.mean_m / 4.0
        assert after.max_m < before.max_m / 2.0

    def test_noise_is_not_learned(
        self,
        cell: LoadedCell,
        loops: list[VelocityLoop],
        model: Estimate,
        planned: MotionSamples,
    ) -> None:
        random = np.random.default_rng(4)
        rows, sigma, periods = planned.samples_per_period or 0, 1e-5, 6
        last = int(np.flatnonzero(planned.phase == Phase.MAIN)[-1]) + 1
        for size, finished in ((0.0, True), (3e-5, False)):
            wave = size * np.sin(2.0 * np.pi * np.arange(rows) / rows * 3.0)[:, np.newaxis]
            noise = sigma / np.sqrt(periods) * random.normal(size=(rows, 3))
            measured = RepeatedError(
                joint_names=planned.joint_names,
                sample_period_s=planned.sample_period_s,
                rows=slice(last - rows, last),
                error=wave + noise,
                bin_variance=np.full((rows // 2 + 1, 3), sigma**2 / periods / rows),
                periodic=True,
                repetitions=periods,
            )
            found = refinement(planned, measured, model, loops, cell.config.position_gain_per_s)
            assert found.finished == finished

    def test_the_bound_grows_with_the_uncertainty_and_narrows_the_band(
        self, loops: list[VelocityLoop], model: Estimate, planned: MotionSamples
    ) -> None:
        smooth = without_jumps(model)
        bounds = [
            stability_bound(
                planned,
                smooth,
                [replace(loop, covariance=size**2 * loop.covariance) for loop in loops],
                15.0,
            )
            for size in (1.0, 3.0, 8.0)
        ]
        low = [bound.rho[bound.frequency_hz < 2.0].max() for bound in bounds]
        assert low[0] < low[1] < low[2]
        assert bounds[0].band_hz >= bounds[1].band_hz >= bounds[2].band_hz
        hopeless = [replace(loop, covariance=1e6 * loop.covariance) for loop in loops]
        with raises_code(DataQualityError, "RID-LOOP-WEAK", "axis3", "223%"):
            stability_bound(planned, smooth, hopeless, 15.0)
        # The message states the lowest frequency with an unsafe bound, and the bound there.
        uncertain = [replace(loop, covariance=50.0**2 * loop.covariance) for loop in loops]
        with raises_code(DataQualityError, "RID-LOOP-WEAK", "axis1", "91%", "0.14 Hz"):
            stability_bound(planned, smooth, uncertain, 15.0)


def test_invalid_repetitions_are_refused(
    cell: LoadedCell, drive: Drive, planned: MotionSamples, path: MotionSamples
) -> None:
    recording = drive(path, 1)
    with raises_code(DataQualityError, "RID-REFINE-RUNS"):
        repeated_error(cell.robot, path, [recording])
    torn = replace(recording, valid=np.arange(len(recording)) % 3 > 0)
    lost = str(np.count_nonzero(~torn.valid))
    with raises_code(DataQualityError, "RID-RECORDING-ROWS-LOST", lost):
        repeated_error(cell.robot, path, [recording, torn])
    circle = drive(planned, 1)
    with raises_code(DataQualityError, "RID-REFINE-RUNS", "2 runs"):
        repeated_error(cell.robot, planned, [circle, circle])


def test_a_torque_beyond_the_limit_is_refused_with_the_segment(
    cell: LoadedCell, model: Estimate, path: MotionSamples
) -> None:
    refuse_torque(SPLINE, path, model, cell.robot)
    joint = cell.robot.joints[2]
    weak = joint.model_copy(update={"limits": joint.limits.model_copy(update={"torque": 20.0})})
    robot = cell.robot.model_copy(update={"joints": (*cell.robot.joints[:2], weak)})
    where = ("segments 1 and 2", " mm ", "'axis3'", "is 20")
    with raises_code(LimitError, "RID-MOTION-LIMIT", *where):
        refuse_torque(SPLINE, path, model, robot)
