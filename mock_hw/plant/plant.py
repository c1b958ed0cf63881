"""The simulated robot: its motion by the drives' commands, and the values that drives measure.

The integration has outer and inner steps. For each outer step, Pinocchio computes mass matrix and
bias at the predicted state in its middle; the kernel in `mock_hw.plant.servo_loops` computes the
inner steps. Both methods are of second order, so that the samples satisfy the equations of motion
with errors far below the torque noise.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy.typing import ArrayLike, NDArray

from config.cell.torque_filter import ButterworthFilter
from config.robot.robot import RobotDescription
from config.simulation.plant import PlantConfig
from mock_hw.plant import servo_loops as rows
from mock_hw.plant.axis_rows import axis_rows, spring_entries
from mock_hw.plant.load_transfer import LoadTransfer
from mock_hw.plant.rigid_bodies import (
    BaseWrench,
    build_rigid_bodies,
    last_body,
    output_columns,
    set_last_body,
)
from mock_hw.plant.thermal import MotorTemperatures
from mock_hw.plant.torque_filter import discretise, filter_poles

Vector = NDArray[np.float64]

OUTER_STEP_S = 0.002
INNER_STEP_S = 0.0001
_INT16_MAX = 32767


class Plant:
    """A robot with motors, gears, friction, brakes and the sensors of its drives.

    Positions are in rad or m and torques in N m or N, at the link side, in the order of the robot's
    joints. Commands, encoders, torques, friction and brakes refer to the motors. With a coupled
    wrist or an elastic gear, the motors' coordinates differ from those of the joints; `position`
    and `velocity` are those of the joints. Equal seeds and equal calls give identical results.

    Args:
        robot: Description of the robot, as in the robot file.
        plant: True parameters. Use ``plant.without_unmodelled()`` for a robot without unmodelled
            effects.
        torque_filter: Anti-alias filter between the motor's torque and its measurement; None for no
            filter.
        seed: Random seed of the torque noise.

    Raises:
        ConfigError: Plant and robot do not fit each other.
    """

    def __init__(
        self,
        robot: RobotDescription,
        plant: PlantConfig,
        torque_filter: ButterworthFilter | None = None,
        seed: int = 0,
    ) -> None:
        count = len(robot.joints)
        self._robot = robot
        self._truth = plant
        ratio = np.array([abs(joint.gear_ratio) for joint in robot.joints])
        increments = np.array([axis.encoder_increments_per_motor_rev for axis in plant.axes])
        rated = np.array([axis.rated_motor_torque_nm for axis in plant.axes])
        peak = np.array([axis.peak_motor_torque_nm for axis in plant.axes])
        self._counts_per_position = increments * ratio / (2.0 * math.pi)
        self._torque_per_permille = 0.001 * rated * ratio
        self._peak_torque: Vector = peak * ratio
        self._noise_nm = np.array([axis.torque_noise_nm for axis in plant.axes])
        self._axes = axis_rows(robot, plant)
        self._cold_axes = self._axes.copy()
        self._heat = MotorTemperatures(robot, plant)
        self._spring = spring_entries(robot, plant)

        self._transfers: list[LoadTransfer] = []
        self.attach(plant.attached)
        self._joint_of = np.eye(count) if robot.coupling is None else np.array(robot.coupling)
        self._coupled = robot.coupling is not None
        self._outputs = output_columns(plant)
        columns = self._gearing.shape[1]
        self._mass = np.zeros((columns, columns))
        self._bias = np.zeros(columns)

        self._watched: list[tuple[float, Vector]] | None = None

        self._poles, self._residues, self._weights = filter_poles(torque_filter)
        self._filter_gains: dict[float, NDArray[np.complex128]] = {}
        self._filter_state = np.zeros((len(self._poles), count), dtype=np.complex128)

        self._state: Vector = np.zeros((rows.STATE_ROWS, columns))
        initial = np.array([axis.initial_position for axis in plant.axes])
        if self._coupled:
            initial = np.linalg.solve(self._joint_of, initial)
        self._state[rows.POSITION, :count] = initial
        self._state[rows.POSITION, self._outputs] = initial
        self._motors: Vector = self._state[:, :count]
        self._command = np.zeros((rows.COMMAND_ROWS, count))
        self._random = np.random.default_rng(seed)
        self._noise = np.zeros(count)
        self._time_s = 0.0

    @property
    def time_s(self) -> float:
        """Simulated time since the start of the plant [s]."""
        return self._time_s

    @property
    def position(self) -> Vector:
        """Copy of the true joint positions, (n,) [rad or m]."""
        return self._to_joints(self._state[rows.POSITION])

    @property
    def velocity(self) -> Vector:
        """Copy of the true joint velocities, (n,) [rad/s or m/s]."""
        return self._to_joints(self._state[rows.VELOCITY])

    @property
    def actuator_velocity(self) -> Vector:
        """Copy of the motors' true velocities, link side, (n,) [rad/s or m/s]."""
        return np.array(self._motors[rows.VELOCITY])

    @property
    def torque(self) -> Vector:
        """Copy of the true motor torques, link side, (n,) [N m or N]."""
        return np.array(self._motors[rows.TORQUE])

    @property
    def base_wrench(self) -> Vector:
        """Present wrench of the base on the robot, (6,); see `BaseWrench`."""
        return self._base_wrench(self._state[: rows.ACCELERATION + 1])

    @property
    def temperature_k(self) -> Vector:
        """Copy of the motors' temperatures, (n,) [K]."""
        return self._heat.temperature_k.copy()

    @property
    def attached(self) -> str | None:
        """Name of the payload on the flange; None if the flange is empty."""
        return self._truth.attached

    def attach(self, payload: str | None) -> None:
        """Mount one of the plant file's payloads on the flange, or remove the payload (None).

        Raises:
            ConfigError: There is no such payload, or plant and robot do not fit each other.
        """
        self._truth = self._truth.with_payload(payload)
        bodies = build_rigid_bodies(self._robot, self._truth)
        self._model = bodies.model
        self._data: Any = self._model.createData()
        self._gearing = bodies.gearing
        self._entries = bodies.entries()
        self._base_wrench = BaseWrench(self._robot, self._truth)

    def transfer(self, transfers: Sequence[LoadTransfer], origin_s: float) -> None:
        """Schedule changes of the payload; they replace earlier ones that have not ended.

        Args:
            transfers: The changes, in the order of time.
            origin_s: Time of the plant from which their `begin_s` counts [s].
        """
        self._transfers = [replace(each, begin_s=origin_s + each.begin_s) for each in transfers]

    def watch_base(self, watched: bool) -> None:
        """Start or stop recording the base wrench for `take_base_wrenches`."""
        if watched != (self._watched is not None):
            self._watched = [] if watched else None

    def take_base_wrenches(self) -> tuple[Vector, Vector]:
        """Return the base wrench that was recorded since the last call.

        Returns:
            `end_s`, shape (m,). End times of intervals, since the start of the plant [s]; each
            interval begins at the end of the previous one. `wrench`, shape (m, 6). Mean of the base
            wrench over each interval, including the impulses by velocity jumps.
        """
        taken = self._watched or []
        if taken:
            self._watched = []
        end_s = np.array([time_s for time_s, _ in taken])
        return end_s, np.array([wrench for _, wrench in taken]).reshape(-1, 6)

    def advance(
        self,
        duration_s: float,
        velocity_start: ArrayLike,
        velocity_end: ArrayLike,
        powered: ArrayLike,
        braked: ArrayLike,
        torque_limit: ArrayLike | None = None,
    ) -> None:
        """Advance the plant in time.

        Args:
            duration_s: Duration [s]; not negative.
            velocity_start: Shape (n,). The motors' velocity commands at the beginning, at the link
                side [rad/s or m/s].
            velocity_end: Shape (n,). The commands at the end; they change linearly during the
                interval.
            powered: Shape (n,). True if the drive's velocity loop runs; if False, the motor has no
                torque.
            braked: Shape (n,). True if the holding brake is closed.
            torque_limit: Shape (n,). The drives' torque limits at the link side [N m or N]; used if
                lower than the motors' peak torques.

        Raises:
            ValueError: The duration is negative or not finite.
        """
        if not 0.0 <= duration_s < math.inf:
            raise ValueError(f"duration_s must be finite and not negative, but it is {duration_s}")
        if duration_s == 0.0:
            return
        command = self._command
        command[rows.COMMAND_START] = velocity_start
        command[rows.COMMAND_SLOPE] = velocity_end
        command[rows.COMMAND_SLOPE] -= command[rows.COMMAND_START]
        command[rows.COMMAND_SLOPE] /= duration_s
        command[rows.POWERED] = powered
        command[rows.BRAKED] = braked
        command[rows.TORQUE_LIMIT] = self._peak_torque
        if torque_limit is not None:
            np.minimum(torque_limit, self._peak_torque, out=command[rows.TORQUE_LIMIT])
        if self._heat.any:
            self._apply_temperatures(command)
        outer_steps = max(1, math.ceil(duration_s / OUTER_STEP_S - 1e-9))
        outer_s = duration_s / outer_steps
        inner_steps = max(1, math.ceil(outer_s / INNER_STEP_S - 1e-9))
        inner_s = outer_s / inner_steps
        inertia = rows.Inertia(self._mass, self._bias)
        actuators = rows.Actuators(self._axes, command, self._spring)
        torque_filter = rows.TorqueFilter(self._gains(inner_s), self._filter_state)
        for step in range(outer_steps):
            if self._transfers:
                self._transfer_load(self._time_s + (step + 0.5) * outer_s)
            self._renew_rigid_bodies(0.5 * outer_s)
            before = self._state[: rows.ACCELERATION].copy() if self._watched is not None else None
            rows.advance_servo_loops(
                inner_steps,
                inner_s,
                self._time_s + step * outer_s,
                step * outer_s,
                inertia,
                actuators,
                self._state,
                torque_filter,
            )
            if self._watched is not None and before is not None:
                last = step == outer_steps - 1
                end_s = self._time_s + (duration_s if last else (step + 1) * outer_s)
                after = self._state[: rows.ACCELERATION]
                wrench = self._base_wrench.over_step(before, after, outer_s)
                self._watched.append((end_s, wrench))
        self._time_s += duration_s
        if self._heat.any:
            self._heat.advance(duration_s, self._motors[rows.TORQUE], self._motors[rows.VELOCITY])
        self._random.standard_normal(out=self._noise)

    def position_counts(self) -> NDArray[np.int64]:
        """Return the encoder positions [increments], (n,); they are 0 at joint position zero."""
        counts: NDArray[np.int64] = np.floor(
            self._motors[rows.POSITION] * self._counts_per_position
        ).astype(np.int64)
        return counts

    def measured_torque(self) -> Vector:
        """Return the motors' measured torques, (n,): filtered, with noise.

        The drives measure current and use the torque constant at the reference temperature.
        Repeated calls at the same time return the same noise.
        """
        torque: Vector = self._motors[rows.TORQUE]
        if len(self._poles):
            torque = (self._weights @ self._filter_state).real
        if self._heat.any:
            torque = torque / self._heat.torque_constant_factor
        return torque + self._noise_nm * self._noise

    def torque_permille(self) -> NDArray[np.int16]:
        """Return the measured torques in the unit of 6077h, (n,) [0.1 % of rated torque]."""
        permille = np.rint(self.measured_torque() / self._torque_per_permille)
        clipped: NDArray[np.int16] = np.clip(permille, -_INT16_MAX, _INT16_MAX).astype(np.int16)
        return clipped

    def _transfer_load(self, time_s: float) -> None:
        """Set the last link's inertia to that at a time of the present transfer."""
        transfer = self._transfers[0]
        if time_s < transfer.begin_s:
            return
        share = min((time_s - transfer.begin_s) / transfer.duration_s, 1.0)
        before, after = (
            last_body(self._robot, self._truth, payload)
            for payload in (self._truth.attached, transfer.payload)
        )
        parameters = before + share * (after - before)
        set_last_body(self._model, self._robot, parameters)
        self._base_wrench.set_last_body(parameters)
        if share == 1.0:
            self._truth = self._truth.with_payload(transfer.payload)
            del self._transfers[0]

    def _apply_temperatures(self, command: Vector) -> None:
        """Scale friction and torque constants by the effects of the motors' temperatures."""
        friction, constant = self._heat.friction_factor, self._heat.torque_constant_factor
        for row in (rows.COULOMB, rows.VISCOUS, rows.STRIBECK, rows.LOAD_FRICTION):
            np.multiply(self._cold_axes[row], friction, out=self._axes[row])
        np.multiply(self._cold_axes[rows.GAIN], constant, out=self._axes[rows.GAIN])
        command[rows.TORQUE_LIMIT] *= constant

    def _to_joints(self, of_columns: Vector) -> Vector:
        """Convert positions or velocities of motors and gear outputs to those of joints (5.18)."""
        of_outputs: Vector = of_columns[self._outputs]
        if not self._coupled:
            return of_outputs
        return np.asarray(self._joint_of @ of_outputs)

    def _renew_rigid_bodies(self, ahead_s: float) -> None:
        """Compute mass matrix and bias at the state predicted for a time `ahead_s` from now."""
        state = self._state
        acceleration = state[rows.ACCELERATION]
        velocity = state[rows.VELOCITY] + ahead_s * acceleration
        position = state[rows.POSITION] + 0.5 * ahead_s * (state[rows.VELOCITY] + velocity)
        full_position = self._gearing @ position
        full_velocity = self._gearing @ velocity
        rows.reduce_to_actuators(
            pin.crba(self._model, self._data, full_position),
            pin.nonLinearEffects(self._model, self._data, full_position, full_velocity),
            *self._entries,
            self._mass,
            self._bias,
        )

    def _gains(self, step_s: float) -> NDArray[np.complex128]:
        """Return the filter's exact discretisation for inputs that change linearly in a step."""
        gains = self._filter_gains.get(step_s)
        if gains is None:
            gains = discretise(self._poles, self._residues, step_s)
            if len(self._filter_gains) >= 64:
                self._filter_gains.clear()
            self._filter_gains[step_s] = gains
        return gains
