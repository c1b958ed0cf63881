"""The closest robot that can exist: semidefinite programme against log-Cholesky.

`python -m benchmarks.consistency [--quick]`. Estimates of a six-axis arm with noise are made
physically consistent by the programme (Clarabel), and by the other known way: bodies that exist by
construction, P = floor + L L^T with exponentials on L's diagonal, and a general minimiser with
exact derivatives (Gauss-Newton in a trust region). Both make the same cost small under the same
constraints; the programme must be at least as low and ten times faster.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import json
import sys
import time

import numpy as np
from scipy.optimize import least_squares

from config.arrays import FloatArray
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import regressor
from dynamics.terms.conditions import Conditions
from identification.consistency.closest_robot import programme
from identification.consistency.nominal_robot import nominal_parameters
from identification.consistency.programme import ConsistencyProgramme
from identification.consistency.pseudo_inertia import BASIS, SIZE
from identification.estimation.estimate import Estimate
from identification.model.base_parameters import BaseParameters, base_parameters
from identification.model.options import ModelOptions

ROWS = 200
NOISE_NM = 3.0
STEPS = 300
FASTER = 10.0
UPPER = tuple(zip(*np.triu_indices(SIZE), strict=True))


def with_noise(
    robot: RobotDescription,
    options: ModelOptions,
    base: BaseParameters,
    truth: FloatArray,
    phi: FloatArray,
    noise_nm: float,
    random: np.random.Generator,
) -> Estimate:
    """Return base parameters with the errors that noise on the torques of `phi` leaves."""
    n = len(robot.joint_names)
    covariance: FloatArray = np.asarray(noise_nm**2 * np.linalg.inv(phi.T @ phi), dtype=float)
    error = np.linalg.cholesky(covariance) @ random.normal(size=len(base))
    return Estimate(
        robot=robot,
        options=options,
        base=base,
        values=base.from_standard(truth) + error,
        covariance_noise=None,
        covariance_residual=covariance,
        covariance_jackknife=covariance,
        condition_number=1.0,
        equations=len(phi),
        residual_nm=np.full(n, noise_nm),
        noise_nm=None,
        left_out_fraction=np.zeros(n),
        method="smoothed",
        band_hz=10.0,
        standstill_rad_s=0.02,
    )


def noisy_estimate(seed: int) -> Estimate:
    """Return a UR10e's nominal base parameters with the errors that noise leaves."""
    robot, options = load_robot("ur10e"), ModelOptions(friction_terms=("coulomb", "viscous"))
    model = options.build(robot)
    base = base_parameters(model)
    random = np.random.default_rng(seed)
    truth, sigma = nominal_parameters(model, robot)
    truth = np.where(truth == 0.0, 0.3 * sigma, truth)
    q, v, a = random.normal(0.0, np.array([1.5, 1.0, 3.0])[:, None, None], (3, ROWS, model.chain.n))
    phi = base.columns(regressor(model, q, v, a, Conditions(None))).reshape(-1, len(base))
    return with_noise(robot, options, base, truth, phi, NOISE_NM, random)


def log_cholesky(task: ConsistencyProgramme) -> FloatArray:
    """Return the standard parameters that the peer finds."""
    p = len(task.centre)
    to_body = np.linalg.pinv(BASIS.reshape(len(BASIS), -1).T)
    roots = [np.linalg.cholesky(floor) for floor in task.floors]
    inside = {k for body in task.bodies for k in range(body.start, body.stop)}
    positive = [int(k) for k in np.flatnonzero(task.not_negative.any(axis=0))]
    others = [k for k in range(p) if k not in inside and k not in positive]

    def unfold(z: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return the standard parameters and their derivatives."""
        theta, slopes, at = np.zeros(p), np.zeros((p, p)), 0
        for body, root in zip(task.bodies, roots, strict=True):
            factor = np.zeros((SIZE, SIZE))
            for value, (i, j) in zip(z[at : at + 10], UPPER, strict=True):
                factor[i, j] = np.exp(value) if i == j else value
            whole = root @ factor
            theta[body] = to_body @ (root @ root.T + whole @ whole.T).ravel()
            for k, (i, j) in enumerate(UPPER):
                change = np.zeros((SIZE, SIZE))
                change[i, j] = factor[i, i] if i == j else 1.0
                product = root @ change @ whole.T
                slopes[body, at + k] = to_body @ (product + product.T).ravel()
            at += 10
        for k in positive:
            theta[k] = slopes[k, at] = task.scale[k] * np.exp(z[at])
            at += 1
        for k in others:
            theta[k], slopes[k, at] = task.centre[k] + task.scale[k] * z[at], task.scale[k]
            at += 1
        return theta, slopes

    def residuals(z: FloatArray) -> FloatArray:
        x = (unfold(z)[0] - task.centre) / task.scale
        return np.concatenate([task.matrix @ x - task.rhs, np.sqrt(task.weight) * x])

    def slopes(z: FloatArray) -> FloatArray:
        by_x = unfold(z)[1] / task.scale[:, np.newaxis]
        return np.vstack([task.matrix @ by_x, np.sqrt(task.weight) * by_x])

    start = np.zeros(p)
    start[[10 * k + n for k in range(len(task.bodies)) for n in (0, 4, 7, 9)]] = np.log(10.0)
    start[10 * len(task.bodies) :][: len(positive)] = np.log(0.3)
    found = least_squares(residuals, start, slopes, x_scale="jac", max_nfev=STEPS)
    return unfold(found.x)[0]


def main() -> int:
    """Measure and print; the last line is one JSON object."""
    count = 3 if "--quick" in sys.argv else 10
    programme(noisy_estimate(0)).solve()  # loads the solver
    spent, cost = np.zeros((2, count)), np.zeros((2, count))
    for seed in range(count):
        task = programme(noisy_estimate(seed))
        for way, solve in enumerate((ConsistencyProgramme.solve, log_cholesky)):
            start_s = time.perf_counter()
            found = solve(task)
            spent[way, seed] = time.perf_counter() - start_s
            cost[way, seed] = task.cost(found)
    excess = cost[1] / cost[0] - 1.0
    ours_s, peer_s = np.median(spent, axis=1)
    print(f"{count} estimates of a UR10e, median time; cost over the lowest found:")
    print(f"  semidefinite programme (Clarabel)  {1e3 * ours_s:6.1f} ms")
    print(
        f"  log-Cholesky, {STEPS} steps at most   {1e3 * peer_s:6.1f} ms"
        f"  {100 * excess.min():.2g} to {100 * excess.max():.2g} % higher"
    )
    faster = peer_s / ours_s
    holds = bool(faster >= FASTER and excess.min() > -1e-6)
    print(
        json.dumps(
            {
                "name": "consistency",
                "value": round(1e3 * ours_s, 2),
                "unit": "ms per estimate",
                "ratios": {"log-Cholesky": round(faster, 1)},
                "bar": f"at least {FASTER:g} times faster than log-Cholesky, at no higher cost",
                "holds": holds,
            }
        )
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
