"""`BinEquations`: one mean period as equations on its DFT bins, both sides limited to one band.

The measured torques are known on the bins up to a band limit; above it, aliasing and the anti-alias
filter hide them. The model's torques are not limited to a band, because sign(v) jumps between
samples. Therefore the regressor is evaluated on a finer grid and projected on the same bins as the
torques.

Near standstill a joint's friction is not sign(v). There the joint's torque is free: additional
columns with their own unknowns represent it, so that it does not affect the estimate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from acquisition.processing.periods import PeriodAverage
from acquisition.signals.bins import Derivatives, differentiate_on_bins, filter_response, to_bins
from config.arrays import BoolArray, FloatArray
from config.cell.torque_filter import ButterworthFilter
from config.errors import EstimationError
from dynamics.model.memory import (
    samples_with_known_friction,
    sliding_samples,
    with_presliding_history,
)
from dynamics.model.robot_model import RobotModel
from dynamics.model.standstill import moving_actuators
from dynamics.terms.conditions import Conditions
from identification.equations.base_wrench import (
    BaseWrenchEquations,
    average_neighbouring_bins,
    base_wrench_equations,
    real_rows_of_bins,
    repeat_for_real_and_imaginary,
    rows_per_delay,
    without_delay,
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
    """Equations rhs = matrix beta + free torque + noise of one mean period.

    The 2 H + 1 rows of a joint are the real parts of bins 0 to H and the imaginary parts of bins 1
    to H. All rows but the first are multiplied by sqrt(2), so that the sum of squares is the mean
    square over time.

    Attributes:
        harmonics: Number of the highest bin, H.
        period_s: The period [s].
        matrix: Shape (n, 2 H + 1, b or b + s). Base regressor of each joint on the bins, and, if
            requested, the derivatives with respect to the s nonlinear parameters.
        rhs: Shape (n, 2 H + 1). Torque with the anti-alias filter divided out [N m or N].
        free: Tuple of ndarray, n of shape (2 H + 1, any). Columns of each joint's free torque near
            standstill.
        left_out_fraction: Shape (n,). Fraction of the period in which each joint's torque is free.
        torque_sigma: Shape (n, 2 H + 1). Standard deviation of each row due to the torque noise
            between periods [N m or N].
        position_sigma: Shape (n, H + 1). Standard deviation of the mean position's bins [rad or m].
        reaction: The equations of the force plate, if there is one.
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

    def compensate_delay(self, delay_s: FloatArray) -> BinEquations:
        """Return the equations with delays `delay_s` (n,) of the joints' torques compensated."""
        return replace(self, rhs=without_delay(self.rhs, self.period_s, delay_s[:, np.newaxis]))

    def without_loads(self, known: FloatArray) -> BinEquations:
        """Return the equations without known bodies, which add `known` (b,) to the parameters."""
        b, reaction = len(known), self.reaction
        if reaction is not None:
            carried = reaction.matrix[..., :b] @ known
            reaction = replace(reaction, rhs=reaction.rhs - carried)
        rhs = self.rhs - self.matrix[..., :b] @ known
        return replace(self, rhs=rhs, reaction=reaction)

    def delay_columns(self, predicted: FloatArray) -> FloatArray:
        """Return the derivative of rows (n, 2 H + 1) by each joint's delay, (n, 2 H + 1, n)."""
        late = rows_per_delay(predicted, self.period_s)
        return np.asarray(late[:, :, np.newaxis] * np.eye(len(late))[:, np.newaxis])

    def to_time(self, rows: FloatArray, samples: int) -> FloatArray:
        """Return the values (samples, n) of one period from rows of shape (n, 2 H + 1)."""
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
        model: The robot model.
        base: Its base parameters.
        average: The mean period.
        band_hz: Highest frequency used; the sampling or the anti-alias filter may lower it.
        standstill_rad_s: Below this speed a joint's torque is free; with 0, sign(v) is used
            everywhere.
        payload: True if the run carried the unknown payload.
        standard: Shape (p,). Point at which the nonlinear parameters are linearised; see
            `torque_columns`.
        plate: True to include the equations of the force plate.

    Raises:
        EstimationError: The joints are not those of the model, the band contains no bin, or the
            plate's remaining channels determine no component of the wrench.
    """
    if average.joint_names != model.joint_names:
        raise EstimationError(
            f"the recording has joints {', '.join(average.joint_names)}, but the model has"
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
    conditions = with_presliding_history(model, q, warmth, periodic=True)
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
    slow = ~samples_with_known_friction(conditions, moving_actuators(model, v, standstill_rad_s))
    return BinEquations(
        harmonics=harmonics,
        period_s=period_s,
        matrix=matrix,
        rhs=real_rows_of_bins(torque).T,
        free=tuple(_free_columns(slow[:, j], period_s, harmonics) for j in range(q.shape[1])),
        left_out_fraction=slow.mean(axis=0),
        torque_sigma=repeat_for_real_and_imaginary(sigma[: harmonics + 1] / gain).T,
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
    """Return a mask of a mean period's samples that `bin_equations` uses, (samples, n).

    At all other samples the joint's torque is free.
    """
    q, v = mean_motion(average, band_hz)
    warmth = Conditions(temperature_k=average.temperature_k)
    conditions = with_presliding_history(model, q, warmth, periodic=True)
    finer = len(q) // average.samples_per_period
    return np.asarray(
        samples_with_known_friction(conditions, moving_actuators(model, v, standstill_rad_s))[
            ::finer
        ]
    )


def with_free_reversals(
    equations: BinEquations, model: RobotModel, average: PeriodAverage, standstill_rad_s: float
) -> BinEquations:
    """Return equations in which a joint's torque is free at reversals, until the joint slides.

    For friction with presliding, the torque is then free until the effect of the last reversal has
    ended, so that the shape of the friction transition has no effect. For other joints nothing
    changes.

    Args:
        equations: The equations of a mean period.
        model: The model of the equations.
        average: The mean period.
        standstill_rad_s: Below this speed a joint does not slide.
    """
    q, v, _ = _motion(average, equations.harmonics)
    conditions = with_presliding_history(model, q, periodic=True)
    held = ~sliding_samples(conditions, moving_actuators(model, v, standstill_rad_s))
    period_s, harmonics = equations.period_s, equations.harmonics
    return replace(
        equations,
        free=tuple(_free_columns(own, period_s, harmonics) for own in held.T),
        left_out_fraction=held.mean(axis=0),
    )


def mean_motion(average: PeriodAverage, band_hz: float) -> tuple[FloatArray, FloatArray]:
    """Return q and v of a mean period on a fine grid, (samples, n) [rad or m, per s]."""
    harmonics = harmonics_below(
        band_hz, average.period_s, average.sample_period_s, average.torque_filter
    )
    return _motion(average, harmonics)[:2]


def _motion(average: PeriodAverage, harmonics: int) -> Derivatives:
    """Return the motion of a mean period on a fine grid.

    It contains more harmonics than the band, because products of angles and accelerations above the
    band contribute to the band.
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
        EstimationError: The band contains no bin.
    """
    limit_hz = min(band_hz, NYQUIST_FRACTION * 0.5 / sample_period_s)
    if torque_filter is not None:
        limit_hz = min(limit_hz, torque_filter.cutoff_hz)
    harmonics = math.floor(limit_hz * period_s + 1e-9)
    if harmonics < 1:
        raise EstimationError(
            f"a band up to {limit_hz:g} Hz contains no harmonic of a period of {period_s:g} s:"
            " raise the band limit",
            code="RID-MOTION-BAND",
        )
    return harmonics


def _projection(times: FloatArray, period_s: float, harmonics: int) -> FloatArray:
    """Return the cosines and sines of the rows at some times, shape (2 H + 1, times)."""
    angle = 2.0 * np.pi / period_s * np.outer(np.arange(1, harmonics + 1), times)
    root = math.sqrt(2.0)
    return np.vstack([np.ones((1, len(times))), root * np.cos(angle), -root * np.sin(angle)])


def _on_bins(projection: FloatArray, columns: FloatArray) -> FloatArray:
    """Return the real and imaginary parts of columns on the DFT bins.

    Args:
        projection: Shape (2 H + 1, samples). Cosines and sines.
        columns: Shape (samples, outputs, any).

    Returns:
        Shape (outputs, 2 H + 1, any).
    """
    projected = projection @ columns.reshape(len(columns), -1)
    return np.asarray(projected.reshape(-1, *columns.shape[1:]).transpose(1, 0, 2))


def _smooth_variance(variance: FloatArray, periods: int) -> FloatArray:
    """Return the variance of the mean's bins, each at least the average of its neighbours.

    A bin's own variance comes from few periods and scatters. A bin with a larger variance than its
    neighbours keeps its own: friction that drifts raises the variance at the motion's harmonics.
    """
    return np.asarray(np.maximum(average_neighbouring_bins(variance), variance) / periods)


def _position_sigma(average: PeriodAverage) -> FloatArray:
    """Return the standard deviation of the mean position's bins, shape (K // 2 + 1, n).

    Quantisation repeats in every period, so that the scatter between periods does not contain it.
    It is the noise floor of the mean's spectrum, measured in its upper half, which contains no
    motion.
    """
    spectrum = np.abs(np.fft.rfft(average.position, axis=0) / len(average.position)) ** 2
    floor = np.median(spectrum[len(spectrum) // 2 :], axis=0) / math.log(2.0)
    between = _smooth_variance(average.position_bin_variance, average.periods_kept)
    return np.asarray(np.sqrt(np.maximum(between, floor)))


def _free_columns(slow: BoolArray, period_s: float, harmonics: int) -> FloatArray:
    """Return columns (2 H + 1, any) that represent any torque while the joint is slow.

    Each interval in which the joint is slow is divided into pieces. A piece is so short that
    frequencies in the band do not show at which instant of the piece the friction changes its sign.
    """
    samples = len(slow)
    if not slow.any():
        return np.zeros((2 * harmonics + 1, 0))
    if slow.all():
        return np.eye(2 * harmonics + 1)
    start = int(
        np.argmin(slow)
    )  # start at a sample with motion, so that no slow interval extends over the end of the period
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
