"""`ModelColumns`: how one model's columns are combined out of those of all candidates."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.polynomial import chebyshev

from config.arrays import FloatArray, IntArray
from dynamics.model.robot_model import RobotModel
from dynamics.terms.friction import Friction, StribeckSpeed
from identification.model.base_parameters import BaseParameters
from identification.model.candidate_columns import STRIBECK_NODES, CandidateColumns

_DEGREE: Final = STRIBECK_NODES - 1
_OF_VALUES: Final = np.linalg.inv(
    chebyshev.chebvander(np.asarray(chebyshev.chebpts1(STRIBECK_NODES), np.float64), _DEGREE)
)
_SLOPES: Final = chebyshev.chebder(np.eye(STRIBECK_NODES))


@dataclass(frozen=True, eq=False)
class ModelColumns:
    """One candidate among the columns of all.

    Attributes
    ----------
    candidates : CandidateColumns
        The columns of all candidates.
    base : BaseParameters
        What can be identified of this one.
    """

    candidates: CandidateColumns
    base: BaseParameters

    @cached_property
    def _of_linear(self) -> tuple[IntArray, ...]:
        """Of each joint's linear columns, which base parameter heads it; -1 where none does."""
        heads = {name: column for column, name in enumerate(self.base.names)}
        names = self.candidates.rich.parameter_names
        return tuple(
            np.array([heads.get(names[i], -1) for i in linear], dtype=np.int64)
            for linear in self.candidates.linear
        )

    def combination(self, joint: int, model: RobotModel, standard: FloatArray | None) -> FloatArray:
        """Return what makes this candidate's `torque_columns` out of a joint's columns.

        Parameters
        ----------
        joint : int
            The joint, from 0.
        model : RobotModel
            The candidate, at some values of its nonlinear parameters.
        standard : ndarray, shape (p,), or None
            As for `torque_columns`.

        Returns
        -------
        ndarray, shape (width, b) or (width, b + s) with `standard`
            A column a parameter.
        """
        slopes = 0 if standard is None else len(model.nonlinear_names)
        matrix = np.zeros((self.candidates.width(joint), len(self.base) + slopes))
        of_linear = self._of_linear[joint]
        places = np.flatnonzero(of_linear >= 0)
        matrix[places, of_linear[places]] = 1.0
        values = None if standard is None else standard[list(self.base.kept)]
        self._add_stribeck(joint, matrix, model, values)
        if values is not None:
            self._add_losses(joint, matrix, model, values)
        return matrix

    def _add_stribeck(
        self, joint: int, matrix: FloatArray, model: RobotModel, values: FloatArray | None
    ) -> None:
        term = next((term for term in model.terms if isinstance(term, Friction)), None)
        for number, speed in enumerate(() if term is None else term.stribeck):
            if speed.joint != joint or term is None:
                continue
            name = next(
                column.parameter_name
                for column in term.columns
                if column.joint == joint and column.function == "stribeck"
            )
            head = self.base.names.index(name)
            weights, slope = _interpolation(speed)
            matrix[-STRIBECK_NODES:, head] = weights
            if values is not None:
                matrix[-STRIBECK_NODES:, len(self.base) + number] = values[head] * slope

    def _add_losses(
        self, joint: int, matrix: FloatArray, model: RobotModel, values: FloatArray
    ) -> None:
        losses = model.transmission.losses
        first = matrix.shape[1] - len(losses)
        of_linear, geared = self._of_linear[joint], self.candidates.geared[joint]
        known = np.flatnonzero(of_linear[geared] >= 0)
        plain, turned = geared[known], len(of_linear) + known
        heads = of_linear[plain]
        for number, loss in enumerate(losses):
            if loss.joint != joint:
                continue
            (even, odd), (even_slope, odd_slope) = loss.shares
            matrix[plain, heads], matrix[turned, heads] = even, odd
            matrix[plain, first + number] = even_slope * values[heads]
            matrix[turned, first + number] = odd_slope * values[heads]


def _interpolation(speed: StribeckSpeed) -> tuple[FloatArray, FloatArray]:
    """Return how much of each node's column is in that of a speed, and the slope by the speed."""
    low, high = np.log([speed.parameter.low, speed.parameter.high])
    value = speed.parameter.value
    at = (2.0 * np.log(value) - low - high) / (high - low)
    slopes = chebyshev.chebval(at, _SLOPES) * 2.0 / (value * (high - low))
    return chebyshev.chebvander(np.array([at]), _DEGREE)[0] @ _OF_VALUES, slopes @ _OF_VALUES
