"""Simulation of an arm in closed loop without a bus; commands act one cycle later."""

from __future__ import annotations

import numpy as np

from acquisition.motion.samples import MotionSamples
from acquisition.recording.recording import Recording
from compensation.loops.velocity_loop import VelocityLoop
from config.arrays import FloatArray
from config.load import LoadedCell
from config.simulation.plant import PlantConfig
from mock_hw.plant.plant import Plant

SETTLE_ROWS = 60


def plant_at(cell: LoadedCell, truth: PlantConfig, pose: FloatArray, seed: int = 0) -> Plant:
    """Return the simulated robot of a cell, at rest in a pose [rad or m]."""
    axes = tuple(
        axis.model_copy(update={"initial_position": float(at)})
        for axis, at in zip(truth.axes, pose, strict=True)
    )
    truth = truth.model_copy(update={"axes": axes})
    return Plant(cell.robot, truth, cell.config.torque_filter, seed)


def closed_loop(
    cell: LoadedCell,
    truth: PlantConfig,
    samples: MotionSamples,
    seed: int = 0,
    *,
    wrench: FloatArray | None = None,
) -> Recording:
    """Simulate a motion with robot, position loop, and the rounding of drives and bus.

    A commanded speed acts from the next SYNC on. It is the output of the position loop plus the
    motion's feedforward, or plus the motion's velocity if there is no feedforward. With a coupled
    wrist, encoders and drives belong to the motors, as on the bus. `wrench` (samples, 6) receives
    the true wrench of the base.
    """
    samples = samples.whole()
    joints, step_s = cell.robot.joints, samples.sample_period_s
    plant = plant_at(cell, truth, samples.position[0], seed)
    ratio = np.array([abs(joint.gear_ratio) for joint in joints])
    counts = ratio * [axis.encoder_increments_per_motor_rev / (2.0 * np.pi) for axis in truth.axes]
    permille_nm = 1e-3 * ratio * [axis.rated_motor_torque_nm for axis in truth.axes]
    n = len(joints)
    to_joints = np.eye(n) if cell.robot.coupling is None else np.array(cell.robot.coupling)
    to_motors = np.linalg.inv(to_joints)
    powered, free = np.ones(n, dtype=np.bool_), np.zeros(n, dtype=np.bool_)
    ahead = samples.velocity if samples.feedforward is None else samples.feedforward
    position, torque, command = np.zeros((3, len(samples), n))
    before = now = sent = np.zeros(n)
    for row in range(-SETTLE_ROWS, len(samples)):
        at = max(row, 0)
        measured = to_joints @ (plant.position_counts() / counts)
        speed = cell.config.position_gain_per_s * (samples.position[at] - measured)
        if row >= 0:
            position[row], torque[row] = measured, permille_nm * plant.torque_permille()
            speed = speed + ahead[row]
            if wrench is not None:
                wrench[row] = plant.base_wrench
        command[at] = to_joints @ (np.rint(to_motors @ speed * counts) / counts)
        before, now, sent = now, sent, to_motors @ command[at]
        plant.advance(step_s, before, now, powered, free)
    rows = np.arange(len(samples))
    return Recording(
        joint_names=samples.joint_names,
        time_s=np.asarray(rows * step_s, dtype=float),
        position=position,
        torque_nm=torque,
        valid=np.ones(len(samples), dtype=np.bool_),
        phase=samples.phase,
        sample_index=rows,
        source="cell",
        target_position=samples.position,
        velocity_command=command,
        sample_period_s=step_s,
        samples_per_period=samples.samples_per_period,
        torque_filter=cell.config.torque_filter,
    )


def true_loops(cell: LoadedCell) -> list[VelocityLoop]:
    """Return the true velocity loops of a cell's simulated robot."""
    assert cell.plant is not None
    return [
        VelocityLoop(
            joint_name=joint.name,
            gain=axis.velocity_gain_nm_s,
            integral_time_s=axis.velocity_integral_time_s,
            delay_s=0.0,
            lag_s=1.0 / (2.0 * np.pi * axis.current_loop_bandwidth_hz),
            names=("gain", "integral_time_s"),
            covariance=np.zeros((2, 2)),
            p_value=1.0,
            trials=(),
        )
        for joint, axis in zip(cell.robot.joints, cell.plant.axes, strict=True)
    ]
