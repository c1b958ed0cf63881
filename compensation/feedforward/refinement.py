"""Refinement of a feedforward over repetitions: each run corrects the error of the previous run.

q_d is the desired motion, q the actual motion, and e = q_d - q the error. K_v is the gain of the
position loop, v_ff the feedforward, R the transmission of commands, and G_c the velocity loop. At
the angular frequency w, the command R (K_v e + v_ff) reached the drive. According to the model, q
needs the command jw q + G_c^-1 tau(q), and q_d needs jw q_d + G_c^-1 tau(q_d). The difference of
these two is added to the next command:

    v_ff' = v_ff + K_v e + (jw e + G_c^-1 (tau(q_d) - tau(q))) / R .

With an exact model one repetition would be enough. With a real model, each repetition multiplies
the error by

    rho(w) = |1 - L(w) / L_true(w)| ,   L = R K_v + jw + G_c^-1 (jw f_v - w^2 M) ,

with the viscous friction f_v and the inertia M. The error decreases if rho < 1 (Bristow, Tharayil
and Alleyne 2006). `stability_bound` computes the largest rho at each frequency, for loops and
inertias at the edges of their 95 % confidence regions, at the poses with the smallest and the
largest inertia.

With a coupled wrist, all quantities are those of the motors. The position loop of the joints then
has the same gain for the motors, because the gain is equal for all joints.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from acquisition.motion.samples import MotionSamples
from acquisition.signals.bins import from_bins, to_bins
from compensation.feedforward.inverse import append_return, inverse_response
from compensation.feedforward.repeated_error import RepeatedError
from compensation.loops.multisine_spectra import interpolation_response
from compensation.loops.velocity_loop import VelocityLoop
from config.arrays import FloatArray
from config.errors import DataQualityError
from config.robot.wrist_coupling import convert_to_joints
from dynamics.model.robot_model import regressor
from dynamics.terms.friction import Friction
from dynamics.terms.friction_functions import traits
from identification.estimation.estimate import Estimate, predict

Complex = NDArray[np.complex128]

LARGEST_RHO: Final = 0.8
LOWEST_BAND_HZ: Final = 0.5
BAND_SHARE: Final = 0.2
FULL_SHARE: Final = 0.8
DRAWS: Final = 400
POSES: Final = 24
SIGMAS_OF_NOISE: Final = 3.0
SMALL_STEP: Final = 1e-3
_LOSSES: Final = ("cl_", "eta_")


@dataclass(frozen=True, eq=False)
class StabilityBound:
    """Upper bound of the fraction of an error that remains after one repetition.

    Attributes:
        frequency_hz: Shape (lines,). Frequencies of the bound [Hz].
        rho: Shape (lines, n). Largest |1 - L / L_true| found for loops and inertias at the edges of
            their 95 % confidence regions.
        band_hz: Upper end of the refined band [Hz]; up to this frequency `rho` is at most 0.8 in
            every joint.
    """

    frequency_hz: FloatArray
    rho: FloatArray
    band_hz: float

    @property
    def largest(self) -> FloatArray:
        """Largest bound of each joint in the band, shape (n,)."""
        return np.asarray(self.rho[self.frequency_hz <= self.band_hz].max(axis=0))


@dataclass(frozen=True, eq=False)
class Refinement:
    """One step of refinement.

    Attributes:
        correction: Shape (samples, n). Joint speeds to add to the feedforward in the rows of the
            error [rad/s or m/s].
        bound: Convergence bound of this step.
        over_noise: Shape (n,). Power of the mean error divided by the power of the noise, both in
            the lower 80 % of the refined band.
        noise_limit: Ratio up to which the error is indistinguishable from noise.
    """

    correction: FloatArray
    bound: StabilityBound
    over_noise: FloatArray
    noise_limit: float

    @property
    def finished(self) -> bool:
        """True if the remaining error is noise in every joint."""
        return bool((self.over_noise <= self.noise_limit).all())


def refinement(
    samples: MotionSamples,
    measured: RepeatedError,
    estimate: Estimate,
    loops: Sequence[VelocityLoop],
    gain_per_s: float,
) -> Refinement:
    """Return the correction of a feedforward after repetitions of a motion.

    Args:
        measured: Error that remained in the repetitions.
        estimate: Model of the robot.
        loops: Velocity loops, one per motor, base to flange.
        gain_per_s: K_v of the position loop [1/s].

    Raises:
        DataQualityError: The loops are too uncertain for a safe refinement.
    """
    step_s = samples.sample_period_s
    smooth = without_jumps(estimate)
    bound = stability_bound(samples, smooth, loops, gain_per_s)
    error = measured.error if measured.periodic else append_return(measured.error, step_s)
    rows = len(error)
    highest = (rows - 1) // 2
    frequency_hz = np.arange(highest + 1) / (rows * step_s)
    bins = to_bins(error, highest)
    noise = measured.bin_variance[: highest + 1]
    inside = frequency_hz <= FULL_SHARE * bound.band_hz
    power = np.square(np.abs(bins))
    lines = int(inside.sum())
    over_noise = power[inside].sum(axis=0) / np.maximum(noise[inside].sum(axis=0), 1e-300)
    limit = 1.0 + SIGMAS_OF_NOISE * math.sqrt((1.0 + 1.0 / (measured.repetitions - 1)) / lines)
    # Wiener filter: a line that is mostly noise is hardly corrected.
    share = np.maximum(0.0, 1.0 - noise / np.maximum(power, 1e-300))
    learned = bins * share * _band_window(frequency_hz, bound.band_hz)[:, np.newaxis]
    torque = to_bins(_missing_torque(samples, measured, smooth, learned, rows), highest)
    reach = interpolation_response(frequency_hz, step_s)
    omega = 2.0 * math.pi * frequency_hz
    more = np.empty_like(learned)
    for j, loop in enumerate(loops):
        missed = 1j * omega * learned[:, j] + inverse_response(loop, frequency_hz) * torque[:, j]
        more[:, j] = gain_per_s * learned[:, j] + missed / reach
    more *= _band_window(frequency_hz, bound.band_hz)[:, np.newaxis]
    correction = convert_to_joints(estimate.robot, from_bins(more, rows)[: len(measured.error)])
    return Refinement(correction, bound, over_noise, limit)


def stability_bound(
    samples: MotionSamples, smooth: Estimate, loops: Sequence[VelocityLoop], gain_per_s: float
) -> StabilityBound:
    """Return the convergence bound of refinement for loops of known uncertainty.

    Raises:
        DataQualityError: Below 0.5 Hz, more than 80 % of an error could remain after a repetition.
    """
    step_s = samples.sample_period_s
    frequency_hz = np.geomspace(0.1, BAND_SHARE / step_s, 120)
    inertia, spread, viscous = _inertia_and_friction(samples, smooth)
    reach = interpolation_response(frequency_hz, step_s)
    s = 2j * math.pi * frequency_hz
    rho = np.zeros((len(frequency_hz), len(loops)))
    for j, loop in enumerate(loops):
        likely = _loops_in_interval(loop)
        for pose in (int(inertia[:, j].argmin()), int(inertia[:, j].argmax())):
            mass = inertia[pose, j]
            load = s * viscous[j] + s**2 * mass
            ours = reach * gain_per_s + s + inverse_response(loop, frequency_hz) * load
            for other, sign in product(likely, (-2.0, 2.0)):
                there = load + s**2 * sign * spread[pose, j]
                true = reach * gain_per_s + s + inverse_response(other, frequency_hz) * there
                rho[:, j] = np.maximum(rho[:, j], np.abs(1.0 - ours / true))
    unsafe = np.asarray((rho > LARGEST_RHO).any(axis=1))
    band_hz = float(frequency_hz[int(np.argmax(unsafe)) - 1] if unsafe.any() else frequency_hz[-1])
    if unsafe[0] or band_hz < LOWEST_BAND_HZ:
        first = int(np.argmax(unsafe))
        worst = int(rho[first].argmax())
        raise DataQualityError(
            f"the velocity loop of {loops[worst].joint_name} is too uncertain for refinement:"
            f" {rho[first, worst]:.0%} of an error at {frequency_hz[first]:.2g} Hz could remain."
            " Measure the loops again with more periods (`rid-daq loop`)",
            code="RID-LOOP-WEAK",
        )
    return StabilityBound(frequency_hz, rho, band_hz)


def without_jumps(estimate: Estimate) -> Estimate:
    """Return the model without gear losses and without friction terms that are not smooth."""
    jumping = {
        column.parameter_name
        for term in estimate.model.terms
        if isinstance(term, Friction)
        for column in term.columns
        if not traits(column.function).smooth
    }
    kept = [name not in jumping for name in estimate.base.names]
    smooth = replace(estimate, values=np.where(kept, estimate.values, 0.0))
    return _without_losses(smooth) if estimate.model.transmission.losses else smooth


def _without_losses(estimate: Estimate) -> Estimate:
    """Return a model without gear losses; losses jump when the speed changes its sign."""
    own, model = estimate.options, estimate.model
    left = np.array([not name.startswith(_LOSSES) for name in model.nonlinear_names])
    joints = tuple(
        joint.model_copy(
            update={
                "friction": tuple(term for term in joint.friction if term != "load"),
                "efficiency": None,
            }
        )
        for joint in estimate.robot.joints
    )
    terms = own.friction_terms
    return replace(
        estimate,
        robot=estimate.robot.model_copy(update={"joints": joints}),
        options=replace(
            own,
            friction_terms=None if terms is None else tuple(t for t in terms if t != "load"),
            nonlinear=tuple(model.nonlinear_values[left].tolist()) or None,
        ),
        nonlinear_covariance=estimate.nonlinear_covariance[np.ix_(left, left)],
    )


def _loops_in_interval(loop: VelocityLoop) -> list[VelocityLoop]:
    """Return loops at the edge of a fit's 95 % confidence region, in random directions."""
    if not len(loop.names):
        return [loop]
    random = np.random.default_rng(0)
    ways = random.normal(size=(DRAWS, len(loop.names)))
    ways /= np.linalg.norm(ways, axis=1, keepdims=True)
    root = np.linalg.cholesky(loop.covariance + 1e-18 * np.eye(len(loop.names)))
    reach = math.sqrt(_CHI2_95[min(len(loop.names), len(_CHI2_95)) - 1])
    return [
        loop.add(dict(zip(loop.names, step.tolist(), strict=True)))
        for step in reach * ways @ root.T
    ]


