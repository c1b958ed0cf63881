"""`Estimate`: identified base parameters with their uncertainty, and predicted torques."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Literal, Protocol

import numpy as np

from acquisition.processing.torque_channel import TorqueChannel
from config.arrays import FloatArray, freeze
from config.column_file import each_column
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.model.memory import with_presliding_history
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, load_torque, regressor
from dynamics.terms.conditions import Conditions
from identification.equations.plate_fit import PlateFit
from identification.equations.warming import Warming
from identification.estimation.options import Weighting
from identification.model.base_parameters import BaseParameters
from identification.model.options import ModelOptions
from identification.model.still_joints import StillJoint, refuse_unmoved_joints
from identification.regression.fit_grade import FitGrade, Grade, grade_fit

BLOCK_ROWS = 4096


@dataclass(frozen=True, eq=False)
class Estimate:
    """Base parameters of one robot, with everything needed to use them.

    Three covariances describe the uncertainty:
    - from the measured noise,
    - from the residuals, assumed white,
    - cluster-robust, from residuals of any colour. This one also includes the effect of model
      error.

    Attributes:
        options: The terms of the model, with the estimated values of the nonlinear parameters.
        base: Names, units, expressions and combinations of the b parameters.
        values: Shape (b,). The estimated base parameters.
        covariance_noise: Shape (b, b). From the noise between periods; None if nothing was
            repeated.
        covariance_residual: Shape (b, b). From the residuals of each joint, assumed white.
        covariance_jackknife: Shape (b, b). Cluster-robust covariance from residuals of any colour
            (`identification.regression.intervals`).
        nonlinear_covariance: Shape (s, s). The cluster-robust covariance of the nonlinear
            parameters.
        clusters: Number of time intervals or bins in `covariance_jackknife`; None if unknown.
        condition_number: Condition number of the weighted regressor, columns scaled to length one
            (2.25, 2.26).
        equations: Number of equations used.
        residual_nm: Shape (n,). RMS of measured minus predicted torque inside the band [N m or N].
        noise_nm: Shape (n,). RMS of the residual that the measured noise alone would cause [N m or
            N].
        torque_nm: Shape (n,). RMS of the measured torque inside the band [N m or N]; None for the
            external model.
        held_out_share: Shape (n,). RMS residual over RMS torque on held-out parts of the recording,
            with a simple model (`identification.wiring.held_out`); zero if it is hardly larger than
            on the fitted parts; None if it was not computed.
        left_out_fraction: Shape (n,). Fraction of samples in which the joint's friction is unknown,
            mostly near standstill; they were left out, or their torque was free.
        method: On the bins of averaged periods, or in the time domain on low-passed signals.
        band_hz, standstill_rad_s: Highest frequency and lowest speed used.
        weighting: Weighting of the rows.
        plate: Fit of the force plate, if it was used.
        channel: Delay and low-pass of the recorded torque; None if they were not estimated. The
            channel belongs to the recording, not to the robot: `validate` applies it.
        warming: Model of the joints' temperatures from their motion, if they were not measured; the
            temperature coefficients then refer to these temperatures. None if temperatures were
            measured or have no effect.
        periods: Number of averaged periods; 0 for "smoothed".
        cell_name: The cell in which the runs were recorded.
        run_ids: The runs used.
        imported_row_hashes: Hashes of some rows of the imported runs, by which the same rows are
            recognised in another import.
        still: Joints that no run moved: the estimate holds only at their positions.
        position_range: Shape (n, 2). Lowest and highest position of each joint in the runs [rad or
            m]; None if the estimate is not from runs.
        gear_torque_nm: Shape (n,). If the parameters are those of the links behind elastic gears:
            RMS over the runs of the torque by which the deflection changes the motors' torques [N m
            or N]. None if the gears were assumed to be rigid.
        contradictions: Reasons besides bad fits for which `identify` rejected the model, one
            sentence each: mistakes in files and wiring, impossible values, wrong signals.
    """

    robot: RobotDescription
    options: ModelOptions
    base: BaseParameters
    values: FloatArray
    covariance_noise: FloatArray | None
    covariance_residual: FloatArray
    covariance_jackknife: FloatArray
    condition_number: float
    equations: int
    residual_nm: FloatArray
    noise_nm: FloatArray | None
    left_out_fraction: FloatArray
    method: Literal["periodic", "smoothed"]
    band_hz: float
    standstill_rad_s: float
    weighting: Weighting = "ml"
    plate: PlateFit | None = None
    channel: TorqueChannel | None = None
    warming: Warming | None = None
    nonlinear_covariance: FloatArray = field(default_factory=lambda: np.zeros((0, 0)))
    torque_nm: FloatArray | None = None
    held_out_share: FloatArray | None = None
    clusters: int | None = None
    periods: int = 0
    cell_name: str = ""
    run_ids: tuple[str, ...] = ()
    imported_row_hashes: tuple[int, ...] = ()
    still: tuple[StillJoint, ...] = ()
    position_range: FloatArray | None = None
    gear_torque_nm: FloatArray | None = None
    contradictions: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        b, n, s = len(self.base), len(self.robot.joints), len(self.options.nonlinear or ())
        covariances = ("covariance_residual", "covariance_jackknife", "covariance_noise")
        of_joints = (
            "residual_nm",
            "left_out_fraction",
            "noise_nm",
            "torque_nm",
            "held_out_share",
            "gear_torque_nm",
        )
        freeze(self, EstimationError, (b,), "values", what="estimate ")
        freeze(self, EstimationError, (b, b), *covariances, what="estimate ")
        freeze(self, EstimationError, (s, s), "nonlinear_covariance", what="estimate ")
        freeze(self, EstimationError, (n,), *of_joints, what="estimate ")
        freeze(self, EstimationError, (n, 2), "position_range", what="estimate ")

    @cached_property
    def model(self) -> RobotModel:
        """The robot's model."""
        return self.options.build(self.robot)

    @property
    def standard_values(self) -> FloatArray:
        """Standard parameters that give the same torques.

        The first parameter of each base parameter's combination gets its value, all others are
        zero. They are not the true parameters of the links;
        `identification.consistency.closest_robot` computes physically consistent ones.
        """
        return self.base.to_standard(self.values)

    @property
    def sigma_noise(self) -> FloatArray | None:
        """Standard deviations from the measured noise, shape (b,)."""
        return None if self.covariance_noise is None else _sigma(self.covariance_noise)

    @property
    def sigma_residual(self) -> FloatArray:
        """Standard deviations from the residuals, assumed white, shape (b,)."""
        return _sigma(self.covariance_residual)

    @property
    def sigma(self) -> FloatArray:
        """Standard deviations for reports, (b,): cluster-robust, but at least those from noise."""
        clustered, noise = _sigma(self.covariance_jackknife), self.sigma_noise
        return clustered if noise is None else np.maximum(noise, clustered)

    def add_covariance(self, more: FloatArray) -> Estimate:
        """Return an estimate with an additional covariance (b, b) from another source of error."""
        noise = self.covariance_noise
        return replace(
            self,
            covariance_noise=None if noise is None else noise + more,
            covariance_residual=self.covariance_residual + more,
            covariance_jackknife=self.covariance_jackknife + more,
        )

    @property
    def fit(self) -> tuple[FitGrade, ...]:
        """Quality of the fit of each joint's torque on the data of the estimate."""
        n = len(self.robot.joints)
        torque = np.full(n, np.nan) if self.torque_nm is None else self.torque_nm
        return grade_fit(
            self.robot.joint_names,
            self.residual_nm,
            torque,
            self.noise_nm,
            held_out_share=self.held_out_share,
        )

    @property
    def objections(self) -> tuple[str, ...]:
        """All reasons for which `identify` rejected the model, one sentence each."""
        found = list(self.contradictions)
        grades = () if self.plate is None else self.plate.grades
        if bad := [each.joint for each in grades if each.grade is Grade.BAD]:
            found.append(f"The model does not explain {', '.join(bad)} of the force plate.")
        if bad := [each.joint for each in self.fit if each.grade is Grade.BAD]:
            found.append(f"The model does not explain the torque of {', '.join(bad)}.")
        return tuple(found)

    @property
    def nonlinear_sigma(self) -> FloatArray:
        """Standard deviations of the nonlinear parameters, shape (s,)."""
        return _sigma(self.nonlinear_covariance)

    @property
    def nonlinear_unseen(self) -> tuple[str, ...]:
        """The nonlinear parameters that the data do not determine.

        Each of these is at a bound of its range, or its 95 % interval is as wide as the whole
        range. Its value then depends mostly on the starting value of the fit.
        """
        model = self.model
        low, high = model.nonlinear_bounds.T
        wide = 4.0 * self.nonlinear_sigma >= high - low
        return tuple(
            name
            for name, unseen in zip(model.nonlinear_names, wide, strict=True)
            if unseen or name in model.nonlinear_at_bound
        )


