"""Pre-compensation of a circle of 40 cm at 0.6 m/s on the simulated arm, and of loops with known
responses.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import control
import numpy as np
import pytest

from acquisition.motion.kinds.circle import CircleMotion
from acquisition.motion.samples import MotionSamples, Phase
from acquisition.recording.recording import Recording
from compensation.feedforward.inverse import InverseFilter, feedforward, periodic_feedforward
from compensation.feedforward.tracking_error import TrackingError, tracking_error
from compensation.loops.velocity_loop import VelocityLoop
from config.errors import ConfigError
from config.load import LoadedCell, load_robot
from dynamics.geometry.inverse_kinematics import follow_tool_path
from dynamics.geometry.kinematics import Chain, forward, link_transforms
from dynamics.model.robot_model import RobotModel, torque
from dynamics.model.true_parameters import true_parameters
from tests.builders.raised_codes import raises_code

Drive = Callable[..., Recording]
Array = np.ndarray


def circle(**changes: object) -> CircleMotion:
    fields = {
        "kind": "circle",
        "robot": "ir361",
        "centre_m": (0.575, -0.078, -1.724),
        "radius_m": 0.2,
        "speed_m_s": 0.6,
        "near": (0.1, -0.1, 0.4),
        "periods": 4,
    }
    return CircleMotion.model_validate(fields | changes)


def loop(gain: float, integral_s: float) -> VelocityLoop:
    return VelocityLoop("axis", gain, integral_s, 0.0, 0.0005, (), np.zeros((0, 0)), 1.0, ())


@pytest.fixture(scope="module")
def samples(cell: LoadedCell) -> MotionSamples:
    return circle().plan(cell.robot, cell.config.cycle_time_s).whole()


@pytest.fixture(scope="module")
def loops(cell: LoadedCell) -> list[VelocityLoop]:
    assert cell.plant is not None
    return [loop(a.velocity_gain_nm_s, a.velocity_integral_time_s) for a in cell.plant.axes]


@pytest.fixture(scope="module")
def wanted_torque(cell: LoadedCell, samples: MotionSamples) -> Array:
    """Torque by our model with the plant's rigid bodies and linear friction."""
    assert cell.plant is not None
    model = RobotModel.from_description(cell.robot)
    parameters = true_parameters(model, cell.robot, cell.plant)
    return np.asarray(
        torque(model, samples.position, samples.velocity, samples.acceleration, parameters)
    )


def error_of(
    cell: LoadedCell, drive: Drive, samples: MotionSamples, ahead: Array | None
) -> TrackingError:
    recording = drive(replace(samples, feedforward=ahead), 3)
    main = samples.phase == Phase.MAIN
    rows = samples.samples_per_period
    assert rows is not None
    mean = recording.position[main].reshape(-1, rows, 3).mean(axis=0)
    chain = Chain.from_description(cell.robot)
    return tracking_error(chain, samples.position[main][:rows], mean)


class TestCircle:
    def test_the_tool_point_moves_on_the_circle_at_constant_speed(
        self, cell: LoadedCell, samples: MotionSamples
    ) -> None:
        chain = Chain.from_description(cell.robot)
        main = samples.phase == Phase.MAIN
        points = forward(chain, samples.position[main])
        away = points - np.array(circle().centre_m)
        np.testing.assert_allclose(np.linalg.norm(away, axis=1), 0.2, atol=1e-7)
        np.testing.assert_allclose(away[:, 2], 0.0, atol=1e-7)
        step = np.linalg.norm(np.diff(points, axis=0), axis=1) / cell.config.cycle_time_s
        np.testing.assert_allclose(step, 0.6, rtol=2e-3)

    def test_six_axes_keep_their_orientation(self) -> None:
        robot = load_robot("ur10e")
        near = (0.3, -1.2, 1.5, -1.8, -1.5, 0.2)
        chain = Chain.from_description(robot)
        centre = forward(chain, np.array([near]))[0] - [0.0, 0.1, 0.0]
        motion = circle(
            robot="ur10e", centre_m=tuple(centre.tolist()), radius_m=0.1, near=near, speed_m_s=0.2
        )
        turns = motion.as_fourier(robot, 0.01).trajectory(robot, 0.01)
        poses = link_transforms(chain, turns.position(turns.sample_times_s))[:, -1, :3, :3]
        wanted = link_transforms(chain, np.array([near]))[0, -1, :3, :3]
        np.testing.assert_allclose(poses, np.broadcast_to(wanted, poses.shape), atol=1e-7)

    @pytest.mark.parametrize(
        ("changes", "code", "values"),
        [
            ({"centre_m": (3.0, 0.0, -1.0)}, "RID-PATH-REACH", ("-1000 mm",)),
            ({"near": (0.0, 0.0)}, "RID-MOTION-JOINTS", ("near", "2 values", "3 joints")),
        ],
    )
    def test_an_undrivable_circle_is_refused(
        self, cell: LoadedCell, changes: dict[str, object], code: str, values: tuple[str, ...]
    ) -> None:
        with raises_code(ConfigError, code, *values):
            circle(**changes).plan(cell.robot, 0.008)

    def test_a_point_out_of_reach_is_refused_with_the_tools_position(
        self, cell: LoadedCell
    ) -> None:
        chain, near = Chain.from_description(cell.robot), np.array([0.1, -0.1, 0.4])
        tool = forward(chain, near[np.newaxis])[0]
        place = ", ".join(str(round(1e3 * x)) for x in tool)
        with raises_code(ConfigError, "RID-PATH-REACH", "point 1", f"({place} mm)"):
            follow_tool_path(chain, (2.0 * tool)[np.newaxis], near)

    def test_joint_positions_reach_the_given_tool_positions(self, cell: LoadedCell) -> None:
        chain = Chain.from_description(cell.robot)
        points = circle().points(np.linspace(0.0, 1.0, 50))
        found = follow_tool_path(chain, points, np.array([0.1, -0.1, 0.4]))
        np.testing.assert_allclose(forward(chain, found), points, atol=1e-10)


