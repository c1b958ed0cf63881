"""Recordings of an arm that warms up; computed by the plant's motor model, not by `Warming`."""

from __future__ import annotations

from typing import Final

import numpy as np

from acquisition.processing.smoothing import SmoothedSignals, low_pass
from config.arrays import FloatArray
from config.load import load_cell
from config.simulation.plant import SimulatedThermal, UnmodelledAxis, UnmodelledEffects
from dynamics.model.robot_model import RobotModel, torque
from mock_hw.plant.thermal import MotorTemperatures
from tests.builders.presliding_arm import arm

STEP_S: Final = 0.02
CUTOFF_HZ: Final = 4.0
COULOMB_NM, VISCOUS_NM_S = 20.0, 10.0
FALL_PER_K: Final = 0.02


def motors(time_constant_s: tuple[float | None, ...], copper_w: float) -> MotorTemperatures:
    """Return three motors with these time constants; motors without a time constant stay cold."""
    loaded = load_cell("ir361")
    plant = loaded.plant
    assert plant is not None
    axes = tuple(
        UnmodelledAxis(
            thermal=None
            if each is None
            else SimulatedThermal(
                time_constant_s=each,
                rise_k_per_w=1.0,
                loss_at_rated_w=copper_w,
                friction_share=1.0,
                friction_per_k=-FALL_PER_K,
            )
        )
        for each in time_constant_s
    )
    friction = {"coulomb_nm": COULOMB_NM, "viscous_nm_s": VISCOUS_NM_S}
    each = plant.model_copy(
        update={
            "axes": tuple(axis.model_copy(update=friction) for axis in plant.axes[:3]),
            "unmodelled": UnmodelledEffects(axes=axes),
        }
    )
    return MotorTemperatures(arm(), each)


def motion(seconds: float, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q, v, a [rad, rad/s, rad/s2] of an alternately fast and slow motion, (samples, 3)."""
    random = np.random.default_rng(seed)
    t = STEP_S * np.arange(round(seconds / STEP_S))
    omega = 2.0 * np.pi * np.array([0.13, 0.31, 0.52])
    size = np.array([0.5, 0.25, 0.12])[:, np.newaxis] * random.uniform(0.6, 1.4, (3, 3))
    phase = random.uniform(0.0, 2.0 * np.pi, (3, 3))
    turn = 2.0 * np.pi / 47.0
    warped = t - 0.8 * np.sin(turn * t) / turn
    rate, change = 1.0 - 0.8 * np.cos(turn * t), 0.8 * turn * np.sin(turn * t)
    angle = omega[:, np.newaxis] * warped[:, np.newaxis, np.newaxis] + phase
    q = np.sum(size * np.sin(angle), axis=1)
    by_clock = np.sum(size * omega[:, np.newaxis] * np.cos(angle), axis=1)
    curve = -np.sum(size * omega[:, np.newaxis] ** 2 * np.sin(angle), axis=1)
    v = by_clock * rate[:, np.newaxis]
    a = curve * rate[:, np.newaxis] ** 2 + by_clock * change[:, np.newaxis]
    return q, v, a


def recording(
    seconds: float,
    time_constant_s: tuple[float | None, ...],
    *,
    seed: int = 0,
    noise_nm: float = 1.0,
    copper_w: float = 0.0,
    cutoff_hz: float = CUTOFF_HZ,
) -> SmoothedSignals:
    """Return a recording of the arm while its motors warm up."""
    q, v, a = motion(seconds, seed)
    model = RobotModel.from_description(arm())
    values = np.random.default_rng(7).uniform(0.5, 1.0, len(model.parameter_names))
    values[:30] *= 10.0  # links of a few kilograms
    values[model.parameter_groups["rotors"]] *= 1e-4
    values[model.parameter_groups["friction"]] = 0.0
    tau = torque(model, q, v, a, values)
    heat = motors(time_constant_s, copper_w)
    for i, speed in enumerate(v):
        friction = COULOMB_NM * np.sign(speed) + VISCOUS_NM_S * speed
        tau[i] += heat.friction_factor * friction
        heat.advance(STEP_S, tau[i], speed)
    tau += np.random.default_rng(seed).normal(0.0, noise_nm, tau.shape)
    return SmoothedSignals(
        joint_names=arm().joint_names,
        time_s=STEP_S * np.arange(len(q), dtype=np.float64),
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=low_pass(tau, STEP_S, cutoff_hz),
        segment=np.zeros(len(q), dtype=np.int64),
        sample_period_s=STEP_S,
        cutoff_hz=cutoff_hz,
    )


def settled_factor(
    signals: SmoothedSignals, time_constant_s: tuple[float | None, ...]
) -> FloatArray:
    """Return the factors by which decreasing friction changes the time constants, shape (n,)."""
    speed = np.abs(signals.velocity)
    power_w = np.mean((COULOMB_NM + VISCOUS_NM_S * speed) * speed, axis=0)
    heated = np.array([each is not None for each in time_constant_s])
    return 1.0 / (1.0 + heated * FALL_PER_K * power_w)