_CHI2_95: Final = (3.841, 5.991, 7.815, 9.488)


def _inertia_and_friction(
    samples: MotionSamples, smooth: Estimate
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the motors' inertias along the motion, their deviations, and viscous friction."""
    rows = np.unique(np.linspace(0, len(samples) - 1, POSES).astype(int))
    q, n = samples.position[rows], len(samples.joint_names)
    rest = np.zeros_like(q)
    standing = _columns(smooth, q, rest, rest)
    inertia, spread, viscous = np.empty_like(q), np.empty_like(q), np.empty(n)
    for j in range(n):
        one = rest.copy()
        one[:, j] = 1.0
        one = convert_to_joints(smooth.robot, one)
        columns = (_columns(smooth, q, rest, one) - standing)[:, j]
        inertia[:, j] = columns @ smooth.values
        spread[:, j] = np.sqrt(
            np.einsum("sb,bc,sc->s", columns, smooth.covariance_jackknife, columns)
        )
        ahead, back = (predict(smooth, q, sign * SMALL_STEP * one, rest) for sign in (1.0, -1.0))
        viscous[j] = float(((ahead - back)[:, j] / (2.0 * SMALL_STEP)).mean())
    return inertia, spread, viscous


def _columns(estimate: Estimate, q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
    """Return the torque per base parameter, shape (samples, n, b)."""
    return np.asarray(estimate.base.columns(regressor(estimate.model, q, v, a)))


def _missing_torque(
    samples: MotionSamples, measured: RepeatedError, smooth: Estimate, learned: Complex, rows: int
) -> FloatArray:
    """Return tau(q_d) - tau(q), in which q follows from the corrected error `learned`."""
    omega = 2.0 * math.pi * np.arange(len(learned)) / (rows * samples.sample_period_s)
    slope = (1j * omega)[:, np.newaxis]
    count = len(measured.error)
    robot = smooth.robot
    e, v, a = (
        convert_to_joints(robot, from_bins(learned * slope**k, rows)[:count]) for k in range(3)
    )
    at = measured.rows
    wanted = (samples.position[at], samples.velocity[at], samples.acceleration[at])
    missed = predict(smooth, *wanted) - predict(smooth, wanted[0] - e, wanted[1] - v, wanted[2] - a)
    return missed if measured.periodic else append_return(missed, samples.sample_period_s)


def _band_window(frequency_hz: FloatArray, band_hz: float) -> FloatArray:
    """Return 1 up to `FULL_SHARE` of the band, then a smooth decrease to 0 at its end."""
    x = np.clip((frequency_hz / band_hz - FULL_SHARE) / (1.0 - FULL_SHARE), 0.0, 1.0)
    return np.asarray(1.0 - x * x * (3.0 - 2.0 * x))
