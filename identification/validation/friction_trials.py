"""`Trial`: one choice of friction terms, judged on parts of the recordings that its fit left out.

`CondensedTrials` makes them, all on one condensed form of the recordings.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, Protocol

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from config.arrays import FloatArray
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from identification.estimation.condensed import CondensedFit, CondensedRecordings
from identification.estimation.options import EstimationOptions

Terms = tuple[FrictionTerm, ...]
"""Friction terms of one joint."""

DISTINCT_SIGMAS: Final = 2.0
_PARAMETERS: Final[dict[FrictionTerm, tuple[str, ...]]] = {
    "load": ("cl",),
    "stribeck": ("fs", "vs"),
    "presliding": ("dp",),
}
"""Symbols of the parameters of terms that are not linear, which may end up as nothing at all."""


@dataclass(frozen=True, eq=False)
class Trial:
    """One candidate, judged on data that it has not seen.

    Attributes
    ----------
    terms : tuple of str
        The friction terms of every joint; empty for the model put together joint by joint.
    error_nm : ndarray, shape (n,)
        RMS error of each joint on moving samples of the parts left out [N m or N].
    event_errors : ndarray, shape (events, n)
        Mean squared error of each second; NaN where the joint did not move.
    parameters : int
        Linear and nonlinear parameters.
    aic, bic : float
        Information criteria of the fit to all data; the smaller the better.
    """

    terms: Terms
    error_nm: FloatArray
    event_errors: FloatArray
    parameters: int
    aic: float
    bic: float


class Trials(Protocol):
    """What judges friction terms, one tuple a joint."""

    @abstractmethod
    def of(self, friction: Sequence[Terms], name: Terms = ()) -> Trial:
        """Return the trial of a robot with these terms, called `name` in the table."""

    @abstractmethod
    def doubtful(self, friction: Sequence[Terms]) -> tuple[Terms, ...]:
        """Return each joint's terms that the data do not tell, or that no friction has.

        Their parameters are not told from zero or at a bound, or Stribeck's is below zero.
        """

    @abstractmethod
    def offsets_told(self, friction: Sequence[Terms]) -> tuple[bool, ...]:
        """Return which joints have an offset that the data tell from zero."""


@dataclass(frozen=True, eq=False)
class CondensedTrials:
    """Trials on condensed recordings.

    Attributes
    ----------
    robot : RobotDescription
        The robot; its own friction terms do not count.
    parts : tuple of SmoothedSignals
        Contiguous parts, left out one after the other.
    data : CondensedRecordings
        What stands for their rows.
    """

    robot: RobotDescription
    parts: tuple[SmoothedSignals, ...]
    data: CondensedRecordings

    @classmethod
    def begin(
        cls,
        robot: RobotDescription,
        parts: Sequence[SmoothedSignals],
        candidates: Sequence[Terms],
        options: EstimationOptions,
    ) -> CondensedTrials:
        """Condense recordings for these candidates.

        Raises
        ------
        EstimationError
            The recordings are not the robot's, or do not show the candidates' linear terms.
        """
        joints = len(robot.joints)
        everything: Terms = tuple(dict.fromkeys(term for terms in candidates for term in terms))
        linear = max((_linear(terms) for terms in candidates), key=len)
        data = CondensedRecordings.of(
            with_friction(robot, [everything] * joints),
            with_friction(robot, [linear] * joints),
            parts,
            options,
        )
        return cls(robot, tuple(parts), data)

    def of(self, friction: Sequence[Terms], name: Terms = ()) -> Trial:
        """Return the trial of a robot with these terms; see `Trials`.

        Raises
        ------
        EstimationError
            The motion does not show the parameters.
        """
        problem = self.data.problem(with_friction(self.robot, friction))
        whole = problem.fit()
        # Each fold starts from the nonlinear parameters of all data, and finds its own.
        errors = np.concatenate(
            [
                problem.mean_squares(problem.fit(whole.model, left_out=part), part)
                for part in range(len(self.parts))
            ]
        )
        duration_s = sum(len(part) * part.sample_period_s for part in self.parts)
        moving = whole.fit.rows_used / sum(len(part) for part in self.parts)
        values = 2.0 * self.parts[0].cutoff_hz * duration_s * moving
        fit = float(np.sum(values * np.log(whole.fit.residual_nm**2)))
        return Trial(
            terms=name,
            error_nm=np.sqrt(np.nanmean(errors, axis=0)),
            event_errors=errors,
            parameters=whole.parameters,
            aic=fit + 2.0 * whole.parameters,
            bic=fit + math.log(float(values.sum())) * whole.parameters,
        )

    def doubtful(self, friction: Sequence[Terms]) -> tuple[Terms, ...]:
        """Return each joint's terms that the data do not tell from nothing; see `Trials`."""
        fit, small = self._small(friction)
        below = {
            name
            for name, value in zip(fit.base.names, fit.values, strict=True)
            if name.startswith("fs_") and value < 0.0
        }
        small |= below | set(fit.model.nonlinear_at_bound)
        return doubtful_terms(self.robot, friction, small)

    def offsets_told(self, friction: Sequence[Terms]) -> tuple[bool, ...]:
        """Return which joints' offset is told from zero; see `Trials`."""
        fit, small = self._small(friction)
        offsets = [f"fo_{joint.name}" for joint in self.robot.joints]
        return tuple(name in fit.base.names and name not in small for name in offsets)

    def _small(self, friction: Sequence[Terms]) -> tuple[CondensedFit, set[str]]:
        """Return the fit of these terms, and its parameters that are not told from zero."""
        problem = self.data.problem(with_friction(self.robot, friction))
        fit = problem.fit()
        names = (*fit.base.names, *fit.model.nonlinear_names)
        values = np.append(fit.values, fit.model.nonlinear_values)
        sigma = np.sqrt(np.diagonal(problem.covariance(fit)))
        return fit, {
            name
            for name, value, own in zip(names, values, sigma, strict=True)
            if abs(value) < DISTINCT_SIGMAS * own
        }


def doubtful_terms(
    robot: RobotDescription, friction: Sequence[Terms], parameters: set[str]
) -> tuple[Terms, ...]:
    """Return each joint's terms that rest on one of these parameters, those of its gear included.

    Only terms that are not linear do: a coefficient of zero is harmless where it is linear.
    """
    return tuple(
        tuple(
            term
            for term in terms
            if parameters & {f"{symbol}_{joint.name}" for symbol in _PARAMETERS.get(term, ())}
        )
        for joint, terms in zip(robot.joints, friction, strict=True)
    )


def with_friction(robot: RobotDescription, terms: Sequence[Terms]) -> RobotDescription:
    """Return a robot whose joints have these friction terms, one tuple a joint."""
    joints = (
        joint.model_copy(
            update={"friction": own, "efficiency": None if "load" in own else joint.efficiency}
        )
        for joint, own in zip(robot.joints, terms, strict=True)
    )
    return robot.model_copy(update={"joints": tuple(joints)})


def _linear(terms: Terms) -> Terms:
    return tuple(term for term in terms if term not in _PARAMETERS)
