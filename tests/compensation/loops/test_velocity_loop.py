"""Velocity controllers identified from multisine motions of simulated drives and from formulas."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import control
import numpy as np
import pytest

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from benchmarks.closed_loop import closed_loop
from benchmarks.velocity_loop import Proof, prove
from compensation.loops.frequency_response import (
    Distortion,
    FrequencyResponse,
    frequency_responses,
)
from compensation.loops.loop_measurement import (
    measure_loops,
    unexplained_share,
    without_images,
)
from compensation.loops.multisine_motion import MultisineOptions, multisine_motion
from compensation.loops.multisine_spectra import interpolation_response, multisine_spectra
from compensation.loops.velocity_loop import VelocityLoop, fit_velocity_loop, whiteness
from config.errors import DataQualityError, EstimationError
from config.load import LoadedCell
from tests.builders.raised_codes import raises_code

pytestmark = pytest.mark.slow

Drive = Callable[..., Recording]
FREQUENCY_HZ = np.arange(0.5, 15.0, 0.5)


def multisine(seed: int = 0, **changes: object) -> MultisineMotion:
    joints = tuple(
        {"joint": name, "velocity": 0.03, "slow_amplitude": 0.1}
        for name in ("axis1", "axis2", "axis3")
    )
    fields = {
        "kind": "multisine",
        "robot": "ir361",
        "period_s": 4.0,
        "lowest_hz": 0.75,
        "highest_hz": 20.0,
        "realisations": 2,
        "periods": 3,
        "ramp_s": 1.0,
        "seed": seed,
        "joints": joints,
    }
    return MultisineMotion.model_validate(fields | changes)


@pytest.fixture(scope="module")
def recorded(cell: LoadedCell, drive: Drive) -> tuple[MultisineMotion, Recording]:
    motion = multisine()
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    return motion, drive(samples)


def known(response: np.ndarray, sigma: float) -> FrequencyResponse:
    """Return a measured response with equal noise on every line."""
    nothing = Distortion(np.zeros(0), np.zeros(0), np.zeros(0), np.zeros(0))
    variance = np.full(len(response), sigma**2)
    return FrequencyResponse(
        joint_name="axis1",
        frequency_hz=FREQUENCY_HZ,
        response=response,
        variance_noise=variance,
        variance=variance,
        coherence=np.ones(len(response)),
        even=nothing,
        odd=nothing,
        realisations=100,
        periods=100,
    )


def controller(gain: float, integral_s: float, delay_s: float, lag_s: float) -> np.ndarray:
    """Return the controller's response from its formula."""
    s = 2j * math.pi * FREQUENCY_HZ
    return np.asarray(
        gain * (1.0 + 1.0 / (integral_s * s)) / (1.0 + lag_s * s) * np.exp(-s * delay_s)
    )


@pytest.mark.parametrize(("delay_s", "lag_s"), [(0.0, 0.0), (0.004, 0.0), (0.0, 0.006)])
def test_intervals_cover_the_truth_and_the_correct_terms_are_chosen(
    delay_s: float, lag_s: float
) -> None:
    random = np.random.default_rng(1)
    truth = controller(500.0, 0.08, delay_s, lag_s)
    z, chosen, p_values = [], [], []
    for _ in range(60):
        noise = random.normal(size=(2, len(truth))) @ np.eye(len(truth)) / math.sqrt(2.0)
        loop = fit_velocity_loop(known(truth + 3.0 * (noise[0] + 1j * noise[1]), 3.0))
        z.append((loop.gain - 500.0) / loop.sigma["gain"])
        z.append((loop.integral_time_s - 0.08) / loop.sigma["integral_time_s"])
        chosen.append((loop.delay_s > 0.0) == (delay_s > 0.0) and (loop.lag_s > 0.0) == (lag_s > 0))
        p_values.append(loop.p_value)
    assert np.mean(np.abs(z) < 2.0) >= 0.9
    assert np.mean(np.abs(z)) > 0.5
    assert np.mean(chosen) >= 0.8
    assert 0.25 < np.mean(p_values) < 0.75


def test_a_controller_of_another_structure_has_a_small_p_value() -> None:
    resonant = controller(500.0, 0.08, 0.0, 0.0) * (1.0 + 0.5 / (1.0 + 1j * (FREQUENCY_HZ - 7.0)))
    assert fit_velocity_loop(known(resonant, 3.0)).p_value < 1e-6


