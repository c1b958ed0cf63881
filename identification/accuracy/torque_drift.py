"""`find_torque_drifts`: torques that change in the course of a recording.

A model without time explains a drift of a torque sensor, of a current's zero or of friction by
wrong parameters. Residuals of neighbouring seconds then have the same sign, so the intervals are
too narrow. Three changes in proportion to time are tested for each joint of each recording: an
offset, Coulomb friction, and a factor of the whole torque.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

import numpy as np
from scipy.special import stdtr

from config.arrays import FloatArray, IntArray
from identification.equations.time_domain import TimeBlock, rows_by_event
from identification.estimation.fitted_signals import FittedSignals
from identification.model.torque_columns import torque_structure

PARTS: Final = 15
"""Number of parts of a recording whose errors count as independent."""
FEWEST_PARTS: Final = 8
SIGNIFICANT_P: Final = 1e-6
"""Largest p-value of a drift: sound robots also have small effects that are slow."""
MATERIAL_SIGMAS: Final = 1.0
"""Smallest bias of a parameter that matters, in standard deviations: half its 95 % interval."""
OUTSIDE_SIGMAS: Final = 2.0
"""Distance from an estimate at which a value is outside its 95 % interval [standard deviations]."""
EXPLAINED: Final = 1e-6
"""Smallest fraction of a drift's sum of squares that the model must leave unexplained; a drift that
the parameters can imitate is not tested.
"""


class DriftKind(Enum):
    """Part of a torque that changes in proportion to time."""

    OFFSET = "offset"
    FRICTION = "Coulomb friction"
    FACTOR = "scale"


@dataclass(frozen=True)
class TorqueDrift:
    """A torque that changes in the course of a recording.

    Attributes:
        joint, unit: The joint, and the unit of its torque.
        recording: Index of the recording.
        kind: Part of the torque that changes.
        change: Change from the begin to the end of the recording [`unit`; 1 for the scale].
        parameter: Base parameter that changes most if the drift is part of the model.
        sigmas: Change of this parameter [standard deviations].
        end_sigmas: Distance of the joint's offset or Coulomb friction at the ends of the recording
            from its estimate [standard deviations]; 0 for the scale, and if the model lacks it.
    """

    joint: str
    unit: str
    recording: int
    kind: DriftKind
    change: float
    parameter: str
    sigmas: float
    end_sigmas: float

    @property
    def is_material(self) -> bool:
        """True if a parameter is biased, or is outside its interval at the ends."""
        return self.sigmas > MATERIAL_SIGMAS or self.end_sigmas > OUTSIDE_SIGMAS

    @property
    def sentence(self) -> str:
        """The drift and its effect, without the name of the recording and without a full stop."""
        size = f"{abs(self.change):.2g} {self.unit}"
        if self.kind is DriftKind.FACTOR:
            size = f"{100.0 * abs(self.change):.2g} %"
        way = "rises" if self.change > 0.0 else "falls"
        effect = (
            f"Without this drift, {self.parameter} would differ by {self.sigmas:.2g} standard"
            " deviations"
            if self.sigmas > MATERIAL_SIGMAS
            else f"At the ends of the recording, the {self.kind.value} is {self.end_sigmas:.2g}"
            " standard deviations from its estimate"
        )
        return (
            f"the {self.kind.value} of {self.joint}'s torque {way} by {size} in the course of the"
            f" recording. {effect}, so the intervals are too narrow. Look for a drifting sensor or"
            " current, or for a joint that warms up, and record again"
        )


@dataclass(frozen=True, eq=False)
class _Normal:
    """Normal equations of a part of a recording, all joints, in units of the joints' residuals.

    Attributes:
        gram: Shape (p, p). Products of the columns.
        score: Shape (p,). Products of the columns with the residuals.
        beside: Shape (n, kinds, p). Products of the drifts with the columns.
        size: Shape (n, kinds). Sum of squares of each drift.
        residual: Shape (n, kinds). Products of the drifts with the residuals.
    """

    gram: FloatArray
    score: FloatArray
    beside: FloatArray
    size: FloatArray
    residual: FloatArray

    @classmethod
    def zeros(cls, n: int, p: int) -> _Normal:
        """Return equations without rows for n joints and p columns."""
        kinds = len(DriftKind)
        shapes = ((p, p), (p,), (n, kinds, p), (n, kinds), (n, kinds))
        return cls(*map(np.zeros, shapes))

    def add(self, joint: int, columns: IntArray, rows: FloatArray, drifts: FloatArray) -> None:
        """Add rows of a joint.

        Args:
            joint: The joint's index, from 0.
            columns: Indices of its columns.
            rows: Shape (rows, c + 1). These columns, and the residual.
            drifts: Shape (kinds, rows). The drifts.
        """
        matrix, residual = rows[:, :-1], rows[:, -1]
        self.gram[columns[:, np.newaxis], columns] += matrix.T @ matrix
        self.score[columns] += matrix.T @ residual
        self.beside[joint][:, columns] += drifts @ matrix
        self.size[joint] += np.sum(drifts**2, axis=1)
        self.residual[joint] += drifts @ residual


def find_torque_drifts(
    fitted: FittedSignals, sigma: FloatArray, recording: Sequence[int]
) -> tuple[TorqueDrift, ...]:
    """Return the drifts that are significant and material (`TorqueDrift.is_material`).

    Args:
        fitted: A fit of recordings, or of parts of recordings, that are not periodic.
        sigma: Shape (b,). Standard deviations of the estimate's base parameters.
        recording: For each run of the fit, the index of its recording; ascending.

    Returns:
        At most one drift for each joint and recording: the one that lowers the residual most.
            Recordings with fewer than `FEWEST_PARTS` seconds of motion are not tested.
    """
    parts = _parts(fitted, recording)
    gram = np.sum([part.gram for own in parts for part in own], axis=0)
    size = np.sqrt(np.maximum(np.diagonal(gram), 1e-300))
    inverse = np.linalg.pinv(gram / np.outer(size, size), hermitian=True) / np.outer(size, size)
    found = []
    for number, own in enumerate(parts):
        if len(own) >= FEWEST_PARTS:
            for j in range(len(fitted.robot.joints)):
                drift = _drift_of_joint(fitted, sigma, inverse, own, number, j)
                found += [] if drift is None else [drift]
    return tuple(found)


def _drift_of_joint(
    fitted: FittedSignals,
    sigma: FloatArray,
    inverse: FloatArray,
    parts: Sequence[_Normal],
    recording: int,
    j: int,
) -> TorqueDrift | None:
    """Return the drift of a joint that lowers the residual most; None without one."""
    joint, count = fitted.robot.joints[j], len(parts)
    best: TorqueDrift | None = None
    most = 0.0
    for k, kind in enumerate(DriftKind):
        beside = np.array([part.beside[j, k] for part in parts])
        sizes = np.array([part.size[j, k] for part in parts])
        onto = beside.sum(axis=0) @ inverse
        rest = float(sizes.sum() - onto @ beside.sum(axis=0))
        if rest <= EXPLAINED * float(sizes.sum()):
            continue
        scores = np.array([part.residual[j, k] - onto @ part.score for part in parts])
        change = float(scores.sum()) / rest
        own = np.array([part.gram @ onto for part in parts])
        weights = sizes - 2.0 * beside @ onto + own @ onto
        spread = np.sqrt(count / (count - 1) * np.sum((scores - change * weights) ** 2)) / rest
        p_value = 2.0 * float(stdtr(count - 1, -abs(change) / max(spread, 1e-300)))
        moved = np.abs(change * onto[: len(sigma)]) / np.maximum(sigma, 1e-300)
        worst = int(np.argmax(moved))
        drift = TorqueDrift(
            joint.name,
            joint.torque_unit,
            recording,
            kind,
            change,
            fitted.base.expressions[worst],
            float(moved[worst]),
            abs(change) / 2.0 / _own_sigma(fitted, sigma, kind, joint.name),
        )
        is_larger = change**2 * rest > most
        if p_value < SIGNIFICANT_P and is_larger and drift.is_material:
            best, most = drift, change**2 * rest
    return best


def _own_sigma(fitted: FittedSignals, sigma: FloatArray, kind: DriftKind, joint: str) -> float:
    """Return the deviation of a joint's parameter that drifts; infinite if the model lacks it."""
    symbol = {DriftKind.OFFSET: "fo", DriftKind.FRICTION: "fc"}.get(kind)
    name = f"{symbol}_{joint}"
    names = fitted.base.names
    return max(float(sigma[names.index(name)]), 1e-300) if name in names else math.inf


