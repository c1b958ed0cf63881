"""Base parameters from an extended Kalman filter that simulates the robot and corrects itself.

The measured torques drive a simulation of the robot. If the measured positions differ, positions,
speeds and base parameters are corrected together (Gautier and Poignet 2001). The method
differentiates no signal, uses forward dynamics instead of inverse dynamics, and updates the
parameters sample by sample.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import BoolArray, FloatArray
from config.errors import EstimationError
from dynamics.model.inverse_dynamics import torque_derivatives
from dynamics.model.standstill import standstill_speed as standstill_of
from dynamics.terms.conditions import Conditions
from identification.equations.parallel_filter import ParallelFilter
from identification.equations.time_domain import TimeRun
from identification.estimation.estimate import Estimate
from identification.model.torque_columns import torque_columns

PASSES: Final = 2
FORGETTING: Final = 10.0
POSITION_SIGMA: Final = 1e-4
SPEED_SIGMA: Final = 1e-2


def estimate_by_kalman_filter(
    estimate: Estimate, runs: tuple[TimeRun, ...]
) -> tuple[FloatArray, FloatArray]:
    """Estimate the base parameters of a model with an extended Kalman filter.

    The filter starts at the estimate, with ten times the sum of its two covariances. It processes
    the recordings twice, the second time with ten times its own covariance, so that the start has
    little effect. From a more distant start it can fail to converge, because light wrists with
    friction make the simulation stiff.

    If a joint sticks at a reversal, the model does not know its friction, and the filters of the
    torque spread this friction over the neighbouring rows. Therefore the filter assumes a large
    uncertainty of the torque in these rows.

    Args:
        estimate: The model, and the size of each joint's residuals, which is the torques' noise.
        runs: The recordings. Of their motion, only the positions are used, and the velocities of
            each segment's first row.

    Returns:
        `values`, shape (b,). Base parameters.
        `covariance`, shape (b, b). The filter's own covariance, which assumes white noise,
        multiplied by the ratio of cluster-robust to white covariance of the estimate.

    Raises:
        EstimationError: The gears have losses, or the simulated robot diverges from the measured
            motion.
    """
    if estimate.model.transmission.losses:
        raise EstimationError(
            "the Kalman filter does not model gear losses: remove the friction term `load` and"
            " the gear efficiencies from the model",
            code="RID-MODEL-LOAD-FRICTION",
        )
    values = estimate.values
    covariance = estimate.covariance_jackknife + estimate.covariance_residual
    simulations = [
        _Simulation(
            estimate,
            replace(run, signals=_as_recorded(run.signals)),
            _known_friction(estimate, run),
        )
        for run in runs
    ]
    for _ in range(PASSES):
        covariance = FORGETTING * covariance
        for run, simulation in zip(runs, simulations, strict=True):
            for segment in range(int(run.signals.segment[-1]) + 1):
                rows = np.flatnonzero(run.signals.segment == segment)
                with np.errstate(over="ignore", invalid="ignore"):
                    values, covariance = simulation.filter_segment(rows, values, covariance)
    white, clustered = (
        np.diagonal(estimate.covariance_residual),
        np.diagonal(estimate.covariance_jackknife),
    )
    colour = np.sqrt(np.maximum(clustered / white, 1.0))
    return values, np.asarray(covariance * np.outer(colour, colour))


def _known_friction(estimate: Estimate, run: TimeRun) -> BoolArray:
    """Return True for each row and joint away from standstill and reversals, (rows, n)."""
    shared = ParallelFilter(run.signals)
    conditions = shared.conditions(estimate.model, run.conditions)
    return shared.usable_rows(estimate.model, conditions, estimate.standstill_rad_s)[0]


def _as_recorded(signals: SmoothedSignals) -> SmoothedSignals:
    """Return signals with positions and torques that are not low-passed, if these are known.

    Friction jumps when a joint reverses. The simulation reproduces this jump, but a low-passed
    torque does not contain it.
    """
    source, rows = signals.unfiltered, signals.unfiltered_row
    if source is None or rows is None:
        return signals
    from scipy import ndimage  # a large import that only this method needs

    width = max(1, round(signals.sample_period_s / source.sample_period_s))
    mean_nm = ndimage.uniform_filter1d(source.torque_nm, width, axis=0, mode="nearest")
    return replace(
        signals,
        position=source.position[rows],
        velocity=source.velocity[rows],
        torque_nm=mean_nm[rows],
    )


@dataclass(frozen=True, eq=False)
class _Simulation:
    """One recording, simulated from measured torques; the state is q, v and the parameters.

    Attributes:
        estimate, run: The model, and the recording.
        known: Shape (rows, n). True for rows at which a joint's friction is known.
    """

    estimate: Estimate
    run: TimeRun
    known: BoolArray

    def filter_segment(
        self, rows: np.ndarray, values: FloatArray, covariance: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Process one segment; return the parameters and their covariance at its end."""
        signals, n, b = self.run.signals, self.estimate.model.chain.n, len(values)
        # Variance of white noise per sample with the same information as the noise inside the band.
        per_sample = 1.0 / (2.0 * signals.cutoff_hz * signals.sample_period_s)
        noise = per_sample * POSITION_SIGMA**2 * np.eye(n)
        state = np.concatenate([signals.position[rows[0]], signals.velocity[rows[0]], values])
        spread = np.zeros((2 * n + b, 2 * n + b))
        spread[: 2 * n, : 2 * n] = np.diag([POSITION_SIGMA**2] * n + [SPEED_SIGMA**2] * n)
        spread[2 * n :, 2 * n :] = covariance
        loudest = np.sqrt(np.mean(signals.torque_nm[rows] ** 2, axis=0))
        for row, following in pairwise(rows):
            try:
                state, slope, entry = self._predict_state(row, following, state, loudest)
                spread = slope @ spread @ slope.T + per_sample * entry @ entry.T
                gain = np.linalg.solve(spread[:n, :n] + noise, spread[:n]).T
            except (np.linalg.LinAlgError, FloatingPointError):
                raise EstimationError(
                    "the robot that the Kalman filter simulates diverges at"
                    f" {signals.time_s[row]:.3g} s: the model does not fit the recording",
                    code="RID-MODEL-MISFIT",
                ) from None
            state = state + gain @ (signals.position[following] - state[:n])
            rest = np.eye(2 * n + b)
            rest[:, :n] -= gain
            spread = rest @ spread @ rest.T + gain @ noise @ gain.T  # Joseph's form
            spread = 0.5 * (spread + spread.T)
        return state[2 * n :], spread[2 * n :, 2 * n :]

    def _predict_state(
        self, row: int, following: int, state: FloatArray, loudest: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the next state (Heun's method), and its derivatives.

        The derivatives are those with respect to the present state, and to the torques, which are
        multiplied by the torques' standard deviations.
        """
        signals, model = self.run.signals, self.estimate.model
        n, step_s = model.chain.n, signals.sample_period_s
        q, v, beta = state[:n], state[n : 2 * n], state[2 * n :]
        conditions = self.run.conditions.part(slice(row, row + 1))
        torque = signals.torque_nm[row]
        a, columns, inverse = self._acceleration(q, v, beta, torque, conditions)
        q_guess, v_guess = q + step_s * v + 0.5 * step_s**2 * a, v + step_s * a
        later = signals.torque_nm[following]
        a_then = self._acceleration(q_guess, v_guess, beta, later, conditions)[0]
        moved = np.concatenate(
            [
                q + step_s * v + step_s**2 / 6.0 * (2.0 * a + a_then),
                v + 0.5 * step_s * (a + a_then),
                beta,
            ]
        )
        # Near standstill the slope of friction is unbounded: use the slope at the standstill speed.
        standstill = standstill_of(model, self.estimate.standstill_rad_s)
        lively = np.copysign(np.maximum(np.abs(v), standstill), v)
        motion = (q[np.newaxis], lively[np.newaxis], a[np.newaxis])
        standard = self.estimate.base.to_standard(beta)
        by_q, by_v, _ = torque_derivatives(model, *motion, standard, conditions)
        by_state = -inverse @ np.hstack([by_q[0], by_v[0], columns])
        slope = np.eye(len(state))
        slope[:n, n : 2 * n] += step_s * np.eye(n)
        slope[:n] += 0.5 * step_s**2 * by_state
        slope[n : 2 * n] += step_s * by_state
        # At standstill friction can have any value, so the joint's torque has a large uncertainty.
        slow = np.abs(model.actuator_speed(v[np.newaxis])[0]) < standstill
        slow |= ~(self.known[row] & self.known[following])
        sigma = np.where(slow, loudest, 0.0)
        sigma = np.maximum(sigma, self.estimate.residual_nm)
        entry = np.zeros((len(state), n))
        entry[:n], entry[n : 2 * n] = 0.5 * step_s**2 * inverse, step_s * inverse
        return moved, slope, entry * sigma

    def _acceleration(
        self,
        q: FloatArray,
        v: FloatArray,
        beta: FloatArray,
        torque: FloatArray,
        conditions: Conditions,
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the acceleration (n,), the regressor (n, b), and the inverse inertia (n, n)."""
        n = len(q)
        warmth = conditions.temperature_k
        repeated = None if warmth is None else np.tile(np.atleast_2d(warmth)[0], (n + 2, 1))
        poses = np.tile(q, (n + 2, 1))
        speeds, accelerations = np.zeros((2, n + 2, n))
        speeds[0], accelerations[2:] = v, np.eye(n)
        all_columns = torque_columns(
            self.estimate.model,
            self.estimate.base,
            (poses, speeds, accelerations),
            Conditions(repeated, payload=conditions.payload),
        )
        by_acceleration = all_columns[2:] - all_columns[1]
        inverse = np.linalg.pinv((by_acceleration @ beta).T)
        a = inverse @ (torque - all_columns[0] @ beta)
        columns = all_columns[0] + np.einsum("j,jib->ib", a, by_acceleration)
        return a, columns, inverse
