"""Computing time of the regressor, compared with Pinocchio and with filling an array.

The requirements apply to the regressor of the joint torques of six revolute axes, with 10,000
samples and the columns of the links only. The time is measured from q, v, a to a new array. The
lower limit of the time is that of `np.full` for a new array of the same size. For comparison, a
Python loop over `pinocchio.computeJointTorqueRegressor` stores each result in an existing array.
Each time is the best of several rounds, in which all programs take turns.

Run it with ``python -m benchmarks.regressor [--quick]``.
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Callable

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]

from benchmarks.short_form import is_short
from config.arrays import FloatArray
from dynamics.geometry.kinematics import Chain
from dynamics.model.inverse_dynamics import regressor_gradient, torque_derivatives
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor, torque
from dynamics.terms.rigid_body import RigidBodies

SAMPLES = 10_000
BAR_MEMORY = 3.5
BAR_PEER = 8.0
PINOCCHIO_ORDER = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]  # Ixx Ixy Iyy Ixz Iyz Izz -> Ixx Ixy Ixz Iyy ...


def random_arm(axes: int) -> RobotModel:
    """Return the links of an arm with revolute axes at random places."""
    rng = np.random.default_rng(axes)
    rows = rng.uniform(-1.0, 1.0, (axes, 5)) * [np.pi, 0.1, np.pi, 0.5, 0.5]
    gravity = np.array([0.0, 0.0, -9.81])
    chain = Chain(rows, np.zeros(axes, dtype=np.bool_), gravity, np.zeros(3))
    return RobotModel(tuple(f"joint{i}" for i in range(axes)), chain, (RigidBodies(chain),))


def pinocchio_arm(chain: Chain) -> pin.Model:
    """Return the arm of a chain as a Pinocchio model."""
    model = pin.Model()
    parent = 0
    for (_, _, theta, a, d), fixed in zip(chain.rows, chain.fixed_rotations, strict=True):
        turn = pin.AngleAxis(theta, np.array([0.0, 0.0, 1.0])).toRotationMatrix()
        placement = pin.SE3(fixed @ turn, np.array([a, 0.0, 0.0]) + d * fixed[:, 2])
        parent = model.addJoint(parent, pin.JointModelRZ(), placement, f"joint{parent}")
    return model


def pinocchio_loop(model: pin.Model, motion: FloatArray) -> Callable[[], FloatArray]:
    """Return the regressor by Pinocchio: one call per sample, stored in an array."""
    data = model.createData()
    q, v, a = motion
    out = np.empty((len(q), model.nv, 10 * model.nv))

    def loop() -> FloatArray:
        for k in range(len(q)):
            out[k] = pin.computeJointTorqueRegressor(model, data, q[k], v[k], a[k])
        return out

    return loop


def best_us(rounds: int, *calls: Callable[[], object]) -> list[float]:
    """Return the least time of each call in several rounds, per sample [us]."""
    times = []
    for _ in range(rounds):
        row = []
        for call in calls:
            began_s = time.perf_counter()
            call()
            row.append(time.perf_counter() - began_s)
        times.append(row)
    return [min(column) / SAMPLES * 1e6 for column in zip(*times, strict=True)]


def check(ours: FloatArray, theirs: FloatArray) -> None:
    """Raise an error if the two results differ."""
    samples, axes, _ = ours.shape
    ordered = theirs.reshape(samples, axes, axes, 10)[..., PINOCCHIO_ORDER].reshape(ours.shape)
    np.testing.assert_allclose(ours, ordered, rtol=0, atol=1e-9)


def on_one_core(call: Callable[[], object]) -> Callable[[], object]:
    """Return a call that runs with this process restricted to one core."""

    def run() -> None:
        cores = os.sched_getaffinity(0)
        os.sched_setaffinity(0, {min(cores)})
        try:
            call()
        finally:
            os.sched_setaffinity(0, cores)

    return run


def measure(axes: int, rounds: int) -> tuple[float, float, float]:
    """Print one arm's figures; return the times of our regressor, the limit and Pinocchio [us]."""
    model = random_arm(axes)
    motion = np.random.default_rng(0).uniform(-2.0, 2.0, (3, SAMPLES, axes))
    peer = pinocchio_loop(pinocchio_arm(model.chain), motion)
    check(regressor(model, *motion), peer())
    base_wrench_regressor(model, *motion)
    shape = (SAMPLES, axes, 10 * axes)

    def ours() -> FloatArray:
        return regressor(model, *motion)

    value, limit, zeros, wrench, one_core, loop = best_us(
        rounds,
        ours,
        lambda: np.full(shape, 1.0),
        lambda: np.zeros(shape).fill(1.0),
        lambda: base_wrench_regressor(model, *motion),
        on_one_core(ours),
        peer,
    )
    print(
        f"{axes} axes: torques {value:.3f} us a sample ({one_core:.3f} on one core),"
        f" base wrench {wrench:.3f}; np.full {limit:.3f}, np.zeros and fill {zeros:.3f},"
        f" Pinocchio loop {loop:.2f}"
    )
    return value, limit, loop


def measure_the_rest(rounds: int) -> None:
    """Print the times of the other computations for six axes."""
    model = random_arm(6)
    rng = np.random.default_rng(0)
    q, v, a = rng.uniform(-2.0, 2.0, (3, SAMPLES, 6))
    theta, weights = rng.standard_normal(60), rng.standard_normal((SAMPLES, 6, 60))

    def calls() -> list[Callable[[], object]]:
        return [
            lambda: torque(model, q, v, a, theta),
            lambda: torque_derivatives(model, q, v, a, theta),
            lambda: regressor_gradient(model, q, v, a, weights),
        ]

    for call in calls():
        call()
    tau, by_motion, gradient = best_us(rounds, *calls())
    print(
        f"6 axes: torque {tau:.3f} us a sample, its derivatives {by_motion:.3f},"
        f" gradient through the regressor {gradient:.3f}"
    )


def main() -> int:
    """Measure, and print the figures; the last line is one JSON object."""
    rounds = 5 if is_short(__doc__) else 30
    measure(3, rounds)
    value, limit, peer = measure(6, rounds)
    measure(7, rounds)
    measure_the_rest(rounds)
    holds = value <= BAR_MEMORY * limit and peer >= BAR_PEER * value
    result = {
        "name": "regressor",
        "value": round(value, 3),
        "unit": "us per sample, six axes, 10,000 samples",
        "ratios": {
            "np.full of an array of the same size": round(value / limit, 2),
            "Pinocchio in a loop, over our regressor": round(peer / value, 1),
        },
        "bar": (
            f"at most {BAR_MEMORY:g} times np.full, at least {BAR_PEER:g} times faster than the"
            " loop over Pinocchio"
        ),
        "holds": holds,
    }
    print(json.dumps(result))
    return 0 if holds else 1


if __name__ == "__main__":
    sys.exit(main())
