"""`DrawnWeight`: weight of the arm in a fit, relative to its drawings or to its size.

Torques in a wrong unit, or without gravity, also fit a robot well: one that is too light or too
heavy by the same factor. Only the comparison with the drawings reveals the mistake.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, regressor
from identification.model.drawn_arm import drawn_parameters, plausible_weight
from identification.wiring.signals import WiredSignals

EVERY: Final = 4
"""Distance between the rows that are used [rows]; poses change slowly."""

LEAST_LOAD: Final = 0.05
OFFSET_SHARE: Final = 0.2
"""Largest friction offset relative to Coulomb friction (2 sigma)."""
CONSTANT_SHARE: Final = 0.05
"""Largest relative spread of a gravity load that no fit separates from a friction offset."""


@dataclass(frozen=True, eq=False)
class ArmWeight:
    """Gravity torque of a fit, relative to that of the drawn arm in the same poses.

    Attributes:
        share: Ratio over all joints that carry weight; NaN if none does.
        sigma: Standard deviation, from leaving out one part of the recordings after the other, and
            from the change of weight that hardly changes the residual.
        plausible: Smallest and largest ratio that a real arm can have.
        is_drawn: True if the arm's weight comes from `cad`, False if only from its size.
    """

    share: float
    sigma: float
    plausible: tuple[float, float]
    is_drawn: bool

    @property
    def is_plausible(self) -> bool:
        """True unless the ratio is distinctly outside its plausible range (2 sigma)."""
        low, high = self.plausible
        return not (self.share + 2.0 * self.sigma < low or self.share - 2.0 * self.sigma > high)

    @property
    def is_known(self) -> bool:
        """False if the interval of the ratio (2 sigma) extends beyond the whole plausible range."""
        low, high = self.plausible
        return self.share - 2.0 * self.sigma > low or self.share + 2.0 * self.sigma < high

    @property
    def sentence(self) -> str:
        """Sentence that compares the arm's weight with the known weight."""
        drawn = "of `cad` in the robot file" if self.is_drawn else "expected for an arm of its size"
        return (
            f"the torques as stated give the arm {self.share:.2g} ± {2.0 * self.sigma:.2g} times"
            f" the weight {drawn}"
        )


@dataclass(frozen=True, eq=False)
class DrawnWeight:
    """Projection of a fit's gravity torque on the gravity torque of the drawn arm.

    Attributes:
        columns: Shape (n, p). For each joint the products of its drawn torque with the gravity part
            of each column; for a prismatic joint with constant drawn force also with its offset.
        doubt: Shape (p,). Standard deviation of the ratio, per unit of each Coulomb friction, due
            to friction offsets that are part of the gravity load.
        drawn: Shape (n,). Sum of squares of the drawn torque; zero for joints that carry little
            weight, or have a spring.
        plausible, is_drawn: As in `ArmWeight`.
    """

    columns: FloatArray
    doubt: FloatArray
    drawn: FloatArray
    plausible: tuple[float, float]
    is_drawn: bool

    @classmethod
    def of(cls, signals: WiredSignals, model: RobotModel) -> DrawnWeight:
        """Compute the drawn arm's gravity torques along the recordings."""
        robot, values = signals.robot, drawn_parameters(model, signals.robot)
        q = signals.joints()[0][::EVERY]
        phi = regressor(model, q, np.zeros_like(q), np.zeros_like(q))
        own = model.parameter_groups["rigid_body"]
        rigid = phi[:, :, own]
        torque_nm = rigid @ values[own]
        drawn = np.einsum("rj,rj->j", torque_nm, torque_nm)
        light = drawn < LEAST_LOAD**2 * drawn.max()
        light |= ~signals.moving  # joints that do not move have no equations
        light |= [is_counterbalanced(robot, j) for j in range(len(robot.joints))]
        drawn[light] = 0.0
        columns = np.zeros((len(drawn), phi.shape[2]))
        columns[:, own] = np.einsum("rj,rjp->jp", torque_nm, rigid)
        doubt = np.zeros(phi.shape[2])
        if not robot.is_drawn:  # its size says nothing about the weight on a prismatic joint
            light |= [joint.type == "prismatic" for joint in robot.joints]
            drawn[light] = 0.0
        for j in np.flatnonzero(~light).tolist():
            if robot.joints[j].type == "prismatic" and constant_weight(torque_nm[:, j]):
                columns[j] = torque_nm[:, j] @ phi[:, j]
                coulomb = model.parameter_names.index(f"fc_{robot.joints[j].name}")
                doubt[coulomb] = 0.5 * OFFSET_SHARE * np.abs(torque_nm[:, j].sum())
        columns[light] = 0.0
        doubt /= max(float(drawn.sum()), 1e-300)
        return cls(columns, doubt, drawn, plausible_weight(robot), robot.is_drawn)

    @property
    def is_visible(self) -> bool:
        """True if gravity loads at least one joint."""
        return bool(np.any(self.drawn > 0.0))

    def share(self, values: FloatArray) -> float:
        """Return `ArmWeight.share` for the parameters of a fit (p,)."""
        if not self.is_visible:
            return float("nan")
        return float(np.sum(self.columns @ values) / np.sum(self.drawn))

    def shares(self, values: FloatArray) -> FloatArray:
        """Return the ratio of gravity torques of each joint, (n,); NaN without gravity load."""
        found = np.full(len(self.drawn), np.nan)
        np.divide(self.columns @ values, self.drawn, out=found, where=self.drawn > 0.0)
        return found


def constant_weight(load: FloatArray) -> bool:
    """Return True if a gravity load (rows,) is so constant that a friction offset equals it."""
    return bool(np.std(load) < CONSTANT_SHARE * abs(np.mean(load)))


def is_counterbalanced(robot: RobotDescription, j: int) -> bool:
    """Return True if a spring or a counterbalance carries an unknown part of a joint's load."""
    joint = robot.joints[j]
    has_spring = robot.spring is not None and robot.spring.joint == joint.name
    return has_spring or joint.counterbalanced
