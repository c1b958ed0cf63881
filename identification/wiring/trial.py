"""`CondensedEquations`: equations of all rows as one small matrix per joint, for fast trials."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Final

import numpy as np
from scipy.linalg import cho_factor, cho_solve

from config.arrays import BoolArray, FloatArray
from dynamics.model.robot_model import RobotModel, regressor
from dynamics.model.transmission import Transmission
from identification.model.options import ModelOptions
from identification.regression.fit_grade import GOOD_SHARE
from identification.wiring.mistakes import Mistake, MistakeKind
from identification.wiring.signals import WiredSignals
from identification.wiring.weight import ArmWeight, DrawnWeight

SLOW_SHARE: Final = 0.05
FEWEST_ROWS: Final = 20
RIDGE: Final = 1e-9
UNSEEN_RISE: Final = 0.01
"""Smallest relative rise of the squared residuals that reveals a wrong weight (2 sigma)."""
PARTS: Final = 5
LEAST_GAIN: Final = 0.2
FAR_BETTER_TIMES: Final = 2.0
SCREEN_TIMES: Final = 1.5
FEW_DATA_TIMES: Final = 2.5
FEW_DATA_GAIN: Final = 2.0
SMALLEST_SHARE: Final = 0.01
DRIVING_SHARE: Final = 0.03
IMPOSSIBLE_COST: Final = 1.0
EXPLAINED_SHARE: Final = 0.7
HOLDS_TIMES: Final = 3.0
BRAKES: Final = ("fc_", "fv_")


@dataclass(frozen=True, eq=False)
class WiringTrial:
    """Quality of a robot's fit to torques, joint by joint.

    Attributes:
        residual_share: Shape (n,). RMS residual over RMS torque, at least `SMALLEST_SHARE`; NaN for
            a joint at rest.
        driving: Shape (n,). True for a joint with negative friction power, which is impossible.
        weight: Arm's weight relative to the known one, in `held_out` its upper bound (2 sigma); NaN
            if it is unknown.
    """

    residual_share: FloatArray
    driving: BoolArray
    weight: float = math.nan

    @property
    def good(self) -> bool:
        """True if every joint's residual is small and no joint's friction has negative power."""
        return not (np.any(self.residual_share > GOOD_SHARE) or np.any(self.driving))

    def far_better_than(self, other: WiringTrial, *, few_data: bool = False) -> bool:
        """Return True if the other fit has more impossibilities or twice a joint's residual.

        The fit of all joints together must improve as well. A smaller gain proves nothing, because
        any additional degree of freedom can compensate friction that is missing in the model. With
        few data such gains are much larger. Then only joints count whose residual was too large for
        a good fit before.
        """
        least, floor = (FEW_DATA_GAIN, GOOD_SHARE) if few_data else (LEAST_GAIN, 0.0)
        if not other.cost - self.cost >= least:
            return False
        times = other.residual_share / self.residual_share  # comparisons with NaN are false
        halved = bool(np.any((times >= FAR_BETTER_TIMES) & (other.residual_share > floor)))
        return halved or self.impossible < other.impossible

    def may_be_better_than(self, other: WiringTrial, impossible: int) -> bool:
        """Return True if a fit to a subset of the rows is good enough to be tried on all rows.

        Args:
            other: The fit to compare with, on the same rows.
            impossible: The property `impossible` of the other fit on all rows.
        """
        times = other.residual_share / self.residual_share
        possible = self.impossible < max(impossible, other.impossible)
        return possible or bool(np.any(times >= SCREEN_TIMES))

    def overfits(self, held_out: WiringTrial) -> bool:
        """Return True if errors on held-out parts show that the fit has too few data."""
        return bool(np.nanmedian(held_out.residual_share / self.residual_share) > FEW_DATA_TIMES)

    @property
    def impossible(self) -> int:
        """Number of joints with driving friction, plus one if the arm's weight is negative."""
        return int(np.sum(self.driving)) + int(self.weight < 0.0)

    @property
    def cost(self) -> float:
        """Sum of the logarithms of `residual_share`, plus a cost for each impossible result."""
        shares = np.log(self.residual_share)
        return float(np.nansum(shares) + IMPOSSIBLE_COST * self.impossible)


