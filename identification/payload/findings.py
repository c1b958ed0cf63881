"""Findings on payload quantities that a motion determines badly, and better motions for them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.formats.interval import plus_minus
from dynamics.terms.conditions import Conditions
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.accuracy.identifiability import joint_motions
from identification.choices import REPORTED
from identification.model.options import ModelOptions
from identification.model.torque_columns import torque_columns
from identification.payload.body import PARAMETERS, REPORTED_UNITS, reported_slopes
from identification.payload.equations import PayloadModel
from identification.payload.estimate import PayloadEstimate

WEAK_MASS_SHARE: Final = 0.05
WEAK_CENTRE_M: Final = 0.01
WEAK_INERTIA_SHARE: Final = 0.2
SIMPLER: Final = 1.2
SMALLEST_GAIN: Final = 1.5
SHOWN: Final = 1e-6


@dataclass(frozen=True)
class PayloadFinding:
    """A quantity of the payload that the motion determines badly, or not at all.

    Attributes:
        name, unit: Name and unit of the quantity.
        value, sigma: Its estimate and cluster-robust standard deviation; None if the motion does
            not determine it.
        motion: The motion that would determine it best, in words; empty if no tried motion
            determines it, or makes its interval at least `SMALLEST_GAIN` times smaller.
        gain: Factor by which its standard deviation would fall; None if it is not yet determined.
    """

    name: str
    unit: str
    value: float | None
    sigma: float | None
    motion: str
    gain: float | None

    @property
    def sentence(self) -> str:
        """The quantity, its interval and the motion to add, in one sentence."""
        if self.value is None or self.sigma is None:
            text = f"{self.name} is not determined by this motion"
            if not self.motion:
                return (
                    f"{text}, nor by any motion of one or two joints; measure it separately, and"
                    " state the value with --known"
                )
            return f"{text}; {self.motion} would determine it"
        value = f"{self.name} = {plus_minus(self.value, 2.0 * self.sigma, self.unit)}"
        text = f"{value} is poorly determined"
        if not self.motion or self.gain is None:
            return f"{text}; no motion of one or two joints would determine it much better"
        return (
            f"{text}; further runs of the same length, {self.motion}, would make the interval"
            f" {self.gain:.1f} times smaller"
        )


def largest_moment(estimate: PayloadEstimate) -> float:
    """Return the largest moment of inertia about the flange, as reference for intervals [kg m^2].

    A controller needs the inertia about the wrist's axes, which includes that due to the distance
    from the flange. Therefore intervals of the inertia are compared with the moment about the
    flange.
    """
    xx, xy, xz, yy, yz, zz = estimate.values[4:]
    moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return float(max(moments[-1], 1e-6))


def payload_findings(estimate: PayloadEstimate) -> tuple[PayloadFinding, ...]:
    """Return undetermined and poorly determined quantities, with better motions for them.

    Poorly determined means that 2 sigma are more than 5 % of the mass, 10 mm of the centre of
    gravity, or 20 % of the inertia about the flange. The candidate motions are those of
    `joint_motions`. A candidate counts as a further pair of runs that is as long as the present one
    and has the same residual spectrum.
    """
    limits = np.concatenate(
        [
            [WEAK_MASS_SHARE * max(abs(float(estimate.values[0])), 1e-3)],
            np.full(3, WEAK_CENTRE_M),
            np.full(6, WEAK_INERTIA_SHARE * largest_moment(estimate)),
        ]
    )
    seen = np.array(estimate.is_determined)
    unseen_ones = [i for i in range(PARAMETERS_PER_LINK) if not estimate.is_parameter_determined[i]]
    weak = [i for i in np.flatnonzero(seen) if 2.0 * estimate.sigma[i] > limits[i]]
    if not unseen_ones and not weak:
        return ()
    tried = _candidate_information(estimate)
    found = [_undetermined_finding(estimate, i, tried) for i in unseen_ones]
    found += [_weak_finding(estimate, int(i), tried) for i in weak]
    return tuple(found)


Tried = list[tuple[str, FloatArray]]


def _candidate_information(estimate: PayloadEstimate) -> Tried:
    """Return candidate motions in words, and the information that each would add, (10, 10)."""
    model = PayloadModel.of(estimate.robot, ModelOptions(rotors=False, spring=False))
    noise = np.maximum(estimate.residual_nm, 1e-6 * max(float(estimate.residual_nm.max()), 1e-9))
    b, ten = len(model.base), PARAMETERS_PER_LINK
    warm = Conditions(temperature_k=np.full(model.model.chain.n, 300.0), payload=True)
    lossless = model.model
    white = np.diagonal(estimate.covariance_noise)
    clustered = np.diagonal(estimate.covariance)
    shown = clustered > 0.0
    colour = min(1.0, float(np.median(white[shown] / clustered[shown]))) if shown.any() else 1.0
    tried: Tried = []
    for words, motion in joint_motions(estimate.robot):
        columns = torque_columns(lossless, model.base, motion, warm)
        columns = (columns / noise[:, np.newaxis]).reshape(-1, b)
        friction = columns[:, model.friction]
        payload = columns[:, b - ten :] @ model.flange_to_link
        moving = friction[:, np.linalg.norm(friction, axis=0) > 0.0]
        basis = _range(moving)
        rest = payload - basis @ (basis.T @ payload)
        weight = colour * estimate.equations / len(rest)
        tried.append((words, weight * rest.T @ rest))
    return tried


def _range(matrix: FloatArray) -> FloatArray:
    if not matrix.shape[1]:
        return np.zeros((len(matrix), 0))
    left, size, _ = np.linalg.svd(matrix, full_matrices=False)
    return np.asarray(left[:, size > 1e-9 * size[0]])


def _undetermined_finding(estimate: PayloadEstimate, index: int, tried: Tried) -> PayloadFinding:
    """Find the motion that determines one of `PARAMETERS` that is undetermined."""
    target = np.eye(PARAMETERS_PER_LINK)[index]
    best, smallest = "", np.inf
    for words, more in tried:
        sigma = _sigma_with(estimate, more, target)
        if (
            sigma * SIMPLER < smallest
        ):  # simpler motions come first; a later one must be clearly better
            best, smallest = words, sigma
    name = f"{PARAMETERS[index]} (about the flange)" if index > 3 else PARAMETERS[index]
    unit = "kg" if index == 0 else "kg m" if index < 4 else "kg m^2"
    return PayloadFinding(name, unit, None, None, best, None)


def _weak_finding(estimate: PayloadEstimate, index: int, tried: Tried) -> PayloadFinding:
    """Find the motion that determines one of `REPORTED` better."""
    target = reported_slopes(estimate.values)[index]
    now = float(estimate.sigma[index])
    best, smallest = "", now
    for words, more in tried:
        sigma = _sigma_with(estimate, more, target)
        if sigma * SIMPLER < smallest:
            best, smallest = words, sigma
    gain = now / smallest
    return PayloadFinding(
        name=REPORTED[index],
        unit=REPORTED_UNITS[index],
        value=float(estimate.reported[index]),
        sigma=now,
        motion=best if gain >= SMALLEST_GAIN else "",
        gain=gain if gain >= SMALLEST_GAIN else None,
    )


def _sigma_with(estimate: PayloadEstimate, more: FloatArray, target: FloatArray) -> float:
    """Return the standard deviation of target . theta with more data; inf if undetermined."""
    scale = 1.0 / np.sqrt(np.maximum(np.diagonal(more), 0.0) + _size_of(estimate))
    known = _information(estimate)
    total = (known + more) * np.outer(scale, scale)
    values, axes = np.linalg.eigh(total)
    shown = values > SHOWN * values[-1]
    aim = scale * target
    hidden = axes[:, ~shown].T @ aim
    if np.linalg.norm(hidden) > 1e-3 * np.linalg.norm(aim):
        return float(np.inf)
    return float(np.sqrt(np.sum((axes[:, shown].T @ aim) ** 2 / values[shown])))


def _size_of(estimate: PayloadEstimate) -> FloatArray:
    diagonal = np.diagonal(_information(estimate))
    return np.asarray(np.maximum(diagonal, 1e-12))


def _information(estimate: PayloadEstimate) -> FloatArray:
    """Return the inverse cluster-robust covariance in the determined directions, zero elsewhere."""
    hidden = estimate.unseen
    project = np.eye(PARAMETERS_PER_LINK) - hidden @ hidden.T
    sigma = np.sqrt(np.maximum(np.diagonal(estimate.covariance), 1e-30))
    scaled = estimate.covariance / np.outer(sigma, sigma)
    inverse = np.linalg.pinv(scaled + 1e-9 * np.eye(PARAMETERS_PER_LINK), hermitian=True)
    return np.asarray(project @ (inverse / np.outer(sigma, sigma)) @ project)
