"""Fastest timing of random splines under torque limits: violations, time and processor time.

The robot is the bundled UR10e with inertias from CAD data, armatures, and Coulomb, viscous and
offset friction. It follows 100 splines through six random poses, with 1,000 intervals and rows
every 2 ms. Every row is checked with the torque of Pinocchio's `rnea` with armatures, plus friction
that is computed here. For comparison with the optimum, the same problem is solved on a grid eight
times as fine, without averaging or resampling. Processor time is the best of some rounds for the
whole call: model along the path, scans, rows and their verification.

If toppra (https://pypi.org/project/toppra) can be imported, it solves the same problems, with the
same path, grid and limits, and torques by Pinocchio. toppra runs twice: with its default settings,
and with its interpolating scheme and constant acceleration. It includes Coulomb friction but no
viscous friction.

Run it with ``python -m benchmarks.retime [--quick]``.
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

from acquisition.motion.samples import JointTrajectory
from benchmarks.short_form import is_short
from compensation.timing.joint_curve import JointCurve
from compensation.timing.limits import TimingLimits
from compensation.timing.path_rows import PathDynamics, PathRows
from compensation.timing.profile import fastest
from compensation.timing.timed_path import PathTimer
from config.arrays import FloatArray
from config.load import load_robot
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from dynamics.model.cad import cad_parameters
from dynamics.model.one_sample import SampleTorque
from dynamics.model.robot_model import RobotModel

CYCLE_S: Final = 0.002
POINTS: Final = 6
INTERVALS: Final = 1000
FINER: Final = 8
BAR_OVER_OPTIMUM: Final = 0.005
BAR_CPU_MS: Final = 10.0
JUDGED: Final = 1.0 + 1e-9

COULOMB = np.array([20.0, 20.0, 12.0, 5.0, 5.0, 4.0])
VISCOUS = np.array([15.0, 18.0, 12.0, 5.0, 5.0, 4.0])
OFFSET = np.array([0.5, -0.5, 0.3, 0.2, -0.2, 0.1])
ARMATURE = np.array([1.5, 1.5, 0.8, 0.2, 0.2, 0.2])
TORQUE_SHARE = np.array([0.6, 0.9, 0.8, 0.5, 0.5, 0.5])
ACCELERATION = 40.0


@dataclass(frozen=True, eq=False)
class SixAxes:
    """A robot with friction, in the form of the project and in that of Pinocchio.

    Attributes:
        robot: Description of the robot, with armatures.
        torque: Its torque model.
        limits: Limits of the timing.
        judge: Pinocchio's model of links and armatures; it checks the torques of the rows.
    """

    robot: RobotDescription
    torque: SampleTorque
    limits: TimingLimits
    judge: Any

    @classmethod
    def ur10e(cls) -> SixAxes:
        """Return the bundled robot with plausible values of friction and armatures."""
        known = load_robot("ur10e")
        joints = tuple(
            joint.model_copy(update={"rotor": None, "armature": True}) for joint in known.joints
        )
        robot = known.model_copy(update={"joints": joints})
        model = RobotModel.from_description(robot)
        theta, _ = cad_parameters(model, robot)
        theta[model.parameter_groups["armature"]] = ARMATURE
        friction = np.stack([COULOMB, VISCOUS, OFFSET], axis=1)
        theta[model.parameter_groups["friction"]] = friction.ravel()
        limits = TimingLimits.of_robot(robot)
        limits = replace(
            limits,
            torque=limits.torque * TORQUE_SHARE,
            acceleration=np.full(len(joints), ACCELERATION),
        )
        judge = _judge(model.chain, theta, robot)
        return cls(robot, SampleTorque.of(model, theta), limits, judge)

    def rigid(self, path: JointTrajectory) -> FloatArray:
        """Return the torques of the rows of a motion, computed by Pinocchio."""
        data = self.judge.createData()
        return np.array([pin.rnea(self.judge, data, *row) for row in zip(*path, strict=True)])

    def judged(self, path: JointTrajectory) -> FloatArray:
        """Return the torques of rows, including friction, as fractions of their limits."""
        v = path.velocity
        friction = COULOMB * np.sign(v) + VISCOUS * v + OFFSET
        return np.asarray(np.abs(self.rigid(path) + friction) / self.limits.torque)

    def spline(self, seed: int) -> tuple[JointCurve, FloatArray]:
        """Return a random path, and the poses through which it goes."""
        poses = np.random.default_rng(seed).uniform(-1.2, 1.2, (POINTS, len(self.robot.joints)))
        return JointCurve.through(poses, self.limits.speed), poses


def _judge(chain: Chain, theta: FloatArray, robot: RobotDescription) -> Any:
    model = pin.Model()
    parent = 0
    for link, (row, fixed) in enumerate(zip(chain.rows, chain.fixed_rotations, strict=True)):
        _, _, turn, a, d = row
        spin = pin.AngleAxis(turn, np.array([0.0, 0.0, 1.0])).toRotationMatrix()
        place = pin.SE3(fixed @ spin, np.array([a, 0.0, 0.0]) + d * fixed[:, 2])
        parent = model.addJoint(parent, pin.JointModelRZ(), place, robot.joints[link].name)
        mass, *rest = theta[10 * link : 10 * link + 10]
        centre = np.array(rest[:3]) / mass
        xx, xy, xz, yy, yz, zz = rest[3:]
        about = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        steiner = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        model.appendBodyToJoint(
            parent, pin.Inertia(mass, centre, about - steiner), pin.SE3.Identity()
        )
    model.armature = ARMATURE.copy()
    model.gravity.linear = np.array(robot.gravity_m_s2)
    return model


def shortest_time_s(six: SixAxes, curve: JointCurve) -> float:
    """Return the shortest time of a path, computed on a fine grid [s]."""
    dynamics = PathDynamics.of(curve, six.robot, six.torque, FINER * INTERVALS)
    rows = PathRows.of(dynamics, six.limits)
    return float(fastest(rows, rows.bounds).time_s[-1])


def cpu_ms(call: Callable[[], object], rounds: int) -> float:
    """Return the lowest processor time of a call in several rounds [ms]."""
    spent = []
    for _ in range(rounds):
        began = time.process_time()
        call()
        spent.append(1e3 * (time.process_time() - began))
    return min(spent)


def time_paths(six: SixAxes, seeds: range, rounds: int) -> dict[str, Any]:
    """Time every path and check every row."""
    timer = PathTimer(six.robot, six.torque, six.limits, CYCLE_S, intervals=INTERVALS)
    timer.timed(six.spline(10_000)[0])  # compiles the kernels
    peaks, over, spent, rows, scans = [], [], [], 0, []
    for seed in seeds:
        curve, _ = six.spline(seed)
        timed = timer.timed(curve)
        path = timed.path
        shares = np.max(
            [
                six.judged(path).max(axis=1),
                (np.abs(path.velocity) / six.limits.speed).max(axis=1),
                (np.abs(path.acceleration) / six.limits.acceleration).max(axis=1),
            ],
            axis=0,
        )
        peaks.append(shares)
        rows += len(shares)
        scans.append(timed.scans)
        over.append((len(shares) - 1) * CYCLE_S / shortest_time_s(six, curve) - 1.0)
        spent.append(cpu_ms(partial(timer.timed, curve), rounds))
    above = sum(int((share > JUDGED).sum()) for share in peaks)
    return {
        "paths": len(seeds),
        "rows": rows,
        "rows_above": above,
        "peak": max(float(share.max()) for share in peaks),
        "over_optimum_median": float(np.median(over)),
        "over_optimum_worst": float(np.max(over)),
        "scans_worst": int(np.max(scans)),
        "cpu_ms_median": float(np.median(spent)),
        "cpu_ms_worst": float(np.max(spent)),
    }


def time_paths_by_toppra(six: SixAxes, seeds: range, rounds: int) -> dict[str, Any]:
    """Time every path with toppra; return an empty result if it cannot be imported."""
    try:
        import toppra  # type: ignore[import-not-found]  # pyright: ignore[reportMissingImports]
    except ImportError:
        return {}
    from toppra import (  # pyright: ignore[reportMissingImports]
        algorithm,
        constraint,
    )

    toppra.setup_logging("ERROR")
    data = six.judge.createData()
    zero = np.zeros(len(six.robot.joints))

    def inverse_dynamics(q: FloatArray, v: FloatArray, a: FloatArray) -> FloatArray:
        return np.asarray(pin.rnea(six.judge, data, q, v, a) + OFFSET * (1.0 + zero))

    def both(size: FloatArray) -> FloatArray:
        return np.stack([-size, size], axis=1)

    schemes = constraint.DiscretizationType
    found: dict[str, Any] = {}
    for name, scheme, output in (
        ("default", schemes.Collocation, "ParametrizeSpline"),
        ("interpolating", schemes.Interpolation, "ParametrizeConstAccel"),
    ):

        def timed(
            curve: JointCurve, poses: FloatArray, scheme: Any = scheme, output: str = output
        ) -> Any:
            limits, knots = six.limits, np.asarray(curve.curve.x)
            made = [
                constraint.JointVelocityConstraint(both(limits.speed)),
                constraint.JointAccelerationConstraint(
                    both(limits.acceleration), discretization_scheme=scheme
                ),
                constraint.JointTorqueConstraint(
                    inverse_dynamics, both(limits.torque), COULOMB, discretization_scheme=scheme
                ),
            ]
            path = toppra.SplineInterpolator(knots, poses, bc_type="not-a-knot")
            grid = np.linspace(knots[0], knots[-1], INTERVALS + 1)
            instance = algorithm.TOPPRA(made, path, gridpoints=grid, parametrizer=output)
            return instance.compute_trajectory(0.0, 0.0)

        peaks, over, spent, failed = [], [], [], 0
        for seed in seeds:
            curve, poses = six.spline(seed)
            motion = timed(curve, poses)
            if motion is None:
                failed += 1
                continue
            at_s = np.arange(0.0, motion.duration, CYCLE_S)
            path = JointTrajectory(*(motion(at_s, order) for order in range(3)))
            peaks.append(float(six.judged(path).max()))
            over.append(motion.duration / shortest_time_s(six, curve) - 1.0)
            spent.append(cpu_ms(partial(timed, curve, poses), max(1, rounds // 3)))
        found[name] = {
            "failed": failed,
            "paths_above": int((np.array(peaks) > JUDGED).sum()),
            "peak_median": float(np.median(peaks)),
            "peak_worst": float(np.max(peaks)),
            "over_optimum_median": float(np.median(over)),
            "cpu_ms_median": float(np.median(spent)),
        }
    return found


def main() -> int:
    """Measure, and print the figures; return 0 if every requirement is met."""
    quick = is_short(__doc__)
    seeds, rounds = range(10 if quick else 100), 2 if quick else 5
    six = SixAxes.ur10e()
    own = time_paths(six, seeds, rounds)
    print(
        f"{own['paths']} paths, {own['rows']} rows: {own['rows_above']} above a limit, largest"
        f"  fraction of a limit {own['peak']:.4f}; time over the optimum: median"
        f" {100 * own['over_optimum_median']:.2f} %, worst {100 * own['over_optimum_worst']:.2f} %;"
        f" processor time per path: median {own['cpu_ms_median']:.1f} ms, worst"
        f" {own['cpu_ms_worst']:.1f} ms"
    )
    peer = time_paths_by_toppra(six, seeds, rounds)
    for name, values in peer.items():
        print(
            f"toppra, {name}: {values['paths_above']} paths above a torque limit, peak"
            f" {values['peak_median']:.3f} in the median and {values['peak_worst']:.3f} at worst;"
            f" {100 * values['over_optimum_median']:.2f} % over the optimum;"
            f" {values['cpu_ms_median']:.1f} ms a path; {values['failed']} failed"
        )
    if not peer:
        print("toppra is not installed: no comparison")
    held = {
        "rows_above": own["rows_above"] == 0,
        "over_optimum": own["over_optimum_worst"] <= BAR_OVER_OPTIMUM,
        "cpu": own["cpu_ms_median"] <= BAR_CPU_MS,
    }
    print(json.dumps({"benchmark": "retime", "ours": own, "toppra": peer, "held": held}))
    return 0 if all(held.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
