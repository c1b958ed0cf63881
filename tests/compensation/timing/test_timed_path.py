"""Path timed to its limits: analytic optima, special paths, and an independent check."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from benchmarks.retime import SixAxes
from compensation.timing.joint_curve import JointCurve
from compensation.timing.limits import TimingLimits
from compensation.timing.path_rows import PathDynamics, PathRows
from compensation.timing.profile import SpeedOverPath, fastest, limit_curve
from compensation.timing.timed_path import PathTimer
from config.arrays import FloatArray
from config.errors import LimitError
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from dynamics.model.one_sample import SampleTorque
from dynamics.model.robot_model import RobotModel
from tests.builders.raised_codes import raises_code

WIDE = 1e3
MASS, ARM = 2.0, 0.5


def axis(name: str, kind: str = "revolute", torque: float = 20.0, **more: object) -> Joint:
    limits = JointLimits(
        position_min=-6.0, position_max=6.0, velocity=60.0, acceleration=WIDE, torque=torque
    )
    return Joint.model_validate(
        {"name": name, "type": kind, "limits": limits, "friction": (), **more}
    )


def arm(*joints: Joint, alpha: float = math.pi / 2) -> RobotDescription:
    """Return a chain of links of 0.5 m; its axes are parallel, and horizontal by default."""
    rows = [KinematicRow(alpha_rad=alpha)] + [KinematicRow(a_m=ARM)] * (len(joints) - 1)
    return RobotDescription(
        name="few",
        kinematics=Kinematics(convention="modified_dh", rows=tuple(rows)),
        joints=joints,
    )


def torque_of(robot: RobotDescription, **parameters: float) -> SampleTorque:
    """Return a model of point masses at the link ends with the given friction."""
    model = RobotModel.from_description(robot)
    theta = np.zeros(len(model.parameter_names))
    for link in range(len(robot.joints)):
        theta[10 * link : 10 * link + 2] = MASS, MASS * ARM
        theta[10 * link + 7] = theta[10 * link + 9] = MASS * ARM**2
    for name, value in parameters.items():
        theta[model.parameter_names.index(name)] = value
    return SampleTorque.of(model, theta)


def timer_of(robot: RobotDescription, cycle_s: float = 0.002, **parameters: float) -> PathTimer:
    return PathTimer(robot, torque_of(robot, **parameters), TimingLimits.of_robot(robot), cycle_s)


def scan_curve(timer: PathTimer, curve: JointCurve, intervals: int = 1000) -> SpeedOverPath:
    dynamics = PathDynamics.of(curve, timer.robot, timer.torque, intervals)
    rows = PathRows.of(dynamics, timer.limits)
    return fastest(rows, rows.bounds)


def straight_curve(*poses: tuple[float, ...]) -> JointCurve:
    points = np.array(poses, dtype=float)
    return JointCurve.through(points, np.ones(points.shape[1]))


def test_a_mass_accelerates_half_the_way_and_brakes_the_other_half() -> None:
    """T = 2 sqrt(d m / F)."""
    timer = timer_of(arm(axis("slide", "prismatic", 20.0)))
    found = scan_curve(timer, straight_curve((0.0,), (1.5,)))
    assert found.time_s[-1] == pytest.approx(2.0 * math.sqrt(1.5 * MASS / 20.0), rel=1e-6)


def test_coulomb_friction_moves_the_switching_point() -> None:
    """The mass accelerates with F - f and brakes with F + f."""
    robot = arm(axis("slide", "prismatic", 20.0, friction=("coulomb",)))
    timer = timer_of(robot, fc_slide=5.0)
    found = scan_curve(timer, straight_curve((0.0,), (1.5,)))
    up, down = 15.0 / MASS, 25.0 / MASS
    fastest_m_s = math.sqrt(2.0 * 1.5 * up * down / (up + down))
    assert found.time_s[-1] == pytest.approx(fastest_m_s * (1.0 / up + 1.0 / down), rel=2e-3)


def test_viscous_friction_limits_the_speed_exactly() -> None:
    """m dv/dt = F - c v while the speed grows; v = F / c is never exceeded."""
    robot = arm(axis("slide", "prismatic", 20.0, friction=("viscous",)))
    timer = timer_of(robot, fv_slide=10.0)
    found = scan_curve(timer, straight_curve((0.0,), (5.5,)))
    half = len(found.x) // 2
    middle_s, speed = found.time_s[half], np.sqrt(found.x[half]) * 5.5 / found.length[-1]
    assert speed == pytest.approx(2.0 * (1.0 - math.exp(-10.0 * middle_s / MASS)), rel=2e-3)
    assert np.sqrt(found.x).max() * 5.5 / found.length[-1] <= 2.0


def test_a_pendulum_swings_with_its_full_torque() -> None:
    """The work of the drive and braking torques gives the start of braking and the duration."""
    torque, inertia, weight = 20.0, MASS * ARM**2, MASS * ARM * 9.81
    timer = timer_of(arm(axis("swing", torque=torque)))
    begin, end = -1.2, 1.0
    found = scan_curve(timer, straight_curve((begin,), (end,)))

    def lift(q: float) -> float:  # the angle is measured from the horizontal
        return weight * (math.sin(q) - math.sin(begin))

    switch = 0.5 * (begin + end + lift(end) / torque)
    up = quad(
        lambda q: 1.0 / math.sqrt(2.0 / inertia * (torque * (q - begin) - lift(q))), begin, switch
    )[0]
    down = quad(
        lambda q: 1.0 / math.sqrt(2.0 / inertia * (lift(end) - lift(q) + torque * (end - q))),
        switch,
        end,
    )[0]
    assert found.time_s[-1] == pytest.approx(up + down, rel=2e-3)


def test_gravity_beyond_a_torque_limit_is_refused_with_joint_and_pose() -> None:
    timer = timer_of(arm(axis("shoulder", torque=9.0)))
    with raises_code(LimitError, "RID-TIMING-NOT-FEASIBLE", "9.8"):
        timer.timed(straight_curve((-1.4,), (1.4,)))


def zero_inertia_path() -> tuple[PathTimer, JointCurve]:
    """Return the timer and a path of an arm whose joint 2 turns against joint 1.

    At some points of the path, the inertia along it is zero.
    """
    robot = arm(axis("one", torque=60.0), axis("two", torque=25.0))
    return timer_of(robot), straight_curve(
        (-0.8, 1.2), (0.0, 0.0), (0.2, -1.5), (0.9, -2.2), (1.2, -1.0)
    )


def test_zero_inertia_points_are_passed_within_the_limits() -> None:
    timer, curve = zero_inertia_path()
    dynamics = PathDynamics.of(curve, timer.robot, timer.torque, 1000)
    inertia = PathRows.of(dynamics, timer.limits).rows[:, :2, 0]
    assert (np.sign(inertia).min(axis=0) < np.sign(inertia).max(axis=0)).any()
    timed = timer.timed(curve)
    assert (np.abs(timed.torque) <= timer.limits.torque).all()
    best = scan_curve(timer, curve, 20_000).time_s[-1]
    assert (len(timed.torque) - 1) * timer.cycle_s <= 1.01 * best


def test_the_speed_touches_a_limit_everywhere() -> None:
    timer, curve = zero_inertia_path()
    dynamics = PathDynamics.of(curve, timer.robot, timer.torque, 500)
    rows = PathRows.of(dynamics, timer.limits)
    found = fastest(rows, rows.bounds)
    assert (found.x <= limit_curve(rows, rows.bounds) * (1.0 + 1e-9)).all()
    begin, end = rows.rows[:-1], rows.rows[1:]
    u = found.u[:, np.newaxis]
    both = [
        np.abs(part[:, :, 0] * u + part[:, :, 1] * x[:, np.newaxis] + part[:, :, 2]).max(axis=1)
        for part, x in ((begin, found.x[:-1]), (end, found.x[1:]))
    ]
    assert np.max(both) <= 1.0 + 1e-6
    assert np.quantile(np.maximum(*both), 0.02) > 0.99


def test_a_tiny_motion_is_timed_and_a_joint_at_rest_is_ignored() -> None:
    """A small motion is timed, but a rounding error in the position of a resting joint is not
    treated as a motion.
    """
    robot = arm(axis("one", torque=60.0), axis("two", torque=25.0, friction=("coulomb",)))
    timer = timer_of(robot, fc_two=3.0)
    for way in (1e-6, 1e-3, 1.0):
        timed = timer.timed(straight_curve((0.0, 0.3), (way, 0.3 + 1e-14)))
        assert (np.abs(timed.torque) <= timer.limits.torque).all()
        assert timed.path.position[-1, 0] == pytest.approx(way)
        assert np.isfinite(timed.path.acceleration).all()


def test_limits_of_jerk_and_torque_rate_are_kept() -> None:
    timer, curve = zero_inertia_path()
    plain = timer.timed(curve)
    rate, jerk = np.array([1500.0, 600.0]), np.array([1500.0, 2500.0])
    assert (np.abs(np.diff(plain.torque, axis=0)).max(axis=0) / timer.cycle_s > rate).all()
    limits = replace(timer.limits, torque_rate=rate, jerk=jerk)
    soft = replace(timer, limits=limits).timed(curve)
    assert (np.abs(np.diff(soft.torque, axis=0)).max(axis=0) / timer.cycle_s <= rate).all()
    change = np.abs(np.diff(soft.path.acceleration, axis=0)).max(axis=0) / timer.cycle_s
    assert (change <= jerk).all()
    assert len(soft.torque) > len(plain.torque)


def test_the_limit_of_the_rms_torque_is_kept() -> None:
    timer, curve = zero_inertia_path()
    plain = np.sqrt(np.mean(timer.timed(curve).torque ** 2, axis=0))
    limits = replace(timer.limits, torque_rms=0.9 * plain)
    slow = replace(timer, limits=limits).timed(curve)
    found = np.sqrt(np.mean(slow.torque**2, axis=0))
    assert (found <= 0.9 * plain).all()
    with raises_code(LimitError, "RID-TIMING-NOT-FEASIBLE"):
        replace(timer, limits=replace(limits, torque_rms=0.1 * plain)).timed(curve)


def test_the_limit_of_the_base_reaction_is_kept() -> None:
    timer, curve = zero_inertia_path()
    plain = np.abs(timer.timed(curve).wrench).max(axis=0)
    base = np.array([0.7 * plain[0], np.inf, np.inf, np.inf, 0.9 * plain[4], np.inf])
    spared = replace(timer, limits=replace(timer.limits, base=base)).timed(curve)
    assert (np.abs(spared.wrench) <= base).all()


FEW: list[dict[str, Any]] = [
    {"friction": ("coulomb", "viscous", "stribeck"), "stribeck_velocity": 0.1},
    {"friction": ("asymmetric", "cube_root", "cubic"), "efficiency": 0.8},
    {"friction": ("coulomb", "offset", "load")},
]


@settings(max_examples=12)
@given(seed=st.integers(0, 10_000), share=st.floats(0.45, 1.0), cycle_ms=st.sampled_from([2, 5]))
def test_no_row_exceeds_a_limit_for_any_friction_and_gears(
    seed: int, share: float, cycle_ms: int
) -> None:
    rng = np.random.default_rng(seed)
    joints = [
        axis(f"j{k}", torque=torque * share, **more)
        for k, (torque, more) in enumerate(zip((160.0, 90.0, 40.0), FEW, strict=True))
    ]
    robot = arm(*joints)
    model = RobotModel.from_description(robot)
    parameters = {
        name: float(rng.uniform(0.02, 0.1) if name.startswith("cl") else rng.uniform(0.1, 1.5))
        for name in model.parameter_names[30:]
    }
    timer = timer_of(robot, 1e-3 * cycle_ms, **parameters)
    limits = replace(timer.limits, acceleration=np.full(3, 60.0), speed=np.full(3, 4.0))
    points = rng.uniform(-1.5, 1.5, (int(rng.integers(2, 6)), 3))
    timer = replace(timer, limits=limits, intervals=200)
    timed = timer.timed(JointCurve.through(points, limits.speed))
    for values, limit in (
        (timed.torque, limits.torque),
        (timed.path.velocity, limits.speed),
        (timed.path.acceleration, limits.acceleration),
    ):
        assert (np.abs(values) <= limit * (1.0 + 1e-12)).all()
    assert np.array_equal(timed.path.velocity[[0, -1]], np.zeros((2, 3)))
    np.testing.assert_allclose(timed.path.position[[0, -1]], points[[0, -1]], atol=1e-9)


@pytest.fixture(scope="module")
def six_axes() -> SixAxes:
    return SixAxes.ur10e()


def test_pinocchio_and_separate_friction_find_no_row_above_a_limit(six_axes: SixAxes) -> None:
    timer = PathTimer(six_axes.robot, six_axes.torque, six_axes.limits, 0.004)
    for seed in range(3):
        timed = timer.timed(six_axes.spline(seed)[0])
        shares = six_axes.judged(timed.path)
        np.testing.assert_allclose(shares, np.abs(timed.torque) / six_axes.limits.torque, atol=1e-9)
        assert shares.max() <= 1.0
        assert shares.max() > 0.99


def test_velocity_and_acceleration_are_the_derivatives_of_the_positions(six_axes: SixAxes) -> None:
    path = (
        PathTimer(six_axes.robot, six_axes.torque, six_axes.limits, 0.001)
        .timed(six_axes.spline(3)[0])
        .path
    )
    rates: tuple[tuple[FloatArray, FloatArray, float], ...] = (
        (path.position, path.velocity, 2e-4),
        (path.velocity, path.acceleration, 0.2),
    )
    for values, slope, close in rates:
        difference = (values[2:] - values[:-2]) / 0.002
        assert np.abs(difference - slope[1:-1]).mean() < close
