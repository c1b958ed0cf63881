"""`judge_torques`: likely meaning of recorded torques, from the data of a run.

Three properties of the torques distinguish the meanings: they follow gravity or not, they contain
friction or not, and they contain noise or not. A fit of the robot's regressor shows all three.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.maps.torque_meaning import (
    GRAVITY_COMPENSATED,
    JOINT_TORQUE,
    MODEL_BASED,
    MOTOR_CURRENT,
    MOTOR_TORQUE,
    TorqueMeaning,
)
from acquisition.recording.recording import Recording
from config.arrays import BoolArray, FloatArray, IntArray
from config.errors import DataQualityError, RidDaqError
from config.robot.robot import RobotDescription
from dynamics.model.robot_model import regressor
from identification.equations.stretches import smoothed_stretches
from identification.wiring.mistakes import MistakeKind
from identification.wiring.search import find_impossibilities
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import BRAKES, plain_model, rows_used
from identification.wiring.weight import ArmWeight

BAND_HZ: Final = 10.0
LARGEST_RESIDUAL: Final = 0.5
"""Residual relative to the torque, from which on the fit proves nothing."""
COMPUTED_SHARE: Final = 5e-3
"""Relative residual below which torques of a moving robot are not measured."""
VISIBLE_TIMES: Final = 1.5
"""Ratio of residuals, without and with gravity, from which torques contain gravity."""
FRICTION_SHARE: Final = 0.03
"""Smallest friction, relative to the torque, of a motor with a gear."""


@dataclass(frozen=True)
class TorqueJudgement:
    """Properties of recorded torques.

    Attributes:
        residual: Residual of the fit, relative to the torque; the median of the joints.
        friction: RMS of Coulomb and viscous friction, relative to the torque; the median.
        gravity: Residual of a robot without gravity relative to that with gravity, for the joint
            with the largest ratio; None if the motion does not show gravity.
        currents: True if the recorded quantity is a current.
    """

    residual: float
    friction: float
    gravity: float | None
    currents: bool

    @property
    def meanings(self) -> tuple[TorqueMeaning, ...]:
        """Likely meanings; empty if the robot's model does not explain the torques."""
        if self.residual > LARGEST_RESIDUAL:
            return ()
        if self.gravity is not None and self.gravity < VISIBLE_TIMES:
            return (GRAVITY_COMPENSATED,)
        if self.residual < COMPUTED_SHARE:
            return (MODEL_BASED,)
        if self.has_friction:
            return (MOTOR_CURRENT,) if self.currents else (MOTOR_TORQUE,)
        return (MODEL_BASED,) if self.currents else (JOINT_TORQUE, MODEL_BASED)

    @property
    def has_friction(self) -> bool:
        """True if the torques contain as much friction as those of a motor with a gear."""
        return self.friction >= FRICTION_SHARE

    @property
    def friction_words(self) -> str:
        """Size of the friction, as text."""
        share = f"{100.0 * self.friction:.2g} %"
        return f"the friction in them is {share} of the torque (median of the joints)"

    def contradicts_friction_of(self, stated: TorqueMeaning) -> bool:
        """Return True if measured torques contain friction, or none, contrary to a statement.

        Args:
            stated: Meaning of measured torques with gravity.
        """
        measured = COMPUTED_SHARE <= self.residual <= LARGEST_RESIDUAL
        return measured and self.has_friction == (stated == JOINT_TORQUE)

    @property
    def reason(self) -> str:
        """Reason for the likely meanings, as text."""
        residual = f"the residual of a fit is {100.0 * self.residual:.2g} % of the torque"
        if not self.meanings:
            return f"{residual}, so they do not show their meaning"
        if self.meanings == (GRAVITY_COMPENSATED,):
            return (
                f"without gravity, the residual of a fit is less than {VISIBLE_TIMES:g} times as"
                " large as with gravity"
            )
        if self.residual < COMPUTED_SHARE:
            return f"{residual}, so they contain no noise"
        return self.friction_words


