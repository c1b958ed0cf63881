"""Base parameters joint after joint, from the last one inward.

A joint feels the links behind it alone, so the last joint's torques are explained by the last link,
the next ones' by one link more, and so on (Atkeson, An and Hollerbach 1986; Olsen and Bekey 1986).
What outer joints have settled is taken as true further in. Where the joints' torques contradict
each other, by a wrong scale or a wrong geometry, this differs from the fit of all at once.
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

    Each joint's equations are solved for the directions of parameter space that no joint behind it
    has seen; those that it does not see either wait for the next.

    Args:
        estimate: The model.
        runs: The recordings.

    Returns:
        `values`, shape (b,). Base parameters.
        `covariance`, shape (b, b). From residuals of whatever colour
            (`identification.regression.intervals`), with what the errors of outer joints do to
            inner ones.

    Raises:
        EstimationError: The motion does not show the parameters.
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
            f"the motion does not show {', '.join(hidden)}", code="RID-MOTION-UNINFORMATIVE"
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
            f"the motion does not tell {names} from one another joint by joint",
            code="RID-MOTION-UNINFORMATIVE",
        )

    values = scaled / size
    basis = np.hstack(steps) / size[:, np.newaxis]
    own = [step / size[:, np.newaxis] for step in steps]
    information = _condensed([(f[:, :-1], f[:, -1]) for f in factors], own, basis, values).gram
    clusters = (_condensed(rows, own, basis, values) for rows in _equations(estimate, runs))
    return values, np.asarray(basis @ jackknife(information, clusters).quoted @ basis.T)


def _condensed(
    rows: list[tuple[FloatArray, FloatArray]],
    own: list[FloatArray],
    basis: FloatArray,
    values: FloatArray,
) -> Cluster:
    """Return what some rows of each joint say of the directions that this joint settles."""
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
