"""Base parameters estimated joint after joint, from the last one inward.

Only the links beyond a joint affect its torque. The last link therefore explains the torque of the
last joint, the last two links that of the joint before, and so on (Atkeson, An and Hollerbach 1986;
Olsen and Bekey 1986). Parameters from outer joints are treated as exact for inner joints. If the
joints' torques contradict each other, because of a wrong scale or geometry, the result differs from
that of a common fit.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from identification.equations.time_domain import TimeRun, joint_equations
from identification.estimation.estimate import Estimate
from identification.regression.intervals import Cluster, jackknife
from identification.regression.least_squares import Triangle

UNDETERMINED = 1e-7


def estimate_link_by_link(
    estimate: Estimate, runs: tuple[TimeRun, ...]
) -> tuple[FloatArray, FloatArray]:
    """Estimate the base parameters of a model, joint after joint.

    The last joint comes first. Each joint's equations determine those combinations of parameters
    that no joint beyond it has determined. Combinations that the joint does not determine either
    are left to the next joint inward.

    Args:
        estimate: The model.
        runs: The recordings.

    Returns:
        `values`, shape (b,). Base parameters.
        `covariance`, shape (b, b). From residuals of any colour
        (`identification.regression.intervals`), including the effect of outer joints' errors on
        inner joints.

    Raises:
        EstimationError: The motion does not determine the parameters.
    """
    b, n = len(estimate.base), estimate.model.chain.n
    triangles = [Triangle.empty(b) for _ in range(n)]
    for rows in _equations(estimate, runs):
        triangles = [t.add(*equations) for t, equations in zip(triangles, rows, strict=True)]
    factors = [triangle.factor for triangle in triangles]
    size = np.linalg.norm(np.vstack(factors)[:, :-1], axis=0)
    if not size.all():
        hidden = [name for name, s in zip(estimate.base.names, size, strict=True) if s == 0.0]
        raise EstimationError(
            f"the motion does not determine {', '.join(hidden)}: move more axes",
            code="RID-MOTION-UNINFORMATIVE",
        )

    scaled, steps = np.zeros(b), [np.zeros((b, 0)) for _ in range(n)]
    unseen = np.eye(b)
    for j in reversed(range(n)):
        matrix, rhs = factors[j][:, :-1] / size, factors[j][:, -1]
        left, gain, right = np.linalg.svd(matrix @ unseen)
        rank = int(np.sum(gain > UNDETERMINED * np.linalg.norm(matrix, 2)))
        steps[j] = unseen @ right[:rank].T
        unseen = unseen @ right[rank:].T
        scaled = scaled + steps[j] @ (left[:, :rank].T @ (rhs - matrix @ scaled) / gain[:rank])
    if unseen.shape[1]:
        worst = np.argsort(-np.linalg.norm(unseen, axis=1))[:3]
        names = ", ".join(estimate.base.names[k] for k in worst)
        raise EstimationError(
            f"if each joint is solved separately, the motion does not distinguish {names}: record"
            " a motion that moves more axes, or use another cross-check",
            code="RID-MOTION-UNINFORMATIVE",
        )

    values = scaled / size
    basis = np.hstack(steps) / size[:, np.newaxis]
    own = [step / size[:, np.newaxis] for step in steps]
    information = _condense([(f[:, :-1], f[:, -1]) for f in factors], own, basis, values).gram
    clusters = (_condense(rows, own, basis, values) for rows in _equations(estimate, runs))
    return values, np.asarray(basis @ jackknife(information, clusters).quoted @ basis.T)


def _condense(
    rows: list[tuple[FloatArray, FloatArray]],
    own: list[FloatArray],
    basis: FloatArray,
    values: FloatArray,
) -> Cluster:
    """Return the equations of all joints as one cluster of the covariance.

    Of each joint's rows, only the combinations of parameters that this joint determines are kept.
    """
    gram, score = [], []
    for (matrix, rhs), directions in zip(rows, own, strict=True):
        seen = (matrix @ directions).T
        gram.append(seen @ (matrix @ basis))
        score.append(seen @ (rhs - matrix @ values))
    return Cluster(np.vstack(gram), np.concatenate(score))


def _equations(
    estimate: Estimate, runs: tuple[TimeRun, ...]
) -> Iterator[list[tuple[FloatArray, FloatArray]]]:
    standard = estimate.standard_values if estimate.model.transmission.losses else None
    b, standstill = len(estimate.base), estimate.standstill_rad_s
    for rows in joint_equations(estimate.model, estimate.base, runs, standstill, standard):
        yield [(matrix[:, :b], rhs) for matrix, rhs in rows]
