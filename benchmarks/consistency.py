"""Test of physical consistency: power, and solver times compared with log-Cholesky.

`python -m benchmarks.consistency [--quick]` draws estimates of a six-axis arm with 52 base
parameters. The true robots are inside the cone of consistent parameters or on its border: a wrist
without rotor inertia and viscous friction, links without thickness, or an arm without any friction.
The first figure is the fraction of these estimates that the test rejects at p = 0.05. Then one
parameter that cannot be negative is set to -5 sigma; the second figure is the fraction rejected in
this case. Times are processor times.

Afterwards two methods make noisy estimates consistent. They minimise the same cost under the same
constraints:
- the semidefinite programme of the project (Clarabel);
- for comparison, a parametrisation whose bodies are consistent by construction, P = floor + L L^T
  with exponentials on L's diagonal, with a general minimiser with exact derivatives (Gauss-Newton
  in a trust region).

The programme's cost must not be higher, and the programme must be ten times faster.
"""

from __future__ import annotations

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import least_squares

from config.arrays import FloatArray
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, regressor
from dynamics.terms.conditions import Conditions
from identification.consistency.closest_robot import check_consistency, cone, programme
from identification.consistency.consistency_test import JudgedParameters, cannot_be_negative
from identification.consistency.metric import jackknife_metric, whiten_parameters
from identification.consistency.nominal_robot import nominal_parameters
from identification.consistency.programme import TO_BODY, ConsistencyProgramme
from identification.consistency.pseudo_inertia import BASIS, SIZE, pseudo_inertia
from identification.estimation.estimate import Estimate
from identification.model.base_parameters import BaseParameters, base_parameters
from identification.model.options import ModelOptions

ROWS = 200
NOISE_NM = 3.0
STEPS = 300
FASTER = 10.0
NOISES_NM = (3.0, 0.3)
LEVEL_SIGMAS = 5.0
SIGNIFICANT_P = 0.05
FALSE_REFUSALS = 0.07
POWER = 0.95
LONGEST_S = 2.0
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
    """Return base parameters with errors from torque noise, for the regressor `phi`."""
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


def noisy_estimate(seed: int, noise_nm: float = NOISE_NM) -> Estimate:
    """Return a UR10e's nominal base parameters with errors from torque noise."""
    robot, options = load_robot("ur10e"), ModelOptions(friction_terms=("coulomb", "viscous"))
    model = options.build(robot)
    base = base_parameters(model)
    random = np.random.default_rng(seed)
    q, v, a = random.normal(0.0, np.array([1.5, 1.0, 3.0])[:, None, None], (3, ROWS, model.chain.n))
    phi = base.columns(regressor(model, q, v, a, Conditions(None))).reshape(-1, len(base))
    truth = _sound(model, robot, None)
    return with_noise(robot, options, base, truth, phi, noise_nm, random)


def sound_robot(estimate: Estimate, random: np.random.Generator | None = None) -> FloatArray:
    """Return physically consistent standard parameters: nominal ones, or those of random bodies."""
    return _sound(estimate.model, estimate.robot, random)


def _sound(
    model: RobotModel, robot: RobotDescription, random: np.random.Generator | None
) -> FloatArray:
    theta, scale = nominal_parameters(model, robot)
    links = 10 * model.chain.n
    theta[links:] = 0.3 * scale[links:]
    if random is not None:
        theta[links:] *= random.uniform(0.1, 3.0, len(theta) - links)
        for start in range(0, links, 10):
            root = np.linalg.cholesky(pseudo_inertia(theta[start : start + 10]))
            whole = root @ random.normal(size=(SIZE, SIZE))
            theta[start : start + 10] = TO_BODY @ (whole @ whole.T).ravel()
    return theta


