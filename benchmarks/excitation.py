"""Experiment design: condition number for a UR10e-like arm after a given computing time.

`python -m benchmarks.excitation [--quick]`. The regressor has columns for rigid bodies, rotors,
viscous and Coulomb friction and offsets. A motion counts only if it respects all limits on a dense
time grid: position, speed, acceleration, torque (from CAD data), floor, wall and self-collision.

The condition number is defined as in the published tools: of the base regressor in SI units,
without scaling, with rotors at the link side. The condition number of (2.25, 2.26) is printed too.
Its rows are divided by the torque limits and its columns have length one, so that it does not
depend on units. The two-harmonic heuristic (3.22) serves for comparison. It gets the same time on
the same cores, for as many draws as possible, and ignores torque limits and obstacles.
"""

from __future__ import annotations

import json
import sys
import time
from dataclasses import replace
from typing import cast

import joblib
import numpy as np

from acquisition.motion.kinds.fourier import FourierMotion
from benchmarks.short_form import is_short
from config.load import load_robot
from config.robot.bodies import Box, Plane, Workspace
from dynamics.model.cad import cad_parameters
from dynamics.model.robot_model import regressor
from identification.design.criteria import Condition
from identification.design.model import design_model
from identification.design.problem import ExcitationProblem
from identification.design.search import Candidate, candidates
from identification.design.two_harmonic import TwoHarmonicOptions, two_harmonic_draws

BUDGET_S = 30.0
QUICK_BUDGET_S = 12.0
BAR = 45.0
PERIOD_S = 10.0
HARMONICS = 5
CYCLE_S = 0.002
CORES = 2


def task() -> ExcitationProblem:
    """Return the design problem: arm, wall, floor, torque limits and criterion."""
    robot = load_robot("ur10e")
    problem = ExcitationProblem(
        robot=robot,
        period_s=PERIOD_S,
        harmonics=HARMONICS,
        criterion=Condition(),
        limit_fraction=0.9,
        expected_noise_nm=np.ones(len(robot.joints)),
        parameters=cad_parameters(design_model(robot), robot)[0],
        workspace=Workspace(
            planes=(Plane(name="the floor", normal=(0.0, 0.0, 1.0), offset_m=-0.2),),
            boxes=(Box(name="the wall", keep="out", min_m=(0.8, -1, -1), max_m=(1, 1, 2)),),
        ),
    )
    gear = {f"Im{k}": joint.gear_ratio for k, joint in enumerate(robot.joints, start=1)}
    link_side = np.array([gear.get(name, 1.0) ** -2 for name in problem.base.names])
    return replace(problem, criterion=Condition(link_side))


def condition_number_of(problem: ExcitationProblem, motion: FourierMotion) -> float:
    """Return the condition number of a motion's regressor."""
    points = 40 * max(len(joint.sine) for joint in motion.joints)
    grid = motion.trajectory(problem.robot, PERIOD_S / points)
    times = grid.sample_times_s
    phi = regressor(
        problem.model, grid.position(times), grid.velocity(times), grid.acceleration(times)
    )
    return problem.criterion.objective(problem.information(problem.weighted_rows(phi)))


def best_draw(problem: ExcitationProblem, seed: int, budget_s: float) -> tuple[float, int]:
    """Return the heuristic's best condition number within a time, and the number of draws."""
    until_s = time.monotonic() + budget_s
    best, count = np.inf, 0
    for motion in two_harmonic_draws(
        problem.robot, TwoHarmonicOptions(PERIOD_S, limit_fraction=0.9, seed=seed)
    ):
        best = min(best, condition_number_of(problem, motion))
        count += 1
        if time.monotonic() > until_s:
            break
    return float(best), count


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    budget_s = QUICK_BUDGET_S if is_short(__doc__) else BUDGET_S
    began_s = time.monotonic()
    problem = task()
    best: Candidate | None = None
    found = broken = 0
    print(f"{len(problem.base)} base parameters, {problem.size} variables, {budget_s:g} s")
    stream = candidates(problem, range(10_000), CYCLE_S, jobs=CORES)
    for candidate in stream:
        elapsed_s = time.monotonic() - began_s
        if elapsed_s > budget_s:
            break
        found += 1
        if candidate.check.broken:
            broken += 1
        elif best is None or candidate.check.objective < best.check.objective:
            best = candidate
            print(f"{elapsed_s:6.1f} s  best condition number {candidate.check.objective:.2f}")
    stream.close()
    print(f"{found} starts; {broken} motions exceed a limit and do not count")
    if best is not None:
        torque = np.array([joint.limits.torque for joint in problem.robot.joints])
        scaled = replace(problem, expected_noise_nm=torque, criterion=Condition())
        number = condition_number_of(scaled, best.motion)
        print(f"of the same motion by (2.25, 2.26), free of units: {number:.2f}")

    work = joblib.delayed(best_draw)
    parallel = joblib.Parallel(n_jobs=CORES)
    draws = cast(
        list[tuple[float, int]], parallel(work(problem, k, budget_s) for k in range(CORES))
    )
    peer = min(number for number, _ in draws)
    tries = sum(count for _, count in draws)
    print(f"two-harmonic heuristic, {tries} draws in the same time, no obstacles: {peer:.1f}")
    print("published for such arms: figaroh 64 in 400 s, FloBaRoID 378 in 220 s")
    value = best.check.objective if best is not None else np.inf
    holds = bool(value <= BAR)
    print(
        json.dumps(
            {
                "name": "excitation",
                "value": round(value, 2) if best is not None else None,
                "unit": "condition number",
                "ratios": {"two-harmonic heuristic": round(peer / value, 2)},
                "bar": f"at most {BAR:g} within {budget_s:g} s, every limit held",
                "holds": holds,
            }
        )
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