@pytest.mark.parametrize(("delay_s", "lag_s"), [(0.0, 0.0), (0.0, 0.002), (0.004, 0.002)])
def test_the_transfer_function_is_the_response_without_its_delay(
    delay_s: float, lag_s: float
) -> None:
    loop = VelocityLoop("axis1", 500.0, 0.08, delay_s, lag_s, (), np.zeros((0, 0)), 1.0, ())
    whole = controller(500.0, 0.08, delay_s, lag_s)
    np.testing.assert_allclose(loop.response(FREQUENCY_HZ), whole, rtol=1e-12)
    s = 2j * math.pi * FREQUENCY_HZ
    assert isinstance(loop.transfer_function, control.TransferFunction)
    np.testing.assert_allclose(loop.transfer_function(s) * np.exp(-s * delay_s), whole, rtol=1e-12)


def test_misfits_correlated_between_neighbouring_lines_are_not_white() -> None:
    random = np.random.default_rng(2)

    def drawn() -> np.ndarray:
        return random.normal(size=40) + 1j * random.normal(size=40)

    white = [whiteness(drawn()) for _ in range(300)]
    assert 0.01 < np.mean(np.array(white) < 0.05) < 0.1
    assert whiteness(np.convolve(drawn(), np.ones(4), "valid")) < 1e-3
    assert whiteness(np.ones(2, dtype=complex)) == 1.0


def test_a_missing_filter_shows_in_p_value_and_whiteness() -> None:
    random = np.random.default_rng(3)
    notch = 1.0 - 0.05 / (1.0 + 1j * (FREQUENCY_HZ / 6.0 - 6.0 / FREQUENCY_HZ))
    noise = random.normal(size=(2, len(FREQUENCY_HZ))) @ np.eye(len(FREQUENCY_HZ))
    truth = controller(500.0, 0.08, 0.0, 0.0) * notch
    loop = fit_velocity_loop(known(truth + 2.0 * (noise[0] + 1j * noise[1]), 3.0))
    assert loop.p_value < 1e-3
    assert loop.whiteness < 1e-3


def test_one_noisy_response_in_a_hundred_is_rejected() -> None:
    """With few periods the variances are uncertain.

    The distribution of the cost must include this.
    """
    random = np.random.default_rng(4)
    truth = controller(500.0, 0.08, 0.0, 0.002)
    p_values = []
    for _ in range(80):
        draws = random.normal(size=(13, 2, len(truth)))
        samples = 10.0 * (draws[:, 0] + 1j * draws[:, 1])
        variance = np.sum(np.abs(samples[1:]) ** 2, axis=0) / 12.0
        measured = replace(
            known(truth + samples[0], 1.0),
            variance=variance,
            variance_noise=variance,
            realisations=4,
            periods=4,
        )
        p_values.append(fit_velocity_loop(measured).p_value)
    assert np.mean(np.array(p_values) < 0.01) < 0.05
    assert 0.3 < np.mean(p_values) < 0.7


@pytest.fixture(scope="module")
def proof() -> Proof:
    """Run a shorter form of `python -m benchmarks.velocity_loop`."""
    return prove(5, period_s=4.0)


@pytest.mark.long
def test_drives_are_identified_within_2_percent_and_within_two_sigma(proof: Proof) -> None:
    """The plant has a current loop, tachometer ripple, delay, rounding and all unmodelled
    effects.
    """
    assert np.abs(proof.error).max() < 0.02
    assert proof.held.min() >= 0.8
    assert np.mean(np.abs(proof.deviation)) > 0.3
    assert np.abs(proof.lag_s).max() < 2e-4
    assert np.mean(proof.p_values < 0.01) <= 0.2


def test_the_multisine_as_instrument_is_better_than_plain_spectra(proof: Proof) -> None:
    ratio = np.sqrt(np.mean(proof.peer_error**2, axis=0) / np.mean(proof.error**2, axis=0))
    assert ratio.min() > 3.0


def test_power_between_the_lines_is_distortion(
    cell: LoadedCell, recorded: tuple[MultisineMotion, Recording]
) -> None:
    """Friction is odd in speed: it makes more power on unexcited odd lines than on even lines."""
    motion, recording = recorded
    for measured in frequency_responses(recording, motion, cell.robot):
        assert measured.frd.omega == pytest.approx(2.0 * math.pi * measured.frequency_hz)
        assert (measured.coherence > 0.0).all()
        assert len(measured.odd.frequency_hz) > 4
        assert np.median(measured.odd.output) > np.median(measured.even.output)


