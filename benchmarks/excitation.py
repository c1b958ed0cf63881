"""Experiment design: the condition number reached for a UR10e-like arm in a stated time.

`python -m benchmarks.excitation [--quick]`. All columns count: rigid bodies, rotors, viscous and
Coulomb friction, offsets. Limits on position, speed, acceleration, torque (drawings), a floor, a
wall and self-collision are verified on the dense grid before a motion counts. The peer is the
two-harmonic heuristic (3.22) with as many draws as fit in the same time, which knows no obstacles.
"""

from __future__ import annotations

import json
import sys
import time

import numpy as np

from acquisition.excitation import FourierTrajectory
from config.bodies import Box, Plane, Workspace
from config.load import load_robot
from dynamics.cad import cad_parameters
from dynamics.robot_model import RobotModel, regressor
from identification.excitation_problem import ExcitationProblem
from identification.experiment_design import condition_number, design_two_harmonic
from identification.optimal_design import Candidate, candidates

BUDGET_S = 30.0
QUICK_BUDGET_S = 15.0
BAR = 45.0
PERIOD_S = 10.0
HARMONICS = 5
CYCLE_S = 0.002
DRAWS = 40


def unscaled(problem: ExcitationProblem, candidate: Candidate) -> float:
    """Return the condition number of the plain base regressor, in SI units."""
    times = np.arange(0.0, PERIOD_S, 0.01)
    trajectory = FourierTrajectory.from_motion(candidate.motion, problem.robot, 0.01)
    phi = regressor(
        RobotModel.from_description(problem.robot),
        trajectory.position(times),
        trajectory.velocity(times),
        trajectory.acceleration(times),
    )
    return float(np.linalg.cond(problem.base.columns(phi).reshape(-1, len(problem.base))))


def main() -> int:
    """Measure and print; the last line is one JSON object."""
    budget_s = QUICK_BUDGET_S if "--quick" in sys.argv else BUDGET_S
    robot = load_robot("ur10e")
    workspace = Workspace(
        planes=(Plane(name="the floor", normal=(0.0, 0.0, 1.0), offset_m=-0.2),),
        boxes=(Box(name="the wall", keep="out", min_m=(0.8, -1, -1), max_m=(1, 1, 2)),),
    )
    torque_nm = np.array([joint.limits.torque for joint in robot.joints])
    problem = ExcitationProblem(
        robot=robot,
        period_s=PERIOD_S,
        harmonics=HARMONICS,
        criterion="condition",
        limit_fraction=0.9,
        expected_noise_nm=torque_nm,
        parameters=cad_parameters(RobotModel.from_description(robot), robot)[0],
        workspace=workspace,
    )
    began_s = time.monotonic()
    best: Candidate | None = None
    found = 0
    stream = candidates(problem, range(1000), CYCLE_S)
    print(f"{len(problem.base)} base parameters, {problem.size} variables, {budget_s:g} s")
    for candidate in stream:
        elapsed_s = time.monotonic() - began_s
        if elapsed_s > budget_s:
            break
        found += 1
        if candidate.broken:
            print(f"{elapsed_s:6.1f} s  start {candidate.seed}: breaks {candidate.broken[0]}")
        elif best is None or candidate.condition_number < best.condition_number:
            best = candidate
            print(f"{elapsed_s:6.1f} s  best condition number {best.condition_number:.2f}")
    stream.close()
    if best is None:
        print("no motion within all limits was found in time")

    draws_s = time.monotonic()
    heuristic = design_two_harmonic(robot, PERIOD_S, CYCLE_S, tries=DRAWS)
    draws_s = time.monotonic() - draws_s
    tries = max(1, int(DRAWS * budget_s / draws_s))
    heuristic = design_two_harmonic(robot, PERIOD_S, CYCLE_S, tries=tries)
    peer = condition_number(robot, heuristic)
    print(f"two-harmonic heuristic, {tries} draws in the same time, no obstacles: {peer:.1f}")
    if best is not None:
        print(f"the same motion, columns not scaled: {unscaled(problem, best):.0f}")
    print("published for such arms: figaroh 64 in 400 s, FloBaRoID 378 in 220 s")
    value = best.condition_number if best is not None else float("inf")
    holds = value <= BAR
    print(
        json.dumps(
            {
                "name": "excitation",
                "value": round(value, 2) if best is not None else None,
                "unit": "condition number",
                "ratios": {"two-harmonic heuristic": round(peer / value, 1)},
                "bar": f"at most {BAR:g} within {budget_s:g} s, every limit held",
                "holds": holds,
                "starts": found,
            }
        )
    )
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
