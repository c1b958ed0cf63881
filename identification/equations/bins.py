"""`BinEquations`: one mean period as equations on its DFT bins, both sides limited to one band.

The measured torques are known on the bins up to a band limit (above it they fold back and vanish
in the anti-alias filter). The model's torques are not limited so: sign(v) jumps between samples.
So the regressor is evaluated on a finer grid and projected on the same bins as the torques.
Where a joint passes standstill its friction is not sign(v): there its torque is left free, by a
few columns of its own that the fit does not get to explain anything else with.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.signals.bins import Derivatives, differentiate_on_bins, filter_response, to_bins
from config.arrays import BoolArray, FloatArray
from config.cell.cell import ButterworthFilter
from config.errors import EstimationError
from dynamics.model.memory import friction_known, sliding, with_memory
from dynamics.model.robot_model import RobotModel
from dynamics.model.standstill import moving
from dynamics.terms.conditions import Conditions
from identification.equations.base_wrench import (
    BaseWrenchEquations,
    base_wrench_equations,
    both_parts,
    delay_rows,
    in_time,
    real_rows,
    smooth_bins,
)
from identification.model.base_parameters import BaseParameters
from identification.model.torque_columns import torque_columns, wrench_columns

NYQUIST_FRACTION = 0.8
MOTION_BANDS = 1.5
GRID_STEP_S = 0.001
BLOCK_ROWS = 2048
PIECES_PER_RESOLUTION = 8


@dataclass(frozen=True, eq=False)
class BinEquations:
    """Equations rhs = matrix beta + free noise of one mean period.

    The 2 H + 1 rows of a joint are the real parts of bins 0 to H and the imaginary parts of bins 1
    to H; all but the first times sqrt(2), so that the sum of squares is the mean square over time.

    Attributes:
        harmonics: The highest bin, H.
        period_s: The period [s].
        matrix: Shape (n, 2 H + 1, b or b + s). Base regressor of each joint on the bins, and slopes
            where they were asked for.
        rhs: Shape (n, 2 H + 1). Torque with the anti-alias filter divided out [N m or N].
        free: Tuple of ndarray, n of shape (2 H + 1, any). Columns of each joint's torque that stay
            free: passages of standstill.
        left_out_fraction: Shape (n,). Share of the period that those passages take.
        torque_sigma: Shape (n, 2 H + 1). Standard deviation of each row by the torque noise between
            periods [N m or N].
        position_sigma: Shape (n, H + 1). The same of the mean position's bins [rad or m].
        reaction: The equations of a force plate, where there was one.
    """

    harmonics: int
    period_s: float
    matrix: FloatArray
    rhs: FloatArray
    free: tuple[FloatArray, ...]
    left_out_fraction: FloatArray
    torque_sigma: FloatArray
    position_sigma: FloatArray
    reaction: BaseWrenchEquations | None = None

    def delayed(self, delay_s: FloatArray) -> BinEquations:
        """Return the equations where joints' torques were late by `delay_s` (n,), made up for."""
        return replace(self, rhs=in_time(self.rhs, self.period_s, delay_s[:, np.newaxis]))

    def delay_columns(self, predicted: FloatArray) -> FloatArray:
        """Return how rows (n, 2 H + 1) change per second of each joint's delay, (n, 2 H + 1, n)."""
        late = delay_rows(predicted, self.period_s)
        return np.asarray(late[:, :, np.newaxis] * np.eye(len(late))[:, np.newaxis])

    def to_time(self, rows: FloatArray, samples: int) -> FloatArray:
        """Return one period of (samples, n) values from rows of shape (n, 2 H + 1)."""
        time = np.arange(samples) / samples * self.period_s
        return np.asarray(_projection(time, self.period_s, self.harmonics).T @ rows.T)


