"""`GearsSection`: identified stiffness and damping of the gears."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from config.robot.robot import RobotDescription
from rid_daq.report.mistake_entry import join_words
from rid_daq.report.sections.section import Numbers, Section, Texts, round_values

if TYPE_CHECKING:
    from identification.elasticity.gear_estimate import GearEstimate


class AxisGear(Section):
    """Gear of one joint.

    Attributes:
        joint: Name of the joint.
        unit: Unit of the stiffness.
        damping_unit: Unit of the damping.
        stiffness: Estimated stiffness; null if the data do not show it.
        stiffness_std: Standard deviation of the stiffness; null without a stiffness.
        damping: Estimated damping; null if the data do not show it.
        damping_std: Standard deviation of the damping; null without a damping.
        motor_inertia: Inertia of the motor at the gear's output [kg m^2 or kg]; null if the data do
            not show the stiffness.
        bend: Largest deflection during an excitation run, without its constant part [rad or m];
            null if the data do not show the stiffness.
        reason: Why the data do not show the stiffness; left out if they do.
        residual_percent: RMS of the torque that the model does not explain on the lines of the
            multisine, relative to the torque [%].
        frequency_hz: Lines of the multisine on which this joint was excited [Hz].
        measured: Measured torque divided by motor velocity at these lines (magnitude), without
            friction.
        predicted: Predicted torque divided by motor velocity at these lines (magnitude), without
            friction.
    """

    joint: str
    unit: str
    damping_unit: str
    stiffness: float | None
    stiffness_std: float | None
    damping: float | None
    damping_std: float | None
    motor_inertia: float | None
    bend: float | None
    reason: str | None = None
    residual_percent: float
    frequency_hz: Numbers
    measured: Numbers
    predicted: Numbers


class GearsSection(Section):
    """Identified gears of a robot.

    Attributes:
        runs: Ids of the runs.
        has_plate: True if the base wrench of a force plate was used.
        has_link_encoders: True if encoders on the link side were used.
        tool_residual_m: RMS distance of a tracker's points from the fitted path, without its
            constant part; left out without a tracker.
        axes: The gears, base to flange.
    """

    runs: Texts
    has_plate: bool
    has_link_encoders: bool = False
    tool_residual_m: float | None = None
    axes: tuple[AxisGear, ...]

    @classmethod
    def of(
        cls, robot: RobotDescription, found: GearEstimate, runs: tuple[str, ...]
    ) -> GearsSection:
        """Return the section of an estimate."""
        axes = []
        for j, joint in enumerate(robot.joints):
            response, reason = found.responses[j], found.reasons[j]
            gears, sigma = found.gears, float(found.relative_sigma[j])
            shown, damped = reason is None, found.shows_damping[j]
            k = float(gears.stiffness[j])
            axes.append(
                AxisGear(
                    joint=joint.name,
                    unit=f"{joint.torque_unit}/{joint.unit}",
                    damping_unit=f"{joint.torque_unit} s/{joint.unit}",
                    stiffness=k if shown else None,
                    stiffness_std=k * sigma if shown else None,
                    damping=float(gears.damping[j]) if damped else None,
                    damping_std=float(found.damping_sigma[j]) if damped else None,
                    motor_inertia=float(found.motor_inertia[j]) if shown else None,
                    bend=float(found.bend[j]) if shown else None,
                    reason=reason,
                    residual_percent=100.0 * float(found.residual_share[j]),
                    frequency_hz=round_values(response.frequency_hz.tolist()),
                    measured=round_values(np.abs(response.measured).tolist()),
                    predicted=round_values(np.abs(response.predicted).tolist()),
                )
            )
        return cls(
            runs=runs,
            has_plate=found.has_plate,
            has_link_encoders=found.has_link_encoders,
            tool_residual_m=found.tool_residual_m,
            axes=tuple(axes),
        )

    @property
    def instruments(self) -> str:
        """Names of the instruments whose signals were used, as text."""
        used = {
            "force plate": self.has_plate,
            "encoders on the link side": self.has_link_encoders,
            "tracker": self.tool_residual_m is not None,
        }
        return join_words(["motors", *(name for name, is_used in used.items() if is_used)])

    @property
    def keys(self) -> dict[str, dict[str, float]]:
        """Keys of the robot file for each joint whose stiffness the data show, by joint name."""
        keys: dict[str, dict[str, float]] = {}
        for axis in self.axes:
            if axis.stiffness is not None:
                of_joint = {"stiffness_nm_rad": float(f"{axis.stiffness:.4g}")}
                if axis.damping is not None:
                    of_joint["damping_nm_s"] = float(f"{axis.damping:.3g}")
                of_joint["motor_inertia_kg_m2"] = float(f"{axis.motor_inertia:.4g}")
                keys[axis.joint] = of_joint
        return keys