def judge_torques(
    recording: Recording, robot: RobotDescription, *, currents: bool
) -> TorqueJudgement | None:
    """Return the properties of the torques of a recording; None if it does not show them.

    Args:
        recording: The recording.
        robot: The robot as its file describes it.
        currents: True if the file contains currents.
    """
    if not np.ptp(recording.torque_nm, axis=0).any():
        return None
    try:
        signals = _wired_signals(recording, robot)
    except RidDaqError:
        return None
    joints = np.flatnonzero(rows_used(signals).sum(axis=0) >= _fewest_rows(signals))
    if not len(joints):
        return None
    residual, friction = _fit(signals, joints)
    still = robot.model_copy(update={"gravity_m_s2": (0.0, 0.0, 0.0)})
    without, _ = _fit(replace(signals, robot=still), joints)
    drawn = _gravity_columns(signals, still)[joints]
    ratio = without[drawn] / np.maximum(residual[drawn], 1e-12)
    return TorqueJudgement(
        residual=float(np.median(residual)),
        friction=float(np.median(friction)),
        gravity=float(ratio.max()) if drawn.any() else None,
        currents=currents,
    )


def _wired_signals(recording: Recording, robot: RobotDescription) -> WiredSignals:
    [parts] = smoothed_stretches([recording], BAND_HZ)
    if not parts:
        raise DataQualityError(
            "no part of the recording is long enough to judge its torques: record longer",
            code="RID-RECORDING-SHORT",
        )
    return WiredSignals.of(robot, parts)


def weight_of_torques(recording: Recording, robot: RobotDescription) -> ArmWeight | None:
    """Return the arm's weight that recorded values give if they are torques.

    None if the recording does not show it.

    Args:
        recording: The recording.
        robot: The robot as its file describes it.
    """
    try:
        return find_impossibilities(_wired_signals(recording, robot))[1]
    except RidDaqError:
        return None


def torque_contradiction(
    stated: TorqueMeaning | None,
    recording: Recording,
    robot: RobotDescription,
    mistakes: Sequence[MistakeKind],
) -> str:
    """Return why the data contradict the meaning of the torques in an import map, as a sentence.

    Args:
        stated: The meaning; None if the map states none, so that those of the motors are assumed.
        recording: The recording.
        robot: The robot as its file describes it.
        mistakes: Mistakes that the recording shows. Friction is only judged if there are none.

    Returns:
        The sentence; empty if the data do not contradict the meaning.
    """
    if stated == GRAVITY_COMPENSATED:
        removed = MistakeKind.GRAVITY_REMOVED in mistakes
        why = "" if removed else "the torques fit a robot with gravity"
    elif mistakes or stated == MODEL_BASED:
        why = ""
    else:
        judged = judge_torques(recording, robot, currents=stated == MOTOR_CURRENT)
        contradicts = judged is not None and judged.contradicts_friction_of(stated or MOTOR_TORQUE)
        why = judged.friction_words if judged is not None and contradicts else ""
    if not why:
        return ""
    if stated is None:
        return (
            "its import map does not state `torques`, so torques of the motors are assumed, but"
            f" {why}: state `torques` in the map, and import the file again."
        )
    return (
        f"its import map states `torques: {stated}`, but {why}: correct `torques` in the map, and"
        " import the file again."
    )


def _fewest_rows(signals: WiredSignals) -> int:
    """Return the smallest number of rows for which a residual is evidence."""
    return 2 * len(plain_model(signals).parameter_names)


def _gravity_columns(signals: WiredSignals, still: RobotDescription) -> BoolArray:
    """Return a mask of the joints that gravity can load, shape (n,)."""
    with_gravity = regressor(plain_model(signals), *signals.joints())
    without = regressor(plain_model(replace(signals, robot=still)), *signals.joints())
    return np.asarray(np.abs(with_gravity - without).max(axis=(0, 2)) > 1e-6)


def _fit(signals: WiredSignals, joints: IntArray) -> tuple[FloatArray, FloatArray]:
    """Fit the robot, and return residual and friction relative to the torque of each joint."""
    model, use = plain_model(signals), rows_used(signals)
    phi = regressor(model, *signals.joints())
    sizes = np.array([_rms(signals.torque_nm[use[:, j], j]) for j in joints])
    sizes = np.maximum(sizes, 1e-12)
    stacked = np.vstack([phi[use[:, j], j] / size for j, size in zip(joints, sizes, strict=True)])
    torque = np.concatenate(
        [signals.torque_nm[use[:, j], j] / size for j, size in zip(joints, sizes, strict=True)]
    )
    values = np.linalg.lstsq(stacked, torque, rcond=1e-9)[0]
    brakes = np.array([name.startswith(BRAKES) for name in model.parameter_names])
    ends = np.cumsum([int(use[:, j].sum()) for j in joints])[:-1]
    left = np.split(torque - stacked @ values, ends)
    friction = np.split(stacked[:, brakes] @ values[brakes], ends)
    return np.array([_rms(each) for each in left]), np.array([_rms(each) for each in friction])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(values))))