def border_robots(estimate: Estimate) -> list[tuple[str, FloatArray]]:
    """Return robots on the border of physical consistency, with names."""
    names, n = estimate.model.parameter_names, len(estimate.robot.joints)
    wrist = sound_robot(estimate)
    for place, name in enumerate(names):
        symbol, joint = name.split("_")[0], name[-1]
        if (symbol == "fv" or symbol.startswith("Im")) and joint in "456":
            wrist[place] = 0.0
    flat = wrist.copy()
    for start in range(10 * (n // 2), 10 * n, 10):
        size, axes = np.linalg.eigh(pseudo_inertia(flat[start : start + 10]))
        size[:2] = 0.0
        flat[start : start + 10] = TO_BODY @ ((axes * size) @ axes.T).ravel()
    ideal = sound_robot(estimate)
    ideal[10 * n :] = 0.0
    return [
        ("wrist without rotors and viscous friction", wrist),
        ("wrist without rotors and viscous friction, with flat links", flat),
        ("arm without any rotor and friction", ideal),
    ]


@dataclass
class Refusals:
    """Counts of rejected draws and of all draws, and the longest time of one test [s]."""

    refused: int = 0
    draws: int = 0
    named: int = 0
    longest_s: float = 0.0

    def add(self, estimate: Estimate, name: str = "") -> None:
        """Test one estimate, in which the parameter `name` is wrong."""
        start_s = time.process_time()
        test = check_consistency(estimate)
        self.longest_s = max(self.longest_s, time.process_time() - start_s)
        self.refused += test.p_value < SIGNIFICANT_P
        self.named += test.largest is not None and test.largest.name == name
        self.draws += 1

    @property
    def share(self) -> float:
        """Fraction of the draws that are rejected."""
        return self.refused / self.draws


def draw_estimate(estimate: Estimate, values: FloatArray, random: np.random.Generator) -> Estimate:
    """Return an estimate of base parameters with a random error drawn from its covariance."""
    sigma, factor = jackknife_metric(estimate)
    return replace(estimate, values=values + sigma * (factor @ random.normal(size=len(sigma))))


def false_refusals(draws: int) -> dict[str, Refusals]:
    """Return the rejections of consistent robots and of robots on the border of consistency."""
    found: dict[str, Refusals] = {}
    for seed, noise_nm in enumerate(NOISES_NM):
        estimate = noisy_estimate(100 + seed, noise_nm)
        for number, (label, robot) in enumerate(
            [("inside", sound_robot(estimate)), *border_robots(estimate)]
        ):
            counted = found.setdefault(label, Refusals())
            random = np.random.default_rng([seed, number])
            values = estimate.base.from_standard(robot)
            for _ in range(draws // len(NOISES_NM)):
                counted.add(draw_estimate(estimate, values, random))
    return found


def power(draws: int) -> Refusals:
    """Return the rejections of robots of which one parameter is impossible, at -5 sigma."""
    found, random = Refusals(), np.random.default_rng(7)
    for seed, noise_nm in enumerate(NOISES_NM):
        estimate = noisy_estimate(200 + seed, noise_nm)
        base, (sigma, factor) = estimate.base, jackknife_metric(estimate)
        tested = JudgedParameters(base.names, base.expressions, estimate.values, sigma, factor)
        for i in np.flatnonzero(cannot_be_negative(tested, cone(estimate))):
            for _ in range(draws):
                values = base.from_standard(sound_robot(estimate))
                values[i] = -LEVEL_SIGMAS * sigma[i]
                found.add(draw_estimate(estimate, values, random), base.names[i])
    return found


def log_cholesky(task: ConsistencyProgramme, target: FloatArray) -> FloatArray:
    """Return the standard parameters of the closest robot, by the log-Cholesky parametrisation."""
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
        return np.concatenate([task.matrix @ unfold(z)[0] - target, np.sqrt(task.weight) * x])

    def slopes(z: FloatArray) -> FloatArray:
        by_z = unfold(z)[1]
        by_x = by_z / task.scale[:, np.newaxis]
        return np.vstack([task.matrix @ by_z, np.sqrt(task.weight) * by_x])

    start = np.zeros(p)
    start[[10 * k + n for k in range(len(task.bodies)) for n in (0, 4, 7, 9)]] = np.log(10.0)
    start[10 * len(task.bodies) :][: len(positive)] = np.log(0.3)
    found = least_squares(residuals, start, slopes, x_scale="jac", max_nfev=STEPS)
    return unfold(found.x)[0]


def against_log_cholesky(count: int) -> tuple[bool, float, float]:
    """Print the comparison; return True if it is good enough, the time [ms], and the speed-up."""
    spent, cost = np.zeros((2, count)), np.zeros((2, count))
    ways: list[Callable[[ConsistencyProgramme, FloatArray], FloatArray]]
    ways = [ConsistencyProgramme.solve, log_cholesky]
    for seed in range(count):
        estimate = noisy_estimate(seed)
        task, target = programme(estimate), whiten_parameters(estimate, estimate.values)
        for way, solve in enumerate(ways):
            start_s = time.perf_counter()
            found = solve(task, target)
            spent[way, seed] = time.perf_counter() - start_s
            cost[way, seed] = task.cost(target, found)
    excess = cost[1] / cost[0] - 1.0
    ours_s, peer_s = np.median(spent, axis=1)
    print(f"{count} estimates of a UR10e, median time; cost over the lowest found:")
    print(f"  semidefinite programme (Clarabel)  {1e3 * ours_s:6.1f} ms")
    print(
        f"  log-Cholesky, {STEPS} steps at most   {1e3 * peer_s:6.1f} ms"
        f"  {100 * excess.min():.2g} to {100 * excess.max():.2g} % higher"
    )
    faster = float(peer_s / ours_s)
    return faster >= FASTER and float(excess.min()) > -1e-6, float(1e3 * ours_s), faster


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a tenth of the draws")
    quick = parser.parse_args().quick
    check_consistency(noisy_estimate(0))  # loads the solver
    sound = false_refusals(40 if quick else 400)
    wrong = power(1 if quick else 10)
    print(f"Refused at p = {SIGNIFICANT_P}, of estimates with 52 base parameters:")
    for label, counted in sound.items():
        print(f"  {label:45s} {100 * counted.share:5.1f} % of {counted.draws}")
    print(
        f"  {f'one parameter at -{LEVEL_SIGMAS:g} sigma':45s} {100 * wrong.share:5.1f} % of"
        f" {wrong.draws}; {100 * wrong.named / wrong.draws:.1f} % name it"
    )
    longest_s = max(counted.longest_s for counted in (*sound.values(), wrong))
    print(f"  longest test: {longest_s:.2f} s of processor time")
    every = sum(counted.refused for counted in sound.values()) / sum(
        counted.draws for counted in sound.values()
    )
    most = every if quick else max(counted.share for counted in sound.values())
    cheap, ours_ms, faster = against_log_cholesky(3 if quick else 10)
    holds = bool(
        most <= FALSE_REFUSALS and wrong.share >= POWER and longest_s <= LONGEST_S and cheap
    )
    print(
        json.dumps(
            {
                "name": "consistency",
                "value": round(ours_ms, 2),
                "unit": "ms per estimate",
                "ratios": {"log-Cholesky": round(faster, 1)},
                "false_refusals": round(most, 4),
                "power": round(wrong.share, 4),
                "longest_s": round(longest_s, 3),
                "bar": f"at most {100 * FALSE_REFUSALS:g} % false refusals, at least"
                f" {100 * POWER:g} % power, at most {LONGEST_S:g} s; at least {FASTER:g} times"
                " faster than log-Cholesky, at no higher cost",
                "holds": holds,
            }
        )
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