class TorqueModel(Protocol):
    """Identified model that predicts torques: an `Estimate`, or a fit without intervals."""

    @property
    @abstractmethod
    def model(self) -> RobotModel:
        """The robot's model."""

    @property
    @abstractmethod
    def base(self) -> BaseParameters:
        """The identified base parameters of the model."""

    @property
    @abstractmethod
    def values(self) -> FloatArray:
        """Values of the base parameters, shape (b,)."""

    @property
    @abstractmethod
    def standard_values(self) -> FloatArray:
        """Standard parameters with the same torques, shape (p,)."""


def position_range(positions: Sequence[FloatArray]) -> FloatArray:
    """Return the lowest and highest position of each joint in some motions, (n, 2)."""
    ranges = [
        [(column.min(), column.max()) for column in each_column(position)] for position in positions
    ]
    ends = np.array(ranges)
    return np.stack([ends[:, :, 0].min(axis=0), ends[:, :, 1].max(axis=0)], axis=1)


def predict(
    estimate: Estimate | TorqueModel,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return the torques of an estimate, shape (samples, n) [N m or N], block by block.

    Friction with presliding is computed along the samples in their order.

    Args:
        estimate: The identified robot.
        q, v, a: Shape (samples, n). Motion [rad or m, per second, per second squared].
        conditions: Temperature and payload. The load and the presliding hysteresis are computed
            here, unless they are given.

    Raises:
        EstimationError: A joint that did not move during the identification is at another
            position, a shape does not fit the model, or a temperature is missing.
    """
    model, torque = estimate.model, np.empty(np.shape(q))
    if isinstance(estimate, Estimate):
        refuse_other_positions(estimate, q)
    if conditions is None or conditions.memory is None:
        conditions = with_presliding_history(model, q, conditions)
    for start in range(0, len(q), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        block = conditions.part(rows)
        torque[rows] = base_regressor(estimate, q[rows], v[rows], a[rows], block) @ estimate.values
    return torque


def base_regressor(
    estimate: Estimate | TorqueModel,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return Y of tau = Y values, shape (samples, n, b), b base parameters.

    Args:
        estimate: The identified robot.
        q, v, a: As for `predict`.
        conditions: Temperature, payload and presliding hysteresis; the load is computed here,
            unless it is given.
    """
    model = estimate.model
    if model.transmission.losses and (conditions is None or conditions.load_nm is None):
        load = load_torque(model, q, v, a, estimate.standard_values, conditions)
        conditions = replace(conditions or Conditions(), load_nm=load)
    return estimate.base.columns(regressor(model, q, v, a, conditions))


def predict_base_wrench(
    estimate: Estimate,
    q: FloatArray,
    v: FloatArray,
    a: FloatArray,
    conditions: Conditions | None = None,
) -> FloatArray:
    """Return the wrench that the base exerts on the robot, shape (samples, 6) [N, N m].

    Its constant part, mainly the weight, is as uncertain as the plate's offset was.

    Args:
        estimate: Estimate of the external or the combined model.
        q, v, a, conditions: As for `predict`.

    Raises:
        EstimationError: The estimate is of the internal model, which does not determine the wrench,
            or as for `predict`.
    """
    refuse_internal_model(estimate)
    refuse_other_positions(estimate, q)
    wrench = np.empty((len(q), 6))
    for start in range(0, len(q), BLOCK_ROWS):
        rows = slice(start, start + BLOCK_ROWS)
        block = None if conditions is None else conditions.part(rows)
        phi = base_wrench_regressor(estimate.model, q[rows], v[rows], a[rows], block)
        wrench[rows] = estimate.base.columns(phi) @ estimate.values
    return wrench


def refuse_internal_model(estimate: Estimate) -> None:
    """Refuse an estimate of the internal model, which does not determine the base wrench.

    Raises:
        EstimationError: The estimate is of this model (RID-MODEL-NOT-COMBINED).
    """
    if estimate.options.kind == "internal":
        raise EstimationError(
            "an estimate of the internal model does not determine the base wrench: identify the"
            " combined model, from a run with a force plate",
            code="RID-MODEL-NOT-COMBINED",
        )


def refuse_external_model(estimate: Estimate) -> None:
    """Refuse an estimate of the external model, without friction and inertia of the motors.

    Raises:
        EstimationError: The estimate is of this model (RID-MODEL-KIND).
    """
    if estimate.options.kind == "external":
        raise EstimationError(
            "an external model, from the force plate alone, contains no friction and no inertia of"
            " the motors, so it cannot predict their torques: identify with `--model combined` or"
            " `--model internal`",
            code="RID-MODEL-KIND",
        )


def refuse_other_positions(estimate: Estimate, q: FloatArray) -> None:
    """Refuse a motion if a joint that no run moved has another position than in the runs.

    Args:
        estimate: The identified robot.
        q: Shape (samples, n). Joint positions [rad or m].

    Raises:
        EstimationError: A joint is at another position.
    """
    names = estimate.robot.joint_names
    refuse_unmoved_joints(
        [each for each in estimate.still if not each.has_position(q[:, names.index(each.joint)])],
        "this motion cannot be predicted",
    )


def _sigma(covariance: FloatArray) -> FloatArray:
    return np.asarray(np.sqrt(np.diagonal(covariance)))
