"""`PayloadEquations`: equations of a payload from recordings, condensed cluster by cluster.

The unknowns are the payload's ten parameters in the flange's frame, followed by all other
parameters of the torques: those of the robot, and the friction of every run. Each run has its own
friction parameters, because friction changes between runs (theory: section 11).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, Literal

import numpy as np

from config.arrays import FloatArray, IntArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import flange_pose
from dynamics.model.robot_model import RobotModel
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.consistency.metric import full_rank_covariance
from identification.estimation.estimate import Estimate
from identification.model.base_parameters import BaseParameters
from identification.model.options import ModelOptions
from identification.payload.body import PARAMETERS, parameters_to_parent
from identification.regression.least_squares import triangular_factor

Procedure = Literal["together", "difference", "model", "apart"]
"""Procedure that separates the payload from the robot (theory: section 11).

- `together`: estimate robot and payload from runs with and without the payload.
- `difference`: subtract the torques of the same motion with and without the payload.
- `model`: use only runs with the payload; a robot model that was identified before is the prior of
  the robot's parameters.
- `apart`: identify the robot with the payload as part of its last link, and subtract the robot
  without payload.
"""

DEPENDENT: Final = 1e-8


@dataclass(frozen=True, eq=False)
class PayloadModel:
    """A robot's model with an unknown body on its flange.

    Attributes:
        options: Terms of the model.
        model: The model; its last ten standard parameters are the payload's.
        base: The robot's base parameters, followed by the payload's ten standard parameters.
    """

    robot: RobotDescription
    options: ModelOptions
    model: RobotModel
    base: BaseParameters

    @classmethod
    def of(cls, robot: RobotDescription, options: ModelOptions | None = None) -> PayloadModel:
        """Build the model of a robot with the terms of some options.

        Raises:
            EstimationError: The options contradict the robot, or request a force plate.
        """
        options = replace(options or ModelOptions(), payload=True)
        if options.kind != "internal":
            raise EstimationError(
                f"the {options.kind} model cannot contain a payload, which is identified from the"
                " joints' torques: use --model internal",
                code="RID-MODEL-KIND",
            )
        model = options.build(robot)
        alone = replace(options, payload=False).base_parameters(robot)
        payload = range(len(alone.standard_names), len(model.parameter_names))
        names = tuple(model.parameter_names[j] for j in payload)
        combination = np.zeros((len(alone) + len(names), len(model.parameter_names)))
        combination[: len(alone), : len(alone.standard_names)] = alone.combination
        combination[range(len(alone), len(combination)), payload] = 1.0
        base = BaseParameters(
            names=(*alone.names, *names),
            expressions=(*alone.expressions, *names),
            units=(*alone.units, *(model.parameter_units[j] for j in payload)),
            standard_names=model.parameter_names,
            kept=(*alone.kept, *payload),
            combination=combination,
            unseen=alone.unseen,
        )
        return cls(robot, options, model, base)

    @cached_property
    def friction(self) -> IntArray:
        """Indices of the friction parameters among the base parameters."""
        group = self.model.parameter_groups.get("friction", slice(0, 0))
        return np.flatnonzero([group.start <= kept < group.stop for kept in self.base.kept])

    @cached_property
    def links(self) -> IntArray:
        """Indices of the robot's base parameters, without friction and payload."""
        robot = np.arange(len(self.base) - PARAMETERS_PER_LINK)
        return np.asarray(np.setdiff1d(robot, self.friction))

    @cached_property
    def flange_to_link(self) -> FloatArray:
        """Matrix of payload parameters from the flange's to the last link's frame, (10, 10)."""
        return parameters_to_parent(flange_pose(self.robot))