def test_an_incomplete_realisation_is_skipped_and_the_others_keep_their_phases(
    cell: LoadedCell, recorded: tuple[MultisineMotion, Recording]
) -> None:
    motion, recording = recorded
    whole = multisine_spectra(recording, motion, cell.robot)
    assert whole.left_out == ()
    main = np.flatnonzero(recording.phase == Phase.MAIN)
    second = main[np.flatnonzero(np.diff(main) > 1)[0] + 1]
    torn = recording.valid.copy()
    torn[main[5]] = False
    late = multisine_spectra(replace(recording, valid=torn), motion, cell.robot)
    from_second = slice(second - 100, None)
    cut = replace(
        recording,
        **{
            name: getattr(recording, name)[from_second]
            for name in (
                "time_s",
                "position",
                "torque_nm",
                "valid",
                "phase",
                "sample_index",
                "target_position",
                "velocity_command",
            )
        },
    )
    for left in (late, multisine_spectra(cut, motion, cell.robot)):
        assert left.left_out == (1,)
        np.testing.assert_array_equal(left.torque[0], whole.torque[1])
        np.testing.assert_array_equal(left.reference[0][0], whole.reference[0][1])


def test_stiction_without_the_slow_sine_looks_like_a_spring(cell: LoadedCell) -> None:
    """The drive's controller is identified in both cases, the mechanics only without stiction.

    During presliding, friction acts as a spring, whose torque is opposite to that of an inertia.
    """
    assert cell.plant is not None
    inertia = {}
    for slow in (True, False):
        options = MultisineOptions(period_s=4.0, periods=2, realisations=2, slow=slow, seed=1)
        motion = multisine_motion(cell.robot, cell.config, options)
        samples = motion.plan(cell.robot, cell.config.cycle_time_s)
        recording = closed_loop(cell, cell.plant, samples, 1)
        found = measure_loops(recording, motion, cell.robot, cell.config.position_gain_per_s)
        inertia[slow] = np.array([each.mechanics.inertia for each in found.cascades])
        for axis, loop in zip(cell.plant.axes, found.loops, strict=True):
            assert loop.gain == pytest.approx(axis.velocity_gain_nm_s, rel=0.02)
    # Mass matrix of the plant in this pose, by Pinocchio.
    np.testing.assert_allclose(inertia[True], [10.98, 24.58, 3.59], rtol=0.12)
    assert (inertia[False] < 0.8 * inertia[True]).all()


def test_interpolated_commands_act_as_a_triangle_delayed_by_two_cycles() -> None:
    """Compare with sums of a sine that is sampled, sent, delayed by a cycle and interpolated."""
    step_s, fine = 0.008, 50
    frequency_hz = np.array([1.0, 7.0, 31.25])
    rows = 1000
    times = np.arange(rows * fine) * step_s / fine
    for f, expected in zip(frequency_hz, interpolation_response(frequency_hz, step_s), strict=True):
        sent = np.exp(2j * np.pi * f * np.arange(rows) * step_s)
        held = np.interp(times, (np.arange(rows) + 2) * step_s, sent)
        whole = slice(fine * 250, fine * 750)
        found = np.mean(held[whole] * np.exp(-2j * np.pi * f * times[whole]))
        assert found == pytest.approx(expected, abs=2e-3)


def test_unusable_recordings_are_refused(
    cell: LoadedCell, recorded: tuple[MultisineMotion, Recording]
) -> None:
    motion, recording = recorded
    with raises_code(DataQualityError, "RID-RUN-FOREIGN"):
        frequency_responses(replace(recording, velocity_command=None), motion, cell.robot)
    torn = recording.valid & (recording.phase != Phase.MAIN)
    with raises_code(DataQualityError, "RID-RECORDING-ROWS-LOST", "2 realisations"):
        frequency_responses(replace(recording, valid=torn), motion, cell.robot)
    few = known(controller(500.0, 0.08, 0.0, 0.0), 1.0)
    with raises_code(EstimationError, "RID-LOOP-WEAK", "axis1", "3 lines"):
        fit_velocity_loop(
            replace(
                few,
                frequency_hz=few.frequency_hz[:3],
                response=few.response[:3],
                variance=few.variance[:3],
                variance_noise=few.variance_noise[:3],
                coherence=few.coherence[:3],
            )
        )


