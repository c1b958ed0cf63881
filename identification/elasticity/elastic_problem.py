"""`ElasticProblem`: residuals of all runs of an arm with elastic gears, as one vector.

The friction of each run and joint is eliminated by projection (variable projection, Golub and
Pereyra 1973). Each channel of a run has its own weight.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final

import numpy as np

from acquisition.signals.bins import Bins
from config.arrays import BoolArray, FloatArray
from dynamics.model.robot_model import regressor
from identification.elasticity.elastic_arm import ElasticArm
from identification.elasticity.elastic_runs import ExcitationBins, MultisineBins, multisine_torque
from identification.elasticity.instrument_unknowns import InstrumentUnknowns
from identification.elasticity.levenberg_marquardt import Minimum
from identification.elasticity.link_motion import Gears, solve_links

LOSS_S: Final = 1e-3
"""Start value of the ratio of damping to stiffness, d/k, and its unit in the fit [s]."""
STIFFNESS_WIDTH, LOSS_WIDTH, ROTOR_WIDTH = 2.0, 5.0, 1.0
"""Standard deviations of the weak priors of log k, d/k in units of `LOSS_S`, and log rotor."""


@dataclass(frozen=True)
class Channel:
    """Residuals of one measured channel of a run.

    Attributes:
        run: Index of the run.
        name: `torque`, `plate`, `tracker` or `encoder` (on the link side).
        index: Index of the joint, of the component of the wrench, or of the instrument's channel.
        size: Number of residuals.
    """

    run: int
    name: str
    index: int
    size: int

    @property
    def is_link_side(self) -> bool:
        """True for an instrument on the link side of the gears."""
        return self.name in ("tracker", "encoder")


@dataclass(frozen=True, eq=False)
class ElasticProblem:
    """Runs with their weights, and the point from which the fit starts.

    The vector of unknowns contains, in this order: log(k / start), d/k in units of `LOSS_S`,
    log(rotor / start), the changes of the base parameters over `scale`, and the delay of the plate
    in each run with a plate [ms].

    Attributes:
        arm: Structure of the arm.
        excitations, multisines: The runs.
        start: Parameters at the beginning of the fit.
        sigma: Standard deviation of the residuals of each channel, in the order of `channels`.
        scale: Shape (b,). Size of a typical change of each base parameter.
        inertia: Shape (n,). Mean inertia of the links about each joint at the start.
        instruments: Unknowns of the instruments on the link side of the gears.
    """

    arm: ElasticArm
    excitations: tuple[ExcitationBins, ...]
    multisines: tuple[MultisineBins, ...]
    start: Gears
    sigma: FloatArray
    scale: FloatArray
    inertia: FloatArray
    instruments: InstrumentUnknowns

    @classmethod
    def of(
        cls,
        arm: ElasticArm,
        excitations: Sequence[ExcitationBins],
        multisines: Sequence[MultisineBins],
        start: Gears,
    ) -> ElasticProblem:
        """Return the problem with the weights of the measured noise."""
        poses = np.concatenate([np.fft.irfft(run.theta * 16, n=16, axis=0) for run in excitations])
        mean = poses.mean(axis=0, keepdims=True)
        zero = np.zeros_like(mean)
        at_rest = arm.base.columns(regressor(arm.links, mean, zero, zero))
        inertia = []
        for j in range(arm.n):
            unit = zero.copy()
            unit[0, j] = 1.0
            column = arm.base.columns(regressor(arm.links, mean, zero, unit)) - at_rest
            inertia.append(max(float(column[0, j] @ start.body), 1e-6))
        phi = np.abs(arm.base.columns(regressor(arm.links, poses, poses * 0.0, poses * 0.0 + 1.0)))
        size = np.sqrt(np.mean(phi**2, axis=(0, 1)))
        torque = np.sqrt(np.mean([np.mean(np.abs(run.torque) ** 2) for run in excitations]))
        return cls(
            arm,
            tuple(excitations),
            tuple(multisines),
            start,
            _channel_noise(excitations, multisines),
            torque / np.maximum(size, 1e-3 * size.max()),
            np.array(inertia),
            InstrumentUnknowns.of(excitations),
        )

    @property
    def runs(self) -> tuple[ExcitationBins | MultisineBins, ...]:
        """All runs, first those with large motion."""
        return (*self.excitations, *self.multisines)

    @property
    def delays(self) -> int:
        """Number of runs with a plate."""
        return sum(run.plate is not None for run in self.excitations)

    @property
    def unknowns(self) -> int:
        """Number of unknowns."""
        return 3 * self.arm.n + len(self.arm.base) + self.delays

    @property
    def at_start(self) -> FloatArray:
        """The vector of unknowns at the start."""
        x = np.zeros(self.unknowns)
        n = self.arm.n
        x[n : 2 * n] = self.start.damping / self.start.stiffness / LOSS_S
        return x

    @cached_property
    def channels(self) -> tuple[Channel, ...]:
        """The channels, run by run."""
        found = []
        for number, run in enumerate(self.runs):
            size = 2 * len(run.torque)
            found += [Channel(number, "torque", j, size) for j in range(self.arm.n)]
            if isinstance(run, ExcitationBins) and run.plate is not None:
                found += [Channel(number, "plate", c, size) for c in range(6)]
            if isinstance(run, ExcitationBins):
                for each in run.link_side:
                    size, width = 2 * len(each.bins), each.bins.shape[1]
                    found += [Channel(number, each.name, c, size) for c in range(width)]
        return tuple(found)

    @cached_property
    def link_side_rows(self) -> BoolArray:
        """Mask of the residuals of instruments on the link side; the priors are not included."""
        return np.concatenate([np.full(each.size, each.is_link_side) for each in self.channels])

    @cached_property
    def run_rows(self) -> tuple[BoolArray, ...]:
        """For each run, a mask of its residuals; the rows of the priors belong to no run."""
        runs = np.concatenate([np.full(each.size, each.run) for each in self.channels])
        runs = np.concatenate([runs, np.full(3 * self.arm.n, -1)])
        return tuple(runs == number for number in range(runs.max() + 1))

    def gears(self, x: FloatArray) -> Gears:
        """Return the parameters of a vector of unknowns."""
        n, b = self.arm.n, len(self.arm.base)
        stiffness = self.start.stiffness * np.exp(np.clip(x[:n], -5.0, 5.0))
        return Gears(
            stiffness,
            stiffness * LOSS_S * x[n : 2 * n],
            self.start.rotor * np.exp(np.clip(x[2 * n : 3 * n], -5.0, 5.0)),
            self.start.body + self.scale * x[3 * n : 3 * n + b],
        )

    def residuals(self, x: FloatArray, bent: list[Bins | None] | None = None) -> FloatArray:
        """Return the weighted residuals of all channels, and those of the weak priors.

        Args:
            bent: Deflections of the excitation runs to start from; overwritten. None for zero.
        """
        gears, n = self.gears(x), self.arm.n
        delays = iter(x[self.unknowns - self.delays :].tolist())
        parts: list[FloatArray] = []
        for number, run in enumerate(self.excitations):
            start = bent[number] if bent else None
            predicted, wrench, deflection, q = self._excitation(run, gears, start)
            if bent:
                bent[number] = deflection
            parts += self._without_friction(number, run.torque - predicted)
            if run.plate is not None and wrench is not None:
                omega = 2.0 * math.pi / run.period_s * np.arange(1, len(run.torque) + 1)
                late = np.exp(-1j * omega * 1e-3 * next(delays))
                parts += list(_rows(run.plate.wrench - wrench * late[:, np.newaxis]).T)
            for each in run.link_side:
                parts += list(_rows(each.bins - each.predicted(q, run.period_s)).T)
        for number, multisine in enumerate(self.multisines, start=len(self.excitations)):
            left = multisine.torque - multisine_torque(multisine, gears)
            parts += self._without_friction(number, left)
        prior = [
            x[:n] / STIFFNESS_WIDTH,
            (x[n : 2 * n] - 1.0) / LOSS_WIDTH,
            x[2 * n : 3 * n] / ROTOR_WIDTH,
        ]
        weighted = np.concatenate(
            [part / sigma for part, sigma in zip(parts, self.sigma, strict=True)]
        )
        if self._instruments.size:
            left = weighted[self.link_side_rows]
            weighted[self.link_side_rows] = left - self._instruments @ (self._instruments.T @ left)
        return np.concatenate([weighted, *prior])

    def renewed(self, found: Minimum) -> ElasticProblem:
        """Return the problem with new weights and new values of the instruments' unknowns.

        Both are computed at a minimum. A channel's weight is one over its RMS residual or, if that
        is larger, over its noise.
        """
        noises = _channel_noise(self.excitations, self.multisines)
        sigma, first = [], 0
        for each, old, noise in zip(self.channels, self.sigma, noises, strict=True):
            rms = float(np.sqrt(np.mean(found.residuals[first : first + each.size] ** 2)))
            first += each.size
            sigma.append(max(noise, old * rms))
        excitations = self.excitations
        if self.link_side_rows.any():
            left = self._link_side_residual(self.gears(found.x))
            excitations = self.instruments.renewed(excitations, left, self._link_side_sigma)
        return replace(self, sigma=np.array(sigma), excitations=excitations)

    def tool_residual_m(self, found: Minimum) -> float | None:
        """Return the RMS distance of trackers from the fitted points [m]; None without a tracker.

        The unknowns of the instruments have the values that fit best. The constant part of the
        distance is not included.
        """
        power, periods, first = 0.0, 0, 0
        for each, sigma in zip(self.channels, self.sigma, strict=True):
            own = found.residuals[first : first + each.size] * sigma
            first += each.size
            if each.name == "tracker":
                power += 2.0 * float(own @ own)
                periods += each.index == 0
        return math.sqrt(power / periods) if periods else None

    def link_side_mismatch(self, found: Minimum) -> float:
        """Return the largest share of a deflection that the fit does not explain.

        The share is the RMS residual of an instrument in a run, without the instrument's noise,
        divided by the RMS deflection that the fit predicts for this instrument. Without an
        instrument the share is 0.
        """
        if not self.link_side_rows.any():
            return 0.0
        gears = self.gears(found.x)
        deflections: list[FloatArray] = []
        for run in self.excitations:
            q, theta = self._excitation(run, gears, None)[3], run.motors
            for each in run.link_side:
                bins = each.predicted(theta, run.period_s) - each.predicted(q, run.period_s)
                deflections.append(_rows(bins).T.ravel())
        bent = np.concatenate(deflections) / self._link_side_sigma
        bent -= self._instruments @ (self._instruments.T @ bent)
        left = found.residuals[: len(self.link_side_rows)][self.link_side_rows]
        noises = _channel_noise(self.excitations, self.multisines)
        sizes: list[list[float]] = []
        first = 0
        for channel, sigma, noise in zip(self.channels, self.sigma, noises, strict=True):
            if not channel.is_link_side:
                continue
            if channel.index == 0:
                sizes.append([0.0, 0.0])
            rows = slice(first, first + channel.size)
            first += channel.size
            sizes[-1][0] += float(bent[rows] @ bent[rows])
            sizes[-1][1] += float(left[rows] @ left[rows]) - channel.size * (noise / sigma) ** 2
        return max(math.sqrt(max(more, 0.0) / max(seen, 1e-300)) for seen, more in sizes)

    def _excitation(
        self, run: ExcitationBins, gears: Gears, start: Bins | None
    ) -> tuple[Bins, Bins | None, Bins, FloatArray]:
        """Return torques and base wrench on bins 1 to H, deflection's bins, and link positions."""
        motion, bent, torque, _ = solve_links(
            self.arm, gears, run.theta, run.period_s, run.rows, self.inertia, start
        )
        used = slice(1, len(run.torque) + 1)
        motors = self.arm.motor_torque(motion, gears.rotor)
        predicted = torque[used] + np.fft.rfft(motors, axis=0)[used] / run.rows
        wrench = None
        if run.plate is not None:
            values = self.arm.base_wrench(motion, gears.body, gears.rotor)
            wrench = np.asarray(np.fft.rfft(values, axis=0)[used] / run.rows)
        return predicted, wrench, bent, motion.q

    def _link_side_residual(self, gears: Gears) -> FloatArray:
        """Return measured minus predicted values of the instruments, without projection."""
        parts: list[FloatArray] = []
        for run in self.excitations:
            q = self._excitation(run, gears, None)[3]
            parts.extend(
                _rows(each.bins - each.predicted(q, run.period_s)).T.ravel()
                for each in run.link_side
            )
        return np.concatenate(parts)

    @cached_property
    def _link_side_sigma(self) -> FloatArray:
        return np.concatenate(
            [
                np.full(each.size, sigma)
                for each, sigma in zip(self.channels, self.sigma, strict=True)
                if each.is_link_side
            ]
        )

    @cached_property
    def _instruments(self) -> FloatArray:
        """Orthonormal basis of the weighted residuals that the instruments' unknowns can cause."""
        if not self.link_side_rows.any():
            return np.zeros((0, 0))
        return self.instruments.basis(self.excitations, self._link_side_sigma)

    def friction_of(self, run: int, joint: int, left: Bins) -> Bins:
        """Return the part of a joint's residual (H,) that friction can explain."""
        basis = self._friction[run][joint]
        rows = basis @ (basis.T @ np.concatenate([left.real, left.imag]))
        return np.asarray(rows[: len(left)] + 1j * rows[len(left) :])

    def multisine_mismatch(self, gears: Gears, joint: int, stiffness: FloatArray) -> FloatArray:
        """Return the share of a joint's torque that gears and friction do not explain, (tries,).

        The share is that of the RMS in all multisine runs.

        Args:
            stiffness: Shape (tries,). Values of the joint's stiffness; the damping is `LOSS_S`
                times the stiffness.
        """
        left, size = np.zeros(len(stiffness)), 0.0
        for number, run in enumerate(self.multisines, start=len(self.excitations)):
            tries = np.tile(gears.stiffness, (len(stiffness), 1))
            tries[:, joint] = stiffness
            torque = multisine_torque(run, replace(gears, stiffness=tries, damping=LOSS_S * tries))
            basis = self._friction[number][joint]
            rows = _rows((run.torque[:, joint] - torque[..., joint]).T)
            left += np.sum((rows - basis @ (basis.T @ rows)) ** 2, axis=0)
            measured = _rows(run.torque[:, joint])
            size += float(np.sum((measured - basis @ (basis.T @ measured)) ** 2))
        return np.sqrt(left / size)

    def _without_friction(self, run: int, left: Bins) -> list[FloatArray]:
        """Return the residuals of each joint without the part that friction can explain."""
        rows = _rows(left)
        found = []
        for j, basis in enumerate(self._friction[run]):
            found.append(rows[:, j] - basis @ (basis.T @ rows[:, j]))
        return found

    @cached_property
    def _friction(self) -> tuple[tuple[FloatArray, ...], ...]:
        """Orthonormal bases of the friction functions, for each run and joint."""
        found = []
        for run in self.runs:
            of_run = []
            for j in range(self.arm.n):
                columns = _rows(run.friction[:, j])
                size = np.linalg.norm(columns, axis=0)
                columns = columns[:, size > 0.0] / size[size > 0.0]
                basis, values, _ = np.linalg.svd(columns, full_matrices=False)
                of_run.append(basis[:, values > 1e-6 * values[:1]])
            found.append(tuple(of_run))
        return tuple(found)


def _channel_noise(
    excitations: Sequence[ExcitationBins], multisines: Sequence[MultisineBins]
) -> FloatArray:
    """Return the standard deviation of the measured noise of each channel."""
    sigma: list[FloatArray] = []
    for run in excitations:
        sigma.append(run.sigma)
        if run.plate is not None:
            sigma.append(run.plate.sigma)
        sigma += [each.sigma for each in run.link_side]
    return np.concatenate([*sigma, *(run.sigma for run in multisines)])


def _rows(bins: Bins) -> FloatArray:
    """Return complex bins (H, any) as real rows (2 H, any)."""
    return np.concatenate([bins.real, bins.imag])
