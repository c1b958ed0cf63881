"""Kinematic calibration of simulated arms: held-out errors, rank, stiffness and intervals.

Run it with ``python -m benchmarks.tracker [--quick]``. Pinocchio simulates the robots ir361 and
kr15: their rows, points, gears and bodies differ at random from the robot file. A tracker measures
30 poses by `calibrate poses`, half of them loaded, with 0.02 mm of noise per coordinate. The errors
are those of the calibrated arm at 100 random poses without load, against the true points without
noise. The exit code is 1 if a requirement is not met.
"""

from __future__ import annotations

import json
import sys
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.tracker.pose_file import MeasuredPoses
from benchmarks.measured_arm import MeasuredArm
from benchmarks.short_form import is_short
from config.arrays import FloatArray
from config.load import load_robot
from dynamics.geometry.clearances import Clearances
from identification.kinematics.calibration import Calibration, calibrate, nominal_arm
from identification.kinematics.gravity import Gravity
from identification.kinematics.pose_design import design_poses

NOISE_M: Final = 2e-5
POSES: Final = 30
CHECKED: Final = 100
BAR_M: Final = 3e-5
BAR_INSIDE: Final = 0.9
BAR_CLAIM: Final = 0.5
"""Smallest ratio of the stated error to the true one; below it the calibration claims too much."""


@dataclass(frozen=True)
class Robot:
    """A robot of the benchmark: nominal point, loads and stiffness of its gears [N m/rad]."""

    name: str
    point_m: tuple[float, float, float]
    load_kg: float
    stiffness: tuple[float, ...]
    rank: int


ROBOTS: Final = (
    Robot("ir361", (0.765, 0.0, 0.0), 8.0, (5e4, 6e4, 2e4), 15),
    Robot("kr15", (0.12, 0.05, -0.1), 13.6, (4e5, 5e5, 2e5, 4e4, 3e4, 1.5e4), 27),
)


@dataclass(frozen=True, eq=False)
class Trial:
    """One calibration and its true errors [m].

    Attributes:
        inside: True for each stiffness whose 95 % interval contains the true value.
        stiffness_error: Relative error of each stiffness.
    """

    found: Calibration
    before_m: FloatArray
    after_m: FloatArray
    inside: tuple[bool, ...]
    stiffness_error: dict[str, float]


def attempt(robot: Robot, seed: int) -> Trial:
    """Calibrate one arm with random errors."""
    point = np.array(robot.point_m)
    arm = MeasuredArm.of(load_robot(robot.name), point, robot.stiffness, seed)
    gravity = Gravity.of_cad(arm.robot, point)
    nominal = nominal_arm(arm.robot, gravity, point)
    clearances = Clearances.of(arm.robot)
    design = design_poses(
        nominal, arm.robot, clearances, count=POSES, load_kg=robot.load_kg, seed=seed
    )
    random = np.random.default_rng(1000 + seed)
    measured = arm.points(design.position, design.load_kg)
    measured = measured + NOISE_M * random.normal(size=measured.shape)
    rows = np.arange(2, 2 + POSES)
    poses = MeasuredPoses("poses.csv", rows, design.position, measured, design.load_kg)
    found = calibrate(arm.robot, poses, gravity, point)
    low = np.array([joint.limits.position_min for joint in arm.robot.joints])
    high = np.array([joint.limits.position_max for joint in arm.robot.joints])
    probes = random.uniform(low, high, (CHECKED, len(low)))
    unloaded = np.zeros(CHECKED)
    true = arm.points(probes, unloaded)
    inside, errors = [], {}
    for each, value, sigma in zip(found.fit.parameters, found.values, found.sigmas, strict=True):
        if each.kind == "compliance":
            real = float(arm.compliance[each.joint])
            # The bodies are 1 % wrong: the floor of a model error is added to the interval.
            inside.append(abs(value - real) <= 2.0 * float(np.hypot(sigma, 0.01 * real)))
            errors[arm.robot.joint_names[each.joint]] = real / float(value) - 1.0
    before = nominal.registered(probes, true).points(probes, unloaded)
    after = found.fit.arm.points(probes, unloaded)
    return Trial(
        found,
        np.linalg.norm(before - true, axis=1),
        np.linalg.norm(after - true, axis=1),
        tuple(inside),
        errors,
    )


def summary(robot: Robot, trials: list[Trial]) -> dict[str, object]:
    """Return the figures of a robot."""
    joints = sorted({name for trial in trials for name in trial.stiffness_error})
    return {
        "robot": robot.name,
        "trials": len(trials),
        "poses": POSES,
        "rank": [trial.found.rank for trial in trials],
        "before_mm": 1e3 * float(np.mean([trial.before_m.mean() for trial in trials])),
        "held_out_mean_mm": 1e3 * float(np.mean([trial.after_m.mean() for trial in trials])),
        "worst_mean_mm": 1e3 * float(max(trial.after_m.mean() for trial in trials)),
        "held_out_max_mm": 1e3 * float(max(trial.after_m.max() for trial in trials)),
        "stated_rms_mm": 1e3 * float(np.mean([trial.found.after.rms_m for trial in trials])),
        "inside": float(np.mean([hit for trial in trials for hit in trial.inside])),
        "stiffness_error_percent": {
            name: 100.0
            * float(
                np.sqrt(
                    np.mean(
                        [
                            trial.stiffness_error[name] ** 2
                            for trial in trials
                            if name in trial.stiffness_error
                        ]
                    )
                )
            )
            for name in joints
        },
    }


def failures(robot: Robot, trials: list[Trial]) -> list[str]:
    """Return a sentence for each requirement that is not met."""
    found = []
    if any(trial.found.rank != robot.rank for trial in trials):
        found.append(f"{robot.name}: a rank differs from {robot.rank}")
    worst = max(trial.after_m.mean() for trial in trials)
    if worst > BAR_M:
        found.append(f"{robot.name}: held-out error {1e3 * worst:.4f} mm > {1e3 * BAR_M:g} mm")
    inside = float(np.mean([hit for trial in trials for hit in trial.inside]))
    if len(trials) > 2 and inside < BAR_INSIDE:
        found.append(f"{robot.name}: {100 * inside:.0f} % of the stiffnesses in their intervals")
    for trial in trials:
        true = float(np.sqrt(np.mean(trial.after_m**2)))
        if trial.found.after.rms_m < BAR_CLAIM * true:
            found.append(f"{robot.name}: states {1e3 * trial.found.after.rms_m:.4f} mm for {true}")
    return found


def main() -> int:
    """Print the figures, and return the exit code."""
    count = 2 if is_short(__doc__) else 10
    failed = []
    for robot in ROBOTS:
        trials = [attempt(robot, seed) for seed in range(count)]
        print(json.dumps(summary(robot, trials)), flush=True)
        failed += failures(robot, trials)
    for sentence in failed:
        print(f"FAILED: {sentence}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
