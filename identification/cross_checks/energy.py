"""Base parameters from the energy theorem, which needs no acceleration (2.1, 2.2).

The work of the actuators over an interval is the change of kinetic energy, plus the work against
gravity and springs, plus the work of friction. This gives one equation per interval for the whole
robot, which is less information than the torques contain. The method uses neither accelerations nor
the equations of motion, and therefore tests both (Gautier and Khalil 1988, Kozlowski 1998).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from config.arrays import FloatArray, IntArray
from config.errors import EstimationError
from dynamics.model.memory import with_presliding_history
from identification.equations.time_domain import TimeRun
from identification.estimation.estimate import Estimate
from identification.model.torque_columns import torque_columns
from identification.regression.intervals import Cluster, jackknife
from identification.regression.least_squares import Triangle, solve

INTERVAL_S = 0.1


def estimate_by_energy(
    estimate: Estimate, runs: tuple[TimeRun, ...]
) -> tuple[FloatArray, FloatArray]:
    """Estimate the base parameters of a model from work and energy.

    Args:
        estimate: The model, and the size of each joint's residuals, which weights the intervals.
        runs: The recordings; their accelerations are not used.

    Returns:
        `values`, shape (b,). Base parameters.
        `covariance`, shape (b, b). Cluster-robust covariance from residuals of any colour; see
        `identification.regression.intervals`.

    Raises:
        EstimationError: The motion does not determine the parameters this way, or the gears have
            losses, which the theorem does not contain.
    """
    if estimate.model.transmission.losses:
        raise EstimationError(
            "the energy method does not model gear losses: remove the friction term `load` and"
            " the gear efficiencies from the model",
            code="RID-MODEL-LOAD-FRICTION",
        )
    triangle = Triangle.empty(len(estimate.base))
    for matrix, work, _ in _intervals(estimate, runs):
        triangle = triangle.add(matrix, work)
    solution = solve([triangle], [1.0], estimate.base.names)
    clusters = (
        Cluster.of(matrix[rows], work[rows] - matrix[rows] @ solution.values)
        for matrix, work, event in _intervals(estimate, runs)
        for rows in np.split(np.arange(len(work)), np.flatnonzero(np.diff(event)) + 1)
    )
    return solution.values, jackknife(solution.information, clusters).quoted


def _intervals(
    estimate: Estimate, runs: tuple[TimeRun, ...]
) -> Iterator[tuple[FloatArray, FloatArray, IntArray]]:
    """Yield the energy equations of each segment: matrix, work and events of its intervals.

    The matrix (intervals, b) and the work (intervals,) are divided by the work's noise. An interval
    belongs to the event (`TimeRun.event`) in which it starts.
    """
    for run in runs:
        event, signals = run.event, run.signals
        known = with_presliding_history(
            estimate.model, signals.position, run.conditions, signals.segment
        )
        run = replace(run, conditions=known)
        for number in range(int(run.signals.segment[-1]) + 1):
            rows = np.flatnonzero(run.signals.segment == number)
            step_s = run.signals.sample_period_s
            stride = max(1, round(INTERVAL_S / step_s))
            if len(rows) <= stride:
                continue
            energy, work, heat = _energies(estimate, run, slice(rows[0], rows[-1] + 1))
            edges = np.arange(0, len(rows), stride)
            sigma = np.sqrt(np.diff(heat[edges]))
            sigma = np.maximum(sigma, 1e-3 * float(np.sqrt(np.mean(sigma**2))) + 1e-150)
            yield (
                np.diff(energy[edges], axis=0) / sigma[:, np.newaxis],
                np.diff(work[edges]) / sigma,
                event[rows[edges[:-1]]],
            )


def _energies(
    estimate: Estimate, run: TimeRun, rows: slice
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return energy columns, the actuators' work and the noise weight, from the first row on.

    The energy has a column per base parameter, for the value 1: kinetic energy, plus the work
    against gravity, springs and friction. The noise weight is the cumulative sum of (speed times
    residual torque)^2; its increase over an interval is proportional to the variance of the work.

    Kinetic energy is half the product of velocity and momentum. The momentum M v is the torque at
    standstill with the acceleration v, minus the torque without acceleration.
    """
    from scipy.integrate import cumulative_simpson  # a large import, which few estimates need

    model, base, signals = estimate.model, estimate.base, run.signals
    q, v = signals.position[rows], signals.velocity[rows]
    rest, conditions = np.zeros_like(q), run.conditions.part(rows)
    speed = model.actuator_speed(v)
    still = torque_columns(model, base, (q, rest, rest), conditions)
    momentum = torque_columns(model, base, (q, rest, v), conditions) - still
    friction = model.parameter_groups.get("friction", slice(0, 0))
    rubs = np.isin(base.kept, np.arange(len(base.standard_names))[friction])
    rubbing = torque_columns(model, base, (q, v, rest), conditions)
    force = np.where(rubs, rubbing, still)
    power = np.einsum("sj,sjb->sb", speed, force)
    kinetic = 0.5 * np.einsum("sj,sjb->sb", speed, momentum)
    step_s = signals.sample_period_s
    taken = cumulative_simpson(power, dx=step_s, axis=0, initial=0.0)
    done = cumulative_simpson(np.sum(speed * signals.torque_nm[rows], axis=1), dx=step_s, initial=0)
    noise = np.sum((speed * estimate.residual_nm) ** 2, axis=1)
    return kinetic + taken, np.asarray(done), np.cumsum(noise)