def _parts(fitted: FittedSignals, recording: Sequence[int]) -> list[list[_Normal]]:
    """Return the equations of each recording's parts; parts without rows are left out."""
    problem = fitted.problem
    structure = torque_structure(fitted.model, fitted.base, fitted.standard is not None)
    width = len(fitted.fit.solution.values)
    counts = [int(run.event[-1]) + 1 for run in problem.runs]
    of_second = np.repeat(np.asarray(recording), counts)  # index of each second's recording
    times_s = [run.signals.time_s for run in problem.runs]
    spans_s = [
        _span_s([own for own, of in zip(times_s, recording, strict=True) if of == number])
        for number in range(recording[-1] + 1)
    ]
    found: list[dict[int, _Normal]] = [{} for _ in spans_s]
    for stretch in rows_by_event(problem.blocks(fitted.model, fitted.standard)):
        second = int(stretch[0][0].event[stretch[0][1][0]])
        number = int(of_second[second])
        own = np.flatnonzero(of_second == number)
        part = (second - int(own[0])) * min(PARTS, len(own)) // len(own)
        normal = found[number].setdefault(part, _Normal.zeros(len(structure), width))
        for block, rows in stretch:
            _add_rows(fitted, normal, structure, (block, rows), spans_s[number])
    return [[part for part in own.values() if part.gram.any()] for own in found]


def _span_s(times_s: Sequence[FloatArray]) -> tuple[float, float]:
    """Return the begin and the end of a recording [s]."""
    return float(times_s[0][0]), float(times_s[-1][-1])


def _add_rows(
    fitted: FittedSignals,
    normal: _Normal,
    structure: Sequence[IntArray],
    stretch: tuple[TimeBlock, IntArray],
    span_s: tuple[float, float],
) -> None:
    """Add rows of a block to the equations of all joints."""
    (block, rows), names = stretch, fitted.base.names
    for j, columns in enumerate(structure):
        used = rows[block.use[rows, j]]
        scale = fitted.fit.scale_nm[j]
        matrix = block.columns[used, j][:, columns] / scale
        torque = matrix @ fitted.fit.solution.values[columns]
        since = (block.time_s[used] - span_s[0]) / max(span_s[1] - span_s[0], 1e-300) - 0.5
        coulomb = f"fc_{fitted.robot.joints[j].name}"
        friction = (
            block.columns[used, j, names.index(coulomb)] / scale
            if coulomb in names
            else np.zeros(len(used))
        )
        drifts = since * np.stack([np.full(len(used), 1.0 / scale), friction, torque])
        residual = block.rhs[used, j] / scale - torque
        normal.add(j, columns, np.column_stack([matrix, residual]), drifts)