class TestCompensation:
    def test_velocity_feedforward_alone_leaves_millimetres(
        self, cell: LoadedCell, drive: Drive, samples: MotionSamples
    ) -> None:
        error = error_of(cell, drive, samples, None)
        assert 1e-3 < error.mean_m < 3e-3
        assert (error.joint_peak < 0.01).all()

    def test_compensation_on_the_bins_leaves_less_than_a_tenth(
        self,
        cell: LoadedCell,
        drive: Drive,
        samples: MotionSamples,
        loops: list[VelocityLoop],
        wanted_torque: Array,
    ) -> None:
        before = error_of(cell, drive, samples, None)
        main = np.flatnonzero(samples.phase == Phase.MAIN)
        rows = samples.samples_per_period
        period = slice(int(main[0]), int(main[0]) + (rows or 0))
        ahead_of_period = periodic_feedforward(
            loops, samples.velocity[period], wanted_torque[period], samples.sample_period_s
        )
        ahead = np.array(samples.velocity)
        turning = (samples.phase == Phase.MAIN) | (samples.phase == Phase.TRANSIENT)
        ahead[turning] = np.tile(ahead_of_period, (int(turning.sum()) // len(ahead_of_period), 1))
        after = error_of(cell, drive, samples, ahead)
        assert after.mean_m < before.mean_m / 20.0
        assert after.max_m < before.max_m / 12.0

    def test_compensation_in_time_from_rest_to_rest_works_too(
        self,
        cell: LoadedCell,
        drive: Drive,
        samples: MotionSamples,
        loops: list[VelocityLoop],
        wanted_torque: Array,
    ) -> None:
        before = error_of(cell, drive, samples, None)
        ahead = feedforward(loops, samples.velocity, wanted_torque, samples.sample_period_s)
        after = error_of(cell, drive, samples, ahead)
        assert after.mean_m < before.mean_m / 15.0
        assert after.max_m < before.max_m / 10.0


class TestInverseFilter:
    def test_the_inverse_filter_inverts_the_controller(self) -> None:
        """Compare with python-control's simulation of K_p (1 + 1 / (T_i s))."""
        step_s, gain, integral_s = 1e-3, 300.0, 0.1
        times = np.arange(2000) * step_s
        torque_nm = 40.0 * np.sin(2.0 * math.pi * 2.0 * times)
        inverse = InverseFilter(
            gain=np.array([gain]),
            integral_time_s=np.array([integral_s]),
            step_s=step_s,
            torque_nm=torque_nm[:1],
        )
        error = np.array([inverse.step(np.array([value]))[0] for value in torque_nm])
        controller = control.ss(control.tf([gain * integral_s, gain], [integral_s, 0.0]))
        found = control.forced_response(controller, times, error).outputs
        np.testing.assert_allclose(found, torque_nm, atol=0.05)

    def test_the_integrator_supplies_a_constant_torque(self) -> None:
        held = np.array([120.0, -40.0])
        inverse = InverseFilter(
            gain=np.array([300.0, 200.0]),
            integral_time_s=np.array([0.1, 0.05]),
            step_s=0.008,
            torque_nm=held,
        )
        for _ in range(100):
            np.testing.assert_allclose(inverse.step(held), 0.0, atol=1e-12)

    def test_a_step_decays_with_the_integral_time(self) -> None:
        inverse = InverseFilter(
            gain=np.array([100.0]),
            integral_time_s=np.array([0.1]),
            step_s=0.001,
            torque_nm=np.array([0.0]),
        )
        first = inverse.step(np.array([50.0]))[0]
        for _ in range(100):
            last = inverse.step(np.array([50.0]))[0]
        assert last / first == pytest.approx(math.exp(-1.0), rel=1e-2)
