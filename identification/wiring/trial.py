"""`Condensed`: equations of all rows in one small matrix a joint, on which torques are tried."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from config.arrays import BoolArray, FloatArray
from dynamics.model.robot_model import RobotModel, regressor
from dynamics.model.transmission import Transmission
from identification.model.options import ModelOptions
from identification.regression.fit_grade import GOOD_SHARE
from identification.wiring.signals import WiredSignals

SLOW_SHARE: Final = 0.05
FEWEST_ROWS: Final = 20
RIDGE: Final = 1e-9
LEAST_GAIN: Final = 0.2
FAR_BETTER_TIMES: Final = 2.0
SMALLEST_SHARE: Final = 0.01
DRIVING_SHARE: Final = 0.03
DRIVING_COST: Final = 1.0
BRAKES: Final = ("fc_", "fv_")


@dataclass(frozen=True, eq=False)
class Trial:
    """How well a robot explains torques, joint by joint.

    Attributes
    ----------
    residual_share : ndarray, shape (n,)
        RMS residual over RMS torque, at least `SMALLEST_SHARE`; NaN for a joint that stands still.
    driving : ndarray of bool, shape (n,)
        Whether the joint's friction would drive it, which friction does not.
    """

    residual_share: FloatArray
    driving: BoolArray

    @property
    def good(self) -> bool:
        """Whether no joint leaves more than a good fit does."""
        return not (np.any(self.residual_share > GOOD_SHARE) or np.any(self.driving))

    def far_better_than(self, other: Trial) -> bool:
        """Whether another fit is far worse: friction drives a joint, or a residual is twice it.

        All joints together must gain as well. Less than that a model gains by any freedom that
        happens to follow what friction it lacks.
        """
        if other.cost - self.cost < LEAST_GAIN:
            return False
        halved = np.nanmax(other.residual_share / self.residual_share) >= FAR_BETTER_TIMES
        return bool(halved or np.sum(self.driving) < np.sum(other.driving))

    @property
    def cost(self) -> float:
        """Sum of the logarithms of the shares, and one for each joint that friction would drive."""
        shares = np.log(self.residual_share)
        return float(np.nansum(shares) + DRIVING_COST * np.sum(self.driving))


@dataclass(frozen=True, eq=False)
class Condensed:
    """Products of columns: what least squares needs to know of the rows.

    Attributes
    ----------
    products : ndarray, shape (n, p + n, p + n)
        For each joint [Phi T]^T [Phi T], with its regressor Phi and the torques T of all joints.
    rows : ndarray, shape (n,)
        Rows used of each joint.
    brakes : ndarray, shape (n, p)
        Power of each friction parameter of a joint, at one of its unit [W].
    power : ndarray, shape (n, n)
        For each joint the mean of |speed x torque| with every joint's torque [W].
    """

    products: FloatArray
    rows: FloatArray
    brakes: FloatArray
    power: FloatArray

    @classmethod
    def of(cls, signals: WiredSignals) -> Condensed:
        """Evaluate a robot's regressor, with Coulomb and viscous friction and an offset."""
        model = plain_model(signals)
        q, v, a = signals.joints()
        phi, speed = regressor(model, q, v, a), signals.velocity
        n, p = len(signals.robot.joints), phi.shape[2]
        use = rows_used(signals)
        products, brakes = np.zeros((n, p + n, p + n)), np.zeros((n, p))
        power = np.zeros((n, n))
        braking = np.array([name.startswith(BRAKES) for name in model.parameter_names])
        for j in range(n):
            columns = np.column_stack([phi[use[:, j], j], signals.torque_nm[use[:, j]]])
            products[j] = columns.T @ columns
            brakes[j] = np.where(braking, speed[use[:, j], j] @ columns[:, :p], 0.0)
            power[j] = np.abs(speed[use[:, j], j]) @ np.abs(columns[:, p:])
        return cls(products, use.sum(axis=0).astype(np.float64), brakes, power)

    def trial(self, torque: FloatArray) -> Trial:
        """Fit the robot to torques, (n, n) times the stated ones, each joint's of one size."""
        n, p = len(self.products), self.brakes.shape[1]
        gram, rhs = np.zeros((p, p)), np.zeros(p)
        sizes = np.zeros(n)
        for j, product in enumerate(self.products):
            pick = torque[j]
            sizes[j] = pick @ product[p:, p:] @ pick
            if self.rows[j] >= FEWEST_ROWS and sizes[j] > 0.0:
                gram += product[:p, :p] / sizes[j]
                rhs += product[:p, p:] @ pick / sizes[j]
        scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
        scaled = gram / scale / scale[:, np.newaxis]
        factor = cho_factor(scaled + RIDGE * np.eye(p), check_finite=False)
        values = cho_solve(factor, rhs / scale, check_finite=False) / scale
        shares, driving = np.full(n, np.nan), np.zeros(n, dtype=np.bool_)
        for j, product in enumerate(self.products):
            if self.rows[j] < FEWEST_ROWS or sizes[j] <= 0.0:
                continue
            whole = np.concatenate([values, -torque[j]])
            left = max(float(whole @ product @ whole), 0.0) / sizes[j]
            shares[j] = max(np.sqrt(left), SMALLEST_SHARE)
            most = float(np.abs(torque[j]) @ self.power[j])
            driving[j] = self.brakes[j] @ values < -DRIVING_SHARE * most
        return Trial(shares, driving)


def rows_used(signals: WiredSignals) -> BoolArray:
    """Return which rows count of each joint, shape (rows, n): those at which it moves."""
    speed = signals.velocity
    slowest = SLOW_SHARE * np.sqrt(np.mean(np.square(speed), axis=0))  # the same in any unit
    return np.asarray((np.abs(speed) > slowest) & signals.moving)


def plain_model(signals: WiredSignals) -> RobotModel:
    """Return the model that hypotheses are tried with."""
    options = ModelOptions(friction_terms=("coulomb", "viscous", "offset"))
    return replace(options.build(signals.robot), transmission=Transmission())