@dataclass(frozen=True, eq=False)
class CondensedEquations:
    """Sums of products of columns, from which least squares can be solved without the rows.

    Attributes:
        products: Shape (parts, n, p + n, p + n). For each part of the recordings and each joint
            [Phi T]^T [Phi T], with its regressor Phi and the torques T of all joints.
        rows: Shape (n,). Number of rows used of each joint.
        brakes: Shape (n, p). Power of each friction parameter of a joint, per unit of the parameter
            [W].
        power: Shape (n, n). For each joint the sum of |speed x torque| with every joint's torque
            [W].
        drawn_weight: Computation of the arm's weight in a fit; None if it is not needed.
    """

    products: FloatArray
    rows: FloatArray
    brakes: FloatArray
    power: FloatArray
    drawn_weight: DrawnWeight | None = None

    @classmethod
    def of(cls, signals: WiredSignals, screened_by: RobotModel | None = None) -> CondensedEquations:
        """Evaluate a robot's regressor, with Coulomb and viscous friction and an offset.

        Args:
            signals: Motion, torques and robot.
            screened_by: The robot's model, for equations without parts and without the arm's
                weight, which are enough for `trial`.
        """
        model = screened_by or plain_model(signals)
        phi, use = regressor(model, *signals.joints()), rows_used(signals)
        rows = len(signals.position)
        parts = parts_of(rows) if screened_by is None else [slice(0, rows)]
        n, p = phi.shape[1:]
        products = np.zeros((len(parts), n, p + n, p + n))
        for j in range(n):
            columns = np.column_stack([phi[:, j], signals.torque_nm])[use[:, j]]
            own = np.flatnonzero(columns.any(axis=0))  # links before a joint have no columns
            columns = columns[:, own]
            used = [int(np.count_nonzero(use[part, j])) for part in parts]
            ends = np.cumsum([0, *used]).tolist()
            for part, (first, end) in enumerate(pairwise(ends)):
                block = columns[first:end]
                products[part, j][np.ix_(own, own)] = block.T @ block
        brakes, power = friction_power(signals, model, phi, use)
        drawn_weight = DrawnWeight.of(signals, model) if screened_by is None else None
        return cls(products, use.sum(axis=0).astype(np.float64), brakes, power, drawn_weight)

    def trial(self, torque: FloatArray) -> WiringTrial:
        """Fit the robot to `torque` (n, n) times the stated torques; joints have equal weights."""
        whole = self.products.sum(axis=0)
        values, sizes = self._fit(whole, torque)
        left = self._squared_residuals(whole, values, torque)
        shares = _as_shares(left, sizes, self.rows)
        return WiringTrial(shares, self._driving(values, torque), self._weight(values))

    def held_out(self, torque: FloatArray) -> WiringTrial:
        """Return the quality of the prediction of each part by a fit to the others.

        A joint counts as driving if its friction has negative power in every one of these fits, and
        if the model explains its torque. `weight` is the arm's weight plus two standard deviations.
        """
        whole = self.products.sum(axis=0)
        values, sizes = self._fit(whole, torque)
        left, driving = np.zeros(len(whole)), self._driving(values, torque)
        for part in self.products:
            values, _ = self._fit(whole - part, torque)
            left += self._squared_residuals(part, values, torque)
            driving &= self._driving(values, torque)
        shares = np.minimum(_as_shares(left, sizes, self.rows), 1.0)
        weight = self.arm_weight(torque)
        surest = math.nan if weight is None else weight.share + 2.0 * weight.sigma
        return WiringTrial(shares, driving & (shares < EXPLAINED_SHARE), surest)

    def arm_weight(self, torque: FloatArray) -> ArmWeight | None:
        """Return the arm's weight, fitted to the stated torques multiplied by `torque` (n, n)."""
        if self.drawn_weight is None or not self.drawn_weight.is_visible:
            return None
        whole = self.products.sum(axis=0)
        values, parts = self.fits(torque)
        sizes = self._sizes(whole, torque)
        noise = self.scatter(np.array([self.drawn_weight.share(each) for each in parts]))
        doubt = float(np.linalg.norm(self.drawn_weight.doubt * values))
        left = float(np.sum(_inverse(sizes) * self._squared_residuals(whole, values, torque)))
        more = math.sqrt(UNSEEN_RISE * left * self._weight_variance(whole, sizes)) / 2.0
        return ArmWeight(
            share=self.drawn_weight.share(values),
            sigma=math.hypot(noise, more, doubt),
            plausible=self.drawn_weight.plausible,
            is_drawn=self.drawn_weight.is_drawn,
        )

    def fits(self, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the parameters (p,) fitted to all parts, and to all but one part (parts, p)."""
        whole = self.products.sum(axis=0)
        parts = [self._fit(whole - part, torque)[0] for part in self.products]
        return self._fit(whole, torque)[0], np.array(parts)

    def scatter(self, values: FloatArray) -> float:
        """Return the standard deviation of a result, from its values without one part (parts,)."""
        return math.sqrt((len(self.products) - 1.0) * float(np.var(values)))

    def explains_weight(self, held_out: WiringTrial) -> bool:
        """Return True if the fit explains the torques of all joints that gravity loads."""
        if self.drawn_weight is None or not self.drawn_weight.is_visible:
            return False
        return bool(
            np.all(held_out.residual_share[self.drawn_weight.drawn > 0.0] < EXPLAINED_SHARE)
        )

    def supports_weight(self, mistake: Mistake, torque: FloatArray) -> bool:
        """Return True if the torques support the arm's known weight after a mistake is corrected.

        For a wrong unit of all torques the weight of the whole arm must be plausible. For other
        mistakes the weight carried by each changed joint must be roughly right.
        """
        if self.drawn_weight is None or not self.drawn_weight.is_visible:
            return True
        values, _ = self._fit(self.products.sum(axis=0), torque)
        low, high = self.drawn_weight.plausible
        if mistake.kind is MistakeKind.TORQUE_UNIT:
            return low <= self.drawn_weight.share(values) <= high
        shares = self.drawn_weight.shares(values)[list(mistake.changed)]
        return not bool(np.any((shares < low / HOLDS_TIMES) | (shares > HOLDS_TIMES * high)))

    def _weight(self, values: FloatArray) -> float:
        return math.nan if self.drawn_weight is None else self.drawn_weight.share(values)

    def _fit(self, products: FloatArray, torque: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the least-squares parameters, and the joints' sums of squared torques."""
        p, sizes = self.brakes.shape[1], self._sizes(products, torque)
        rhs = np.einsum("j,jpk,jk->p", _inverse(sizes), products[:, :p, p:], torque)
        return self._solve(products, sizes, rhs), sizes

    def _sizes(self, products: FloatArray, torque: FloatArray) -> FloatArray:
        """Return the joints' sums of squared torques; 0 for a joint with too few rows."""
        p = self.brakes.shape[1]
        sizes = np.einsum("ji,jik,jk->j", torque, products[:, p:, p:], torque)
        sizes[self.rows < FEWEST_ROWS] = 0.0
        return np.asarray(sizes)

    def _solve(self, products: FloatArray, sizes: FloatArray, rhs: FloatArray) -> FloatArray:
        """Return the solution of the normal equations; weights are one over `sizes`."""
        p = self.brakes.shape[1]
        gram = np.tensordot(_inverse(sizes), products[:, :p, :p], axes=1)
        scale = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
        scaled = gram / scale / scale[:, np.newaxis]
        factor = cho_factor(scaled + RIDGE * np.eye(p), check_finite=False)
        return np.asarray(cho_solve(factor, rhs / scale, check_finite=False) / scale)

    def _weight_variance(self, products: FloatArray, sizes: FloatArray) -> float:
        """Return the variance of the arm's weight in a fit, per unit variance of the residual."""
        assert self.drawn_weight is not None
        columns = np.sum(self.drawn_weight.columns, axis=0) / np.sum(self.drawn_weight.drawn)
        return max(float(columns @ self._solve(products, sizes, columns)), 0.0)

    def _squared_residuals(
        self, products: FloatArray, values: FloatArray, torque: FloatArray
    ) -> FloatArray:
        """Return each joint's sum of squared residuals, shape (n,)."""
        whole = np.column_stack([np.tile(values, (len(torque), 1)), -torque])
        left = np.einsum("jp,jpq,jq->j", whole, products, whole, optimize=True)
        return np.asarray(np.maximum(left, 0.0))

    def _driving(self, values: FloatArray, torque: FloatArray) -> BoolArray:
        most = np.sum(np.abs(torque) * self.power, axis=1)
        driving = self.brakes @ values < -DRIVING_SHARE * most
        return np.asarray(driving & (self.rows >= FEWEST_ROWS))


def _inverse(sizes: FloatArray) -> FloatArray:
    """Return the joints' weights: one over the sum of squared torques, or 0 if that is 0."""
    weight = np.zeros(len(sizes))
    np.divide(1.0, sizes, out=weight, where=sizes > 0.0)
    return weight


def friction_power(
    signals: WiredSignals, model: RobotModel, phi: FloatArray, use: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return `CondensedEquations.brakes` and `CondensedEquations.power` of the used rows."""
    braking = np.array([name.startswith(BRAKES) for name in model.parameter_names])
    speed = signals.velocity * use
    brakes = np.einsum("rj,rjp->jp", speed, phi) * braking
    return brakes, np.abs(speed).T @ np.abs(signals.torque_nm)


def parts_of(rows: int) -> list[slice]:
    """Return the five parts into which all rows are divided, one after the other."""
    ends = np.linspace(0, rows, PARTS + 1).astype(int).tolist()
    return [slice(*pair) for pair in pairwise(ends)]


def rows_used(signals: WiredSignals) -> BoolArray:
    """Return a mask of the usable rows of each joint, (rows, n): those at which it moves."""
    speed = signals.velocity
    slowest = SLOW_SHARE * np.sqrt(
        np.mean(np.square(speed), axis=0)
    )  # a threshold that does not depend on the unit
    return np.asarray((np.abs(speed) > slowest) & signals.moving)


def plain_model(signals: WiredSignals) -> RobotModel:
    """Return the model with simple friction with which mistakes are searched."""
    options = ModelOptions(friction_terms=("coulomb", "viscous", "offset"))
    return replace(options.build(signals.robot), transmission=Transmission())


def _as_shares(left: FloatArray, sizes: FloatArray, rows: FloatArray) -> FloatArray:
    shares = np.full(len(left), np.nan)
    counted = (rows >= FEWEST_ROWS) & (sizes > 0.0)
    shares[counted] = np.maximum(np.sqrt(left[counted] / sizes[counted]), SMALLEST_SHARE)
    return shares