def bin_equations(
    model: RobotModel,
    base: BaseParameters,
    average: PeriodAverage,
    *,
    band_hz: float,
    standstill_rad_s: float,
    payload: bool = False,
    standard: FloatArray | None = None,
    plate: bool = False,
) -> BinEquations:
    """Set up the equations of one mean period.

    Args:
        model, base: The model and what of it can be identified.
        average: The measurement.
        band_hz: Highest frequency used; less where the sampling or the anti-alias filter ends
            before.
        standstill_rad_s: Below this speed a joint's friction is left free; 0 trusts sign(v)
            everywhere.
        payload: Whether the run carried the unknown payload.
        standard: Shape (p,). Where to linearise the nonlinear parameters; see `torque_columns`.
        plate: Whether the equations of the force plate are wanted too.

    Raises:
        EstimationError: The joints are not the model's, or the band holds no bin.
    """
    if average.joint_names != model.joint_names:
        raise EstimationError(
            f"the recording has joints {', '.join(average.joint_names)}, the model"
            f" {', '.join(model.joint_names)}: use the recording's own robot",
            code="RID-ROBOT-OTHER",
        )
    harmonics = harmonics_below(
        band_hz, average.period_s, average.sample_period_s, average.torque_filter
    )
    q, v, a = _motion(average, harmonics)
    period_s = average.period_s
    times = np.arange(len(q)) / len(q) * period_s
    width = len(base) + (0 if standard is None else len(model.nonlinear_names))
    shape = (len(model.joint_names), 2 * harmonics + 1, width)
    matrix = np.zeros(shape)
    measured = average.reaction if plate else None
    wrench_matrix = np.zeros((0 if measured is None else 6, *shape[1:]))
    warmth = Conditions(temperature_k=average.temperature_k, payload=payload)
    conditions = with_memory(model, q, warmth, periodic=True)
    for start in range(0, len(q), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        motion = (q[rows], v[rows], a[rows])
        projection = _projection(times[rows], period_s, harmonics) / len(q)
        there = conditions.part(rows)
        matrix += _on_bins(projection, torque_columns(model, base, motion, there, standard))
        if measured is not None:
            wrench_matrix += _on_bins(
                projection, wrench_columns(model, base, motion, there, standard)
            )

    frequency_hz = np.arange(harmonics + 1) / period_s
    response = np.ones(harmonics + 1, dtype=complex)
    if average.torque_filter is not None:
        response = filter_response(average.torque_filter, frequency_hz)
    torque = to_bins(average.torque_nm, harmonics) / response[:, np.newaxis]
    gain = np.abs(response)[:, np.newaxis]
    sigma = np.sqrt(_smooth_variance(average.torque_bin_variance, average.periods_kept))
    slow = ~friction_known(conditions, moving(model, v, standstill_rad_s))
    return BinEquations(
        harmonics=harmonics,
        period_s=period_s,
        matrix=matrix,
        rhs=real_rows(torque).T,
        free=tuple(_free_columns(slow[:, j], period_s, harmonics) for j in range(q.shape[1])),
        left_out_fraction=slow.mean(axis=0),
        torque_sigma=both_parts(sigma[: harmonics + 1] / gain).T,
        position_sigma=_position_sigma(average)[: harmonics + 1].T,
        reaction=(
            None
            if measured is None
            else base_wrench_equations(
                measured, average.periods_kept, average.sample_period_s, wrench_matrix
            )
        ),
    )


def counted_samples(
    model: RobotModel, average: PeriodAverage, band_hz: float, standstill_rad_s: float
) -> BoolArray:
    """Return at which samples of a mean period `bin_equations` counts each joint, (samples, n).

    At the others the joint's torque is left free.
    """
    q, v = mean_motion(average, band_hz)
    warmth = Conditions(temperature_k=average.temperature_k)
    conditions = with_memory(model, q, warmth, periodic=True)
    finer = len(q) // average.samples_per_period
    return np.asarray(friction_known(conditions, moving(model, v, standstill_rad_s))[::finer])


def with_free_reversals(
    equations: BinEquations, model: RobotModel, average: PeriodAverage, standstill_rad_s: float
) -> BinEquations:
    """Return equations that leave a joint's torque free until the whole of the joint slides.

    Where friction has memory that is until nothing of the last reversal is left, so that it does
    not matter how exactly friction turns round; elsewhere nothing changes.

    Args:
        equations: The equations of a mean period.
        model: Their model.
        average: The measurement.
        standstill_rad_s: Below this speed a joint does not slide.
    """
    q, v, _ = _motion(average, equations.harmonics)
    conditions = with_memory(model, q, periodic=True)
    held = ~sliding(conditions, moving(model, v, standstill_rad_s))
    period_s, harmonics = equations.period_s, equations.harmonics
    return replace(
        equations,
        free=tuple(_free_columns(own, period_s, harmonics) for own in held.T),
        left_out_fraction=held.mean(axis=0),
    )


def mean_motion(average: PeriodAverage, band_hz: float) -> tuple[FloatArray, FloatArray]:
    """Return positions and velocities of a mean period, (samples, n) [rad or m, per s]."""
    harmonics = harmonics_below(
        band_hz, average.period_s, average.sample_period_s, average.torque_filter
    )
    return _motion(average, harmonics)[:2]


def _motion(average: PeriodAverage, harmonics: int) -> Derivatives:
    """Return the motion of a mean period on a fine grid.

    Products of angles and accelerations from above the band reach down into it.
    """
    limit = math.floor(NYQUIST_FRACTION * 0.5 * average.samples_per_period)
    of_motion = max(harmonics, min(math.ceil(MOTION_BANDS * harmonics), limit))
    oversampling = max(2, math.ceil(average.sample_period_s / GRID_STEP_S))
    return differentiate_on_bins(
        average.position, average.sample_period_s, of_motion, oversampling=oversampling
    )


def harmonics_below(
    band_hz: float,
    period_s: float,
    sample_period_s: float,
    torque_filter: ButterworthFilter | None,
) -> int:
    """Return the highest bin that the band, the sampling and the filter allow.

    Raises:
        EstimationError: The band holds no bin.
    """
    limit_hz = min(band_hz, NYQUIST_FRACTION * 0.5 / sample_period_s)
    if torque_filter is not None:
        limit_hz = min(limit_hz, torque_filter.cutoff_hz)
    harmonics = math.floor(limit_hz * period_s + 1e-9)
    if harmonics < 1:
        raise EstimationError(
            f"a band up to {limit_hz:g} Hz holds no harmonic of a period of"
            f" {period_s:g} s: raise the band limit",
            code="RID-MOTION-BAND",
        )
    return harmonics


def _projection(times: FloatArray, period_s: float, harmonics: int) -> FloatArray:
    """Return the real functions of the rows at some times, shape (2 H + 1, times)."""
    angle = 2.0 * np.pi / period_s * np.outer(np.arange(1, harmonics + 1), times)
    root = math.sqrt(2.0)
    return np.vstack([np.ones((1, len(times))), root * np.cos(angle), -root * np.sin(angle)])


def _on_bins(projection: FloatArray, columns: FloatArray) -> FloatArray:
    """Return columns (samples, outputs, any) on the rows of a projection, (outputs, rows, any)."""
    projected = projection @ columns.reshape(len(columns), -1)
    return np.asarray(projected.reshape(-1, *columns.shape[1:]).transpose(1, 0, 2))


def _smooth_variance(variance: FloatArray, periods: int) -> FloatArray:
    """Return the variance of the mean's bins, each at least the average of its neighbourhood.

    A bin's own variance comes from few periods and scatters; one that stands out on purpose
    (friction that drifts shows on the motion's harmonics) keeps its own.
    """
    return np.asarray(np.maximum(smooth_bins(variance), variance) / periods)


def _position_sigma(average: PeriodAverage) -> FloatArray:
    """Return the standard deviation of the mean position's bins, shape (K // 2 + 1, n).

    Quantisation repeats from period to period, so it does not show between them; it is seen as the
    floor of the mean's own spectrum, in its upper half, where no joint moves.
    """
    spectrum = np.abs(np.fft.rfft(average.position, axis=0) / len(average.position)) ** 2
    floor = np.median(spectrum[len(spectrum) // 2 :], axis=0) / math.log(2.0)
    between = _smooth_variance(average.position_bin_variance, average.periods_kept)
    return np.asarray(np.sqrt(np.maximum(between, floor)))


def _free_columns(slow: BoolArray, period_s: float, harmonics: int) -> FloatArray:
    """Return columns (2 H + 1, any) that span any torque during the slow passages.

    A passage is cut in pieces much shorter than the band can resolve, so that it does not matter
    where in a piece the friction changes its sign.
    """
    samples = len(slow)
    if not slow.any():
        return np.zeros((2 * harmonics + 1, 0))
    if slow.all():
        return np.eye(2 * harmonics + 1)
    start = int(np.argmin(slow))  # begin where the joint moves, so that no passage wraps around
    edges = np.flatnonzero(np.diff(np.roll(slow, -start).astype(np.int8), append=0))
    step_s = period_s / samples
    columns: list[FloatArray] = []
    for first, last in zip(edges[::2] + 1, edges[1::2] + 1, strict=True):
        resolved = (last - first) * step_s * 2.0 * harmonics / period_s
        pieces = max(2, math.ceil(PIECES_PER_RESOLUTION * resolved))
        for piece in np.array_split(np.arange(first, last) + start, pieces):
            if len(piece):
                basis = _projection(piece * step_s, period_s, harmonics)
                columns.append(basis.sum(axis=1) / samples)
    return np.column_stack(columns)
