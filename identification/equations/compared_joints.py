"""`ComparedJoint`: a joint's equations, with the link parameters that the other joints show.

In a motion of few harmonics, link parameters of a joint's own explain almost any error of its
torque. The link parameters of the other joints do not.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals
from acquisition.processing.torque_channel import ComplexArray
from config.arrays import FloatArray
from config.errors import EstimationError
from config.robot.robot import RobotDescription
from identification.equations.candidate_equations import CandidateEquations, JointRows, Reach
from identification.equations.friction_columns import FLEXIBLE
from identification.equations.segments import thin_rows
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions

BLOCK_S: Final = 2.0
FEWEST_ROWS: Final = 30
ROUNDS: Final = 3
"""Rounds in which the weights of the joints are estimated from their errors."""
LEAST_SHARE: Final = 1e-6
"""Smallest error of a joint that affects its weight, as a fraction of the largest error."""
RIDGE: Final = 1e-9


class Links(NamedTuple):
    """Normal equations of the link parameters, from the torques of some joints.

    Attributes:
        gram: Shape (p, p).
        right: Shape (p,).
    """

    gram: FloatArray
    right: FloatArray


@dataclass(frozen=True, eq=False)
class ComparedJoint:
    """One joint's equations, with friction that is flexible enough for any joint.

    Attributes:
        number: The joint's index, from 0.
        known: Response of the joint's known channel, one per piece.
        furthest_s: Time around standstill that is left out, the longest delay that can be tried.
    """

    equations: CandidateEquations
    number: int
    known: Sequence[ComplexArray]
    furthest_s: float

    @cached_property
    def rows(self) -> JointRows:
        """Rows with the columns of its links and of its friction."""
        return self.rows_with(self.known)

    @property
    def _reach(self) -> Reach:
        return Reach(self.furthest_s, self.furthest_s)

    def rows_with(self, responses: Sequence[ComplexArray]) -> JointRows:
        """Return the rows with the columns filtered by a channel."""
        return self.equations.rows(self.number, FLEXIBLE, responses, self._reach, BLOCK_S)

    def advanced(self, delays_s: FloatArray) -> FloatArray:
        """Return the torque advanced by some delays, (rows, delays)."""
        return np.vstack(
            [
                piece.to_rows(
                    piece.torque[:, self.number, np.newaxis]
                    * np.exp(2j * np.pi * np.outer(piece.frequency_hz, delays_s))
                )[self.equations.usable_rows(piece, self.number, self._reach)]
                for piece in self.equations.pieces
            ]
        )

    def block_errors(self, delays_s: FloatArray, links: Links | None) -> FloatArray:
        """Return the mean squared error of each block of time with each delay, (delays, blocks).

        The torque is advanced, so that the columns are the same for all delays.
        """
        rest = residual(self.rows.columns, self.advanced(delays_s), links)
        return block_means(rest, self.rows)

    def links(self, delay_s: float) -> Links:
        """Return the equations of the link parameters, with the friction eliminated."""
        count = self.rows.columns.shape[1] - len(FLEXIBLE)
        both = np.hstack([self.rows.columns[:, :count], self.advanced(np.array([delay_s]))])
        rest = residual(self.rows.columns[:, count:], both)
        return Links(rest[:, :count].T @ rest[:, :count], rest[:, :count].T @ rest[:, count])


def candidate_equations(
    robot: RobotDescription,
    signals: Sequence[SmoothedSignals],
    options: ModelOptions,
    standstill_rad_s: float,
) -> CandidateEquations | None:
    """Return the equations of some recordings; None if they do not determine any parameter.

    Args:
        robot: The robot.
        signals: The recordings.
        options: The terms of the model; those of friction are not used.
        standstill_rad_s: Speed below which a joint does not count as moving [rad/s or m/s].
    """
    plain = replace(options, friction=False, friction_terms=None, nonlinear=None)
    model = plain.build(robot)
    try:
        return CandidateEquations.of(
            model, base_parameters(model), [thin_rows(run) for run in signals], standstill_rad_s
        )
    except EstimationError:  # the recording is too short, or determines no parameters
        return None


def compared_joints(
    equations: CandidateEquations, known: Sequence[ComplexArray], furthest_s: float
) -> list[ComparedJoint]:
    """Return the joints that have enough rows.

    Args:
        equations: The recordings.
        known: Responses (bins, n) of all joints' known channels, one per piece.
        furthest_s: As for `ComparedJoint`.
    """
    every = (
        ComparedJoint(equations, j, [each[:, j] for each in known], furthest_s)
        for j in range(equations.joints)
    )
    return [joint for joint in every if len(joint.rows.torque_nm) > FEWEST_ROWS]


def links_of_others(joints: Sequence[ComparedJoint], delays_s: Sequence[float]) -> list[Links]:
    """Return, for each joint, the equations of all others, in units of the joint's error.

    A joint with a large error has a small weight.

    Args:
        joints: At least two joints.
        delays_s: Known delay of each joint's torque [s].
    """
    links = [joint.links(delay_s) for joint, delay_s in zip(joints, delays_s, strict=True)]
    sigma_nm = np.array([float(np.std(joint.rows.torque_nm)) for joint in joints])
    for _ in range(ROUNDS):
        others = _weighted(links, sigma_nm)
        errors = [
            joint.block_errors(np.array([delay_s]), other).mean()
            for joint, delay_s, other in zip(joints, delays_s, others, strict=True)
        ]
        sigma_nm = np.sqrt(errors)
    return _weighted(links, sigma_nm)


def _weighted(links: Sequence[Links], sigma_nm: FloatArray) -> list[Links]:
    weight = 1.0 / np.maximum(sigma_nm, LEAST_SHARE * sigma_nm.max()) ** 2
    gram = sum(w * own.gram for w, own in zip(weight, links, strict=True))
    right = sum(w * own.right for w, own in zip(weight, links, strict=True))
    return [
        Links((gram - w * own.gram) / w, (right - w * own.right) / w)
        for w, own in zip(weight, links, strict=True)
    ]


def residual(columns: FloatArray, torque_nm: FloatArray, links: Links | None = None) -> FloatArray:
    """Return the part of some torques, (rows, any), that the columns do not explain.

    The first columns belong to the link parameters, of which `links` are further equations.
    """
    gram, right = columns.T @ columns, columns.T @ torque_nm
    if links is not None:
        own = slice(len(links.right))
        gram[own, own] += links.gram
        right[own] += links.right[:, np.newaxis]
    size = np.sqrt(np.diagonal(gram))
    size = np.where(size > 0.0, size, 1.0)
    gram = gram / np.outer(size, size) + RIDGE * np.eye(len(gram))
    solution = np.linalg.solve(gram, right / size[:, np.newaxis]) / size[:, np.newaxis]
    return np.asarray(torque_nm - columns @ solution)


def block_means(rest: FloatArray, rows: JointRows) -> FloatArray:
    """Return the mean squares of a residual, (rows, any), in each block of time, (any, blocks)."""
    numbers = np.unique(rows.block, return_inverse=True)[1]
    return np.array([np.bincount(numbers, each**2) for each in rest.T]) / np.bincount(numbers)
