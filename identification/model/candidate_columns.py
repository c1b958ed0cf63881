"""`CandidateColumns`: columns out of which those of many models of one robot are combined.

Models of a robot that differ in their friction share nearly all their columns. Those of a linear
term are the same in all of them. A gear that loses a share of its load multiplies a column by
a + b s, with s = 1 where the motor drives the load and -1 where the load drives the motor: with
the direction s known, that is a combination of the column and s times the column. A Stribeck
column is interpolated in its speed, by Chebyshev's polynomials in the logarithm of the speed.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.polynomial import chebyshev

from config.arrays import FloatArray, IntArray
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, load_torque, regressor
from dynamics.model.transmission import Transmission
from dynamics.terms.conditions import Conditions
from dynamics.terms.friction import Friction, StribeckSpeed
from identification.model.base_parameters import (
    BaseParameters,
    independent_columns,
    random_regressor,
)
from identification.model.options import ModelOptions
from identification.regression.least_squares import triangular_factor

STRIBECK_NODES: Final = 16
"""They interpolate a Stribeck column to 1e-6 of its coefficient over the speed's whole range."""

Positions = tuple[FloatArray, FloatArray, FloatArray]
"""q, v, a, each (samples, n)."""


@dataclass(frozen=True, eq=False)
class CandidateColumns:
    """The columns of each joint: linear ones, those behind its gear times s, Stribeck nodes.

    Attributes
    ----------
    rich : RobotModel
        The robot with all terms of all candidates on every joint, gears that lose nothing.
    sampled : ndarray, shape (any, p)
        Triangular factor of its regressor on random motions: which columns are independent.
    linear : tuple of ndarray of int
        Of each joint, which of the rich model's parameters can have an effect.
    geared : tuple of ndarray of int
        Of each joint, the places among `linear` of those that a gear transmits; none where no
        candidate's gears lose anything.
    stribeck : tuple of StribeckSpeed
        The Stribeck speeds that candidates may have.
    """

    rich: RobotModel
    sampled: FloatArray
    linear: tuple[IntArray, ...]
    geared: tuple[IntArray, ...]
    stribeck: tuple[StribeckSpeed, ...]

    @classmethod
    def of(cls, robot: RobotDescription, options: ModelOptions) -> CandidateColumns:
        """Return the columns of a robot whose joints have all terms of all candidates."""
        model = options.build(robot)
        rich = replace(model, transmission=Transmission())
        regressors = random_regressor(rich)
        names, units = rich.parameter_names, rich.parameter_units
        friction = rich.parameter_groups.get("friction", slice(0, 0))
        own = np.zeros(len(names), dtype=bool)
        own[friction] = True
        # What depends on the columns before it does so whatever friction there is besides.
        others = np.flatnonzero(~own)
        base = independent_columns(
            regressors[:, others], tuple(names[i] for i in others), tuple(units[i] for i in others)
        )
        own[others[list(base.kept)]] = True
        term = next((term for term in rich.terms if isinstance(term, Friction)), None)
        if term is not None:  # Stribeck columns are the nodes'
            own[friction] = [column.function != "stribeck" for column in term.columns]
        seen = np.any(regressors.reshape(-1, rich.chain.n, len(names)) != 0.0, axis=0)
        linear = tuple(np.flatnonzero(own & row) for row in seen)
        gears = np.zeros(len(names), dtype=bool)
        for part in rich.terms:
            gears[rich.parameter_groups[part.name]] = part.through_gears
        losing = {loss.joint for loss in model.transmission.losses}
        return cls(
            rich=rich,
            sampled=triangular_factor(regressors),
            linear=linear,
            geared=tuple(
                np.flatnonzero(gears[columns]) if j in losing else np.zeros(0, dtype=np.int64)
                for j, columns in enumerate(linear)
            ),
            stribeck=() if term is None else term.stribeck,
        )

    def width(self, joint: int) -> int:
        """Return how many columns a joint has."""
        return (
            len(self.linear[joint])
            + len(self.geared[joint])
            + STRIBECK_NODES * any(speed.joint == joint for speed in self.stribeck)
        )

    def base_parameters(self, model: RobotModel) -> BaseParameters:
        """Return what can be identified of one of the candidates."""
        index = {name: i for i, name in enumerate(self.rich.parameter_names)}
        columns = [index[name] for name in model.parameter_names]
        return independent_columns(
            self.sampled[:, columns], model.parameter_names, model.parameter_units
        )

    def rows(
        self, motion: Positions, conditions: Conditions, load: tuple[RobotModel, FloatArray]
    ) -> list[FloatArray]:
        """Return the columns of every joint, each (samples, width).

        Parameters
        ----------
        motion : tuple of (samples, n) arrays
            q, v, a.
        conditions : Conditions
            Temperature and payload.
        load : (RobotModel, ndarray)
            A model and its standard parameters, which say what torque the gears transmit.
        """
        phi = regressor(self.rich, *motion, conditions)
        n = self.rich.chain.n
        parts = [[phi[:, j, self.linear[j]]] for j in range(n)]
        if any(len(columns) for columns in self.geared):
            direction = np.sign(
                load_torque(load[0], *motion, load[1], conditions)
                * self.rich.actuator_speed(motion[1])
            )
            for j, columns in enumerate(self.geared):
                parts[j].append(parts[j][0][:, columns] * direction[:, j, np.newaxis])
        for values in self._at_nodes(motion, conditions):
            for speed, column in zip(self.stribeck, values.T, strict=True):
                parts[speed.joint].append(column[:, np.newaxis])
        return [np.concatenate(own, axis=1) for own in parts]

    def _at_nodes(self, motion: Positions, conditions: Conditions) -> list[FloatArray]:
        """Return the Stribeck columns at one node after the other, each (samples, speeds)."""
        term = next((term for term in self.rich.terms if isinstance(term, Friction)), None)
        if term is None or not self.stribeck:
            return []
        own = [c for c, column in enumerate(term.columns) if column.function == "stribeck"]
        term = replace(term, columns=tuple(term.columns[c] for c in own))
        whole = self.rich.motion(*motion, conditions)
        joints = [column.joint for column in term.columns]
        found = []
        for nodes in np.transpose([stribeck_nodes(speed) for speed in self.stribeck]):
            out = np.zeros((*motion[0].shape, len(joints)))
            term.with_nonlinear(nodes).fill_torque(whole, out)
            found.append(out[:, joints, range(len(joints))])
        return found


def stribeck_nodes(speed: StribeckSpeed) -> FloatArray:
    """Return the speeds at which a Stribeck column is taken, (nodes,)."""
    low, high = np.log([speed.parameter.low, speed.parameter.high])
    at = chebyshev.chebpts1(STRIBECK_NODES)
    return np.asarray(np.exp((low + high + (high - low) * at) / 2.0))