@dataclass(frozen=True, eq=False)
class Layout:
    """Position of the columns of one run's equations among all unknowns.

    The columns of a run are those of `PayloadModel.base`, followed by the derivatives with respect
    to nonlinear parameters.
    """

    model: PayloadModel
    runs: int
    with_robot: bool = True
    slopes: int = 0

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all unknowns: parameters of payload and robot, friction, corrections.

        The friction is that of each run; the corrections are those of nonlinear parameters.
        """
        base = self.model.base
        robot = [base.expressions[j] for j in self.model.links] if self.with_robot else []
        friction = [
            f"{base.names[j]} in run {run + 1}"
            for run in range(self.runs)
            for j in self.model.friction
        ]
        steps = self.model.model.nonlinear_names[: self.slopes]
        return (*PARAMETERS, *robot, *friction, *steps)

    def expand_columns(self, run: int, columns: FloatArray) -> FloatArray:
        """Return columns (..., b or b + s) of a run as columns (..., p) of all unknowns."""
        model = self.model
        b, f, n = len(model.base), len(model.friction), PARAMETERS_PER_LINK
        out = np.zeros((*columns.shape[:-1], len(self.names)))
        out[..., :n] = columns[..., b - n : b] @ model.flange_to_link
        start = n
        if self.with_robot:
            out[..., start : start + len(model.links)] = columns[..., model.links]
            start += len(model.links)
        place = start + run * f
        out[..., place : place + f] = columns[..., model.friction]
        if self.slopes:
            out[..., -self.slopes :] = columns[..., b:]
        return out


@dataclass(frozen=True, eq=False)
class PayloadEquations:
    """Whitened equations A x = y of a payload and all other unknowns, cluster by cluster.

    Attributes:
        procedure: Procedure that set up the equations.
        joint_names: Length n. The joints.
        names: Length p. The unknowns, the payload's ten `PARAMETERS` first.
        factors: Tuple of ndarray, each (any, p + n). R of the QR factorisation of [A Y] of one
            cluster, in which Y is the part of y that each joint measured (the parts add up to y).
        joints: Tuple of ndarray, n of shape (any, p + 1). R of [A y] of all of a joint's equations
            in N m (N), not whitened.
        rows: Length n. Number of equations of each joint.
        divisors: Shape (2, n). Divisors that turn sums of squares over `joints` into mean squares
            over time: for all runs, and for those with the payload.
        known: Shape (any, p + 1). Prior knowledge as equations with unit noise, right-hand side
            last.
        runs: Index of each cluster's run, from 0.
        explained_nm: Shape (n,). RMS of each joint's torque that was subtracted before these
            equations were set up [N m or N]: for `apart` that of two robots, for `difference` that
            of the run without payload; otherwise zero.
        noise_nm: Shape (n,). RMS of each joint's torque residual due to measured noise alone [N m
            or N]; None if it is not measured, as for recordings that are not periodic.
        carried: Tuple of ndarray, n of shape (any, 10), or empty. R of the payload's columns in
            each joint's torque over the loaded runs, scaled to mean squares [N m or N]; empty if
            `joints` contains them.
    """

    procedure: Procedure
    joint_names: tuple[str, ...]
    names: tuple[str, ...]
    factors: tuple[FloatArray, ...]
    joints: tuple[FloatArray, ...]
    rows: tuple[int, ...]
    divisors: FloatArray
    known: FloatArray
    runs: tuple[int, ...]
    explained_nm: FloatArray
    noise_nm: FloatArray | None
    carried: tuple[FloatArray, ...] = ()

    def __post_init__(self) -> None:
        p, n = len(self.names), len(self.joint_names)
        if self.names[:PARAMETERS_PER_LINK] != PARAMETERS:
            raise EstimationError(
                "the first unknowns must be the payload's ten parameters", code="RID-API-ARGUMENT"
            )
        if len(self.runs) != len(self.factors):
            raise EstimationError(
                "each cluster needs the index of its run", code="RID-API-ARGUMENT"
            )
        if any(factor.shape[1] != p + n for factor in self.factors):
            raise EstimationError(f"each cluster needs {p + n} columns", code="RID-API-ARGUMENT")
        if self.known.shape[1] != p + 1:
            raise EstimationError(f"prior knowledge needs {p + 1} columns", code="RID-API-ARGUMENT")

    @property
    def payload_columns(self) -> tuple[FloatArray, ...]:
        """QR factor R of the payload's columns in each joint's torque, scaled to mean squares."""
        ten, loaded = PARAMETERS_PER_LINK, np.sqrt(np.maximum(self.divisors[1], 1.0))
        own = (factor[:, :ten] / s for factor, s in zip(self.joints, loaded, strict=True))
        return self.carried or tuple(own)

    @cached_property
    def whole(self) -> FloatArray:
        """R of [A Y] of all clusters, shape (p + n, p + n)."""
        width = len(self.names) + len(self.joint_names)
        stacked = np.vstack([*self.factors, np.zeros((width, width))])
        return triangular_factor(stacked)

    def with_larger_noise(self, factor: float) -> PayloadEquations:
        """Return the equations with the noise of all measurements multiplied by a factor."""
        return replace(self, factors=tuple(each / factor for each in self.factors))


def condense_cluster(
    matrices: Sequence[FloatArray], sides: Sequence[FloatArray], width: int
) -> FloatArray:
    """Return R of [A Y] of one cluster, from each joint's whitened equations.

    `matrices` (any, p) are the left-hand sides of the joints' equations, `sides` (any,) the
    right-hand sides.
    """
    n = len(matrices)
    parts = []
    for j, (matrix, rhs) in enumerate(zip(matrices, sides, strict=True)):
        part = np.zeros((len(rhs), width + n))
        part[:, :width] = matrix
        part[:, width + j] = rhs
        parts.append(part)
    return triangular_factor(np.vstack(parts))


def robot_prior(layout: Layout, robot: Estimate | None) -> FloatArray:
    """Return an estimate of the robot without payload as equations of the unknowns, (any, p + 1).

    Without an estimate the result has no rows. The estimate's friction is not used. The links'
    parameters enter with their cluster-robust covariance, so that the payload's intervals include
    the uncertainty of the model.

    Raises:
        EstimationError: The estimate is of another robot, or its model has other terms.
    """
    if robot is None:
        return np.zeros((0, len(layout.names) + 1))
    model = layout.model
    wanted = [model.base.expressions[j] for j in model.links]
    unknown = [each for each in wanted if each not in robot.base.expressions]
    if unknown:
        raise EstimationError(
            f"the model of the robot without payload does not contain the parameter {unknown[0]}:"
            " use a model of the same robot with the same terms",
            code="RID-MODEL-TERMS-DIFFER",
        )
    places = [robot.base.expressions.index(each) for each in wanted]
    covariance = full_rank_covariance(robot)[np.ix_(places, places)]
    scale = np.sqrt(np.diagonal(covariance))
    lower = np.linalg.cholesky(covariance / np.outer(scale, scale))
    rows = np.zeros((len(places), len(layout.names) + 1))
    columns = slice(PARAMETERS_PER_LINK, PARAMETERS_PER_LINK + len(places))
    rows[:, columns] = np.linalg.solve(lower, np.diag(1.0 / scale))
    rows[:, -1] = rows[:, columns] @ robot.values[places]
    return rows


def independent_unknowns(whole: FloatArray, unknowns: int, first: int) -> IntArray:
    """Return the unknowns from index `first` on that are linearly independent.

    Args:
        whole: Shape (any, unknowns + any). Equations.
        unknowns, first: Number of columns that are unknowns, and index of the first unknown to
            test.
    """
    basis = np.zeros((len(whole), 0))
    size = np.linalg.norm(whole[:, :unknowns], axis=0)
    kept: list[int] = []
    for j in range(first, unknowns):
        if size[j] <= 1e-12 * size.max(initial=1e-300):
            continue
        rest = whole[:, j] / size[j]
        for _ in range(2):  # the second pass removes the rounding error of the first
            rest = rest - basis @ (basis.T @ rest)
        length = float(np.linalg.norm(rest))
        if length > DEPENDENT:
            basis = np.column_stack([basis, rest / length])
            kept.append(j)
    return np.array(kept, dtype=np.int64)
