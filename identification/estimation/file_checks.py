"""`refuse_contradictions`: consistency check of the values that an estimate file states twice."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import ConfigError
from identification.estimation.estimate import Estimate

UNSOUND_MODEL: Final = "RID-MODEL-UNSOUND"
SAME: Final = 1e-6


def refuse_contradictions(estimate: Estimate, deviations: Mapping[str, Sequence[float]]) -> None:
    """Refuse an estimate whose file contradicts itself.

    Args:
        estimate: The estimate as read.
        deviations: Standard deviations in the file, by the names of the estimate's attributes; they
            must agree with the covariances.

    Raises:
        ConfigError: A parameter is duplicated or out of order, its unit or combination is not that
            of the model, a covariance is not positive semidefinite, or a standard deviation does
            not agree with its covariance. The text begins with the key.
    """
    for problem in _problems(estimate, deviations):
        raise ConfigError(f"{problem}: was the file edited?", code=UNSOUND_MODEL)


def _problems(estimate: Estimate, deviations: Mapping[str, Sequence[float]]) -> Iterator[str]:
    base = estimate.base
    kept = np.array(base.kept)
    for number in (np.flatnonzero(np.diff(kept) <= 0) + 1).tolist():
        yield (
            f"parameters.{number}.name: {base.names[number]} follows {base.names[number - 1]},"
            " which is not the model's order"
        )
    heads = base.combination[:, kept]
    for row in np.flatnonzero((heads != np.eye(len(kept))).any(axis=1)).tolist():
        yield f"combination.{row}: not the combination of the parameter {base.names[row]}"
    units = estimate.model.parameter_units
    for number, (unit, index) in enumerate(zip(base.units, base.kept, strict=True)):
        if unit != units[index]:
            yield f"parameters.{number}.unit: {unit!r}, but the model's unit is {units[index]!r}"
    for name, matrix in (
        ("covariance_noise", estimate.covariance_noise),
        ("covariance_residual", estimate.covariance_residual),
        ("covariance_honest", estimate.covariance_jackknife),
        ("shape_covariance", estimate.nonlinear_covariance),
    ):
        if matrix is not None and matrix.size:
            yield from covariance_problems(name, matrix)
    for name, stated in deviations.items():
        own = getattr(estimate, name)
        if own is None:
            continue
        off = ~np.isclose(np.array(stated, dtype=float), own, rtol=SAME, atol=0.0)
        for number in np.flatnonzero(off).tolist():
            yield (
                f"{name} of parameter {number}: {stated[number]:g}, but the covariance gives"
                f" {own[number]:g}"
            )


def covariance_problems(name: str, matrix: FloatArray) -> Iterator[str]:
    """Yield reasons why the matrix (b, b) called `name` in a file is not a covariance."""
    variances = np.diagonal(matrix)
    for number in np.flatnonzero(variances < 0.0).tolist():
        yield f"{name}.{number}.{number}: a negative variance, {variances[number]:g}"
    size = np.sqrt(np.maximum(variances, 0.0))
    scale = np.where(size > 0.0, size, 1.0)
    with np.errstate(over="ignore", invalid="ignore"):
        scaled = matrix / np.outer(scale, scale)
        uneven = np.argwhere(~(np.abs(scaled - scaled.T) <= SAME))
    if len(uneven):
        row, column = uneven[0]
        yield f"{name}.{row}.{column}: the matrix is not symmetric"
        return
    smallest = float(np.linalg.eigvalsh(scaled)[0])
    if smallest < -SAME * len(matrix):
        yield f"{name}: the correlation matrix has a negative eigenvalue, {smallest:.3g}"
