"""`TorqueMeaning`: origin of recorded torques or currents; a person states it in an import map.

Many quantities have the unit N m: a motor's torque, that of a joint sensor, the result of a
controller's model. A file rarely says which one it contains, and a wrong assumption gives a wrong
model. Therefore a map can state the meaning. A proposed map states it if the program that wrote the
file defines it. `identify` tests the statement with the data
(`identification.wiring.torque_origin`).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal

TorqueMeaning = Literal[
    "motor_current", "motor_torque", "joint_torque", "model_based", "gravity_compensated"
]
MOTOR_CURRENT: Final[TorqueMeaning] = "motor_current"
MOTOR_TORQUE: Final[TorqueMeaning] = "motor_torque"
JOINT_TORQUE: Final[TorqueMeaning] = "joint_torque"
MODEL_BASED: Final[TorqueMeaning] = "model_based"
GRAVITY_COMPENSATED: Final[TorqueMeaning] = "gravity_compensated"

MEANINGS: Final[Mapping[TorqueMeaning, str]] = {
    MOTOR_CURRENT: "measured motor currents",
    MOTOR_TORQUE: "torques of the motors, with the friction of motor and gear",
    JOINT_TORQUE: "torques of sensors behind the gear, without the friction of motor and gear",
    MODEL_BASED: "computed by the controller's own model, not measured",
    GRAVITY_COMPENSATED: "measured, but gravity was subtracted",
}
"""Explanation of each meaning."""

_FINDINGS: Final[Mapping[TorqueMeaning | None, str]] = {
    MODEL_BASED: (
        "the torques are computed by the controller's own model (`torques: model_based`): a fit"
        " gives this model and not the robot. Record motor currents or measured torques"
    ),
    GRAVITY_COMPENSATED: (
        "the torques contain no gravity (`torques: gravity_compensated`): masses and centres of"
        " gravity cannot be identified. Record motor currents, or torques with gravity"
    ),
}


def torque_findings(meaning: TorqueMeaning | None) -> tuple[str, ...]:
    """Return what the meaning of the torques prevents, one sentence each; empty if nothing."""
    return tuple(filter(None, (_FINDINGS.get(meaning, ""),)))


def refuse_other_quantity(
    stated: TorqueMeaning | None, has_current: bool, has_torque: bool, side: str
) -> None:
    """Refuse a meaning that contradicts the kind of the columns or their side.

    Raises:
        ValueError: The map contradicts itself.
    """
    if stated == MOTOR_CURRENT and not has_current:
        raise ValueError("torques: motor_current, but no joint has a current column")
    if stated == MOTOR_TORQUE and not has_torque:
        raise ValueError("torques: motor_torque, but no joint has a torque column")
    if stated == JOINT_TORQUE and (has_current or side == "motor"):
        raise ValueError(
            "torques: joint_torque, but the values are currents, or those of the motor side:"
            " use motor_current or motor_torque"
        )