def test_one_realisation_estimates_its_distortion_from_the_empty_lines(
    cell: LoadedCell, drive: Drive
) -> None:
    assert cell.plant is not None
    motion = multisine(realisations=1, periods=4)
    recording = drive(motion.plan(cell.robot, cell.config.cycle_time_s))
    for response in frequency_responses(recording, motion, cell.robot):
        assert np.isfinite(response.variance).all()
        assert (response.variance > response.variance_noise).all(), (
            "the arm has nonlinear distortion"
        )
    found = measure_loops(recording, motion, cell.robot, cell.config.position_gain_per_s)
    for axis, loop in zip(cell.plant.axes, found.loops, strict=True):
        assert abs(loop.gain - axis.velocity_gain_nm_s) < 2.0 * loop.sigma["gain"]
        late = abs(loop.integral_time_s - axis.velocity_integral_time_s)
        assert late < 2.0 * loop.sigma["integral_time_s"]


def test_one_realisation_without_empty_odd_lines_is_refused(cell: LoadedCell, drive: Drive) -> None:
    motion = multisine(realisations=1, grid="odd")
    recording = drive(motion.plan(cell.robot, cell.config.cycle_time_s))
    with pytest.raises(DataQualityError) as refused:
        frequency_responses(recording, motion, cell.robot)
    assert refused.value.refusal == "RID-LOOP-ONE-REALISATION"


def test_loops_faster_than_the_cycle_are_identified_without_a_torque_filter(
    cell: LoadedCell,
) -> None:
    """The sampled torque contains images of the commands at frequencies that the loop follows."""
    assert cell.plant is not None
    last = cell.plant.axes[2].model_copy(update={"velocity_gain_nm_s": 2200.0})
    truth = cell.plant.model_copy(update={"axes": (*cell.plant.axes[:2], last)})
    cell = replace(cell, config=cell.config.model_copy(update={"torque_filter": None}))
    motion = multisine_motion(cell.robot, cell.config, MultisineOptions())
    recording = closed_loop(cell, truth, motion.plan(cell.robot, cell.config.cycle_time_s), seed=1)
    loops = measure_loops(recording, motion, cell.robot, 15.0).loops
    for axis, loop in zip(truth.axes, loops, strict=True):
        assert loop.gain == pytest.approx(axis.velocity_gain_nm_s, rel=0.02)
        assert loop.integral_time_s == pytest.approx(axis.velocity_integral_time_s, rel=0.03)
        assert loop.delay_s + loop.lag_s < 0.001
        assert loop.p_value > 1e-3


def limited(recording: Recording, share: float = 0.6) -> Recording:
    """Return the recording with each torque limited to a share of its maximum."""
    limit = share * np.abs(recording.torque_nm).max(axis=0)
    return replace(recording, torque_nm=np.clip(recording.torque_nm, -limit, limit))


def before_a_filter(recording: Recording) -> Recording:
    """Return the recording with the commands before a filter of 10 ms in the drives."""
    assert recording.velocity_command is not None
    rate = np.gradient(recording.velocity_command, recording.sample_period_s or 0.0, axis=0)
    return replace(recording, velocity_command=recording.velocity_command + 0.01 * rate)


@pytest.mark.parametrize("change", [limited, before_a_filter])
def test_a_controller_that_contradicts_other_frequencies_is_refused(
    cell: LoadedCell,
    recorded: tuple[MultisineMotion, Recording],
    change: Callable[[Recording], Recording],
) -> None:
    motion, recording = recorded
    with raises_code(EstimationError, "RID-LOOP-CONTRADICTED", "axis"):
        measure_loops(change(recording), motion, cell.robot, 15.0)


def test_the_controller_explains_torques_at_lines_without_excitation(
    cell: LoadedCell, recorded: tuple[MultisineMotion, Recording]
) -> None:
    motion, recording = recorded
    spectra = multisine_spectra(recording, motion, cell.robot)
    found = measure_loops(recording, motion, cell.robot, 15.0)
    without = without_images(spectra, found.cascades)
    assert max(unexplained_share(without, loop) for loop in found.loops) < 0.02


@pytest.mark.parametrize("kind", ["zero", "noise"])
def test_a_torque_without_response_is_refused(
    cell: LoadedCell, recorded: tuple[MultisineMotion, Recording], kind: str
) -> None:
    motion, recording = recorded
    torque = recording.torque_nm.copy()
    noise = 50.0 * np.random.default_rng(1).normal(size=len(torque))
    torque[:, 1] = 0.0 if kind == "zero" else noise
    with pytest.raises((DataQualityError, EstimationError)) as refused:
        measure_loops(replace(recording, torque_nm=torque), motion, cell.robot, 15.0)
    assert refused.value.refusal in ("RID-LOOP-WEAK", "RID-LOOP-CONTRADICTED")
    assert "axis2" in str(refused.value)
