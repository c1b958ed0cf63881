"""Recordings of an arm with presliding hysteresis, independent of the estimator's kernel."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.processing.smoothing import SmoothedSignals, low_pass
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from config.load import load_robot
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import RobotModel, torque
from identification.validation.robot_terms import with_friction

STEP_S = 0.005
CUTOFF_HZ = 10.0
CLASSICAL: tuple[FrictionTerm, ...] = ("coulomb", "viscous")
COULOMB_NM = 20.0


def arm() -> RobotDescription:
    """Return the bundled three-axis arm with Coulomb and viscous friction."""
    return with_friction(load_robot("ir361"), [CLASSICAL] * 3)


def iwan(path: FloatArray, distance: float, elements: int = 97) -> FloatArray:
    """Return the series that replaces sign(v): Iwan's model with many elements.

    Each element remembers its last slip position. The slip distances of the elements are spread
    evenly up to `distance`. The stretch of an element is the path minus its last slip position, so
    that errors do not accumulate along the path.
    """
    slips = distance * np.arange(1, elements + 1) / elements
    anchors = np.full(elements, path[0])
    kept = np.empty((len(path), elements))
    lowest, highest = path[:, np.newaxis] - slips, path[:, np.newaxis] + slips
    for i in range(len(path)):
        np.maximum(anchors, lowest[i], out=anchors)
        kept[i] = np.minimum(anchors, highest[i], out=anchors)
    return np.asarray(np.sum(path[:, np.newaxis] - kept, axis=1) / np.sum(slips))


def dahl(path: FloatArray, distance: float) -> FloatArray:
    """Return the series that replaces sign(v): Dahl's exponential model, without inner loops."""
    out, z = np.empty(len(path)), 0.0
    for i, moved in enumerate(np.diff(path, prepend=path[0])):
        end = np.sign(moved) if moved else z
        z = end + (z - end) * np.exp(-abs(moved) / distance)
        out[i] = z
    return out


def motion(seconds: float, seed: int) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q, v, a [rad, rad/s, rad/s2] of a motion with reversals and rest, (samples, 3)."""
    random = np.random.default_rng(seed)
    t = STEP_S * np.arange(round(seconds / STEP_S))
    omega = 2.0 * np.pi * np.array([0.07, 0.21, 0.4, 0.63])
    size = np.array([0.5, 0.25, 0.1, 0.06])[:, np.newaxis] * random.uniform(0.6, 1.4, (4, 3))
    phase = random.uniform(0.0, 2.0 * np.pi, (4, 3))
    # The motion's clock stops every four seconds, so that the arm rests without a jump.
    turn = 2.0 * np.pi * 0.25
    warped = t - np.sin(turn * t) / turn
    rate, change = 1.0 - np.cos(turn * t), turn * np.sin(turn * t)
    angle = omega[:, np.newaxis] * warped[:, np.newaxis, np.newaxis] + phase
    q = np.sum(size * np.sin(angle), axis=1)
    by_clock = np.sum(size * omega[:, np.newaxis] * np.cos(angle), axis=1)
    curve = -np.sum(size * omega[:, np.newaxis] ** 2 * np.sin(angle), axis=1)
    v = by_clock * rate[:, np.newaxis]
    a = curve * rate[:, np.newaxis] ** 2 + by_clock * change[:, np.newaxis]
    return q, v, a


def recording(
    directions: Mapping[int, FloatArray],
    way: tuple[FloatArray, FloatArray, FloatArray],
    *,
    noise_nm: float = 1.0,
    seed: int = 0,
) -> SmoothedSignals:
    """Return a recording of the arm with noise and low-pass filter.

    Args:
        directions: For some joints, by number from 0, series between -1 and 1 that replace sign(v)
            in the Coulomb friction.
    """
    tau = _torques(directions, way, noise_nm, seed)
    return signals_of(*way, low_pass(tau, STEP_S, CUTOFF_HZ))


def measured(
    directions: Mapping[int, FloatArray],
    way: tuple[FloatArray, FloatArray, FloatArray],
    *,
    rows: slice = slice(None),
) -> Recording:
    """Return a `Recording` with 1 N m of noise and without filter.

    `rows` selects rows of the motion; before the first one the joints may have moved.
    """
    tau, q = _torques(directions, way, 1.0, 0)[rows], way[0][rows]
    return Recording(
        joint_names=arm().joint_names,
        time_s=STEP_S * np.arange(len(q), dtype=np.float64),
        position=q,
        torque_nm=tau,
        valid=np.ones(len(q), dtype=np.bool_),
        phase=np.full(len(q), Phase.MAIN, dtype=np.uint8),
        sample_index=np.arange(len(q)),
        source="cell",
    )


def _torques(
    directions: Mapping[int, FloatArray],
    way: tuple[FloatArray, FloatArray, FloatArray],
    noise_nm: float,
    seed: int,
) -> FloatArray:
    q, v, a = way
    model = RobotModel.from_description(arm())
    values = np.random.default_rng(7).uniform(0.5, 1.0, len(model.parameter_names))
    values[model.parameter_groups["friction"]] = [COULOMB_NM, 8.0] * 3
    tau = torque(model, q, v, a, values)
    for joint, direction in directions.items():
        tau[:, joint] += COULOMB_NM * (direction - np.sign(v[:, joint]))
    return np.asarray(tau + np.random.default_rng(seed).normal(0.0, noise_nm, tau.shape))


def signals_of(q: FloatArray, v: FloatArray, a: FloatArray, tau: FloatArray) -> SmoothedSignals:
    """Return positions, velocities, accelerations and torques as a smoothed recording."""
    return SmoothedSignals(
        joint_names=arm().joint_names,
        time_s=STEP_S * np.arange(len(q), dtype=np.float64),
        position=q,
        velocity=v,
        acceleration=a,
        torque_nm=tau,
        segment=np.zeros(len(q), dtype=np.int64),
        sample_period_s=STEP_S,
        cutoff_hz=CUTOFF_HZ,
    )


def with_presliding(joints: Sequence[int], distance: float, share: float = 1.0) -> RobotDescription:
    """Return the arm with presliding on some joints; distance and fraction are start values."""
    robot = arm()
    own = tuple(
        joint.model_copy(
            update={
                "friction": (*joint.friction, *(("presliding",) if j in joints else ())),
                "presliding_distance": distance,
                "presliding_share": share,
            }
        )
        for j, joint in enumerate(robot.joints)
    )
    return robot.model_copy(update={"joints": own})
