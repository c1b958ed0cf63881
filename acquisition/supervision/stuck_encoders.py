"""`StuckEncoders`: distinguishes a stuck encoder from a joint in stiction."""

from __future__ import annotations

from acquisition.supervision.stop_reason import StopCode, StopReason
from config.cell.cell import Supervision
from config.robot.robot import RobotDescription

STUCK_FRACTION = 0.02
NOT_STRAINED = (
    ". Its torque does not rise: if this axis has never moved with this cell file, its"
    " velocity_unit or velocity_units is wrong"
)


class StuckEncoders:
    """Detection of encoders that do not move although their motor must move (faults: row 14).

    A joint may stay in stiction at a slow command. With a stuck encoder the torque keeps rising,
    because the velocity loop increases it. The torque that braked a fast joint is measured some
    cycles later, because of the drive's filter; during these cycles the torque is ignored. The
    limits and numbers of cycles are those of `Supervision`.

    Args:
        rules: Supervision of the cell.
        robot: Joint names and torque limits.
    """

    def __init__(self, rules: Supervision, robot: RobotDescription) -> None:
        self._rules = rules
        self._names = robot.joint_names
        self._units = [joint.unit for joint in robot.joints]
        self._strain = [
            joint.limits.torque * rules.stuck_encoder_torque_fraction for joint in robot.joints
        ]
        self.begin()

    def begin(self) -> None:
        """Restart."""
        self._periods = [0] * len(self._names)  # number of cycle times at standstill
        self._torque_from = [0.0] * len(
            self._names
        )  # torque at the beginning of standstill, or later while braking
        # number of cycles for which the torque can still decrease after braking
        self._braking = [0] * len(self._names)

    def check(
        self, i: int, command: float, velocity: float, torque_nm: float, periods: int
    ) -> StopReason | None:
        """Return the reason to stop after a cycle of one motor; None if the motion may continue.

        Args:
            i: Index of the motor.
            command, velocity: Command and encoder velocity [rad/s or m/s].
            torque_nm: Torque of the motor, link side [N m or N].
            periods: Cycle times since the last check.
        """
        rules = self._rules
        command = abs(command)
        braking = self._braking[i] > 0
        self._braking[i] -= min(periods, self._braking[i])
        if command == 0.0 or abs(velocity) >= STUCK_FRACTION * command:
            if abs(velocity) > rules.stuck_encoder_velocity_rad_s:
                self._braking[i] = rules.stuck_encoder_cycles
            self._periods[i] = 0
            self._torque_from[i] = torque_nm
            return None
        if braking and command <= rules.stuck_encoder_velocity_rad_s:
            self._torque_from[i] = torque_nm
        strains = abs(torque_nm - self._torque_from[i]) > self._strain[i]
        if command <= rules.stuck_encoder_velocity_rad_s and not strains:
            self._periods[i] = 0
            return None
        self._periods[i] += periods
        if self._periods[i] < rules.stuck_encoder_cycles:
            return None
        return StopReason(
            StopCode.STUCK_ENCODER,
            f"joint {self._names[i]}: its position has hardly changed for {self._periods[i]} cycles"
            f" while {command:.4g} {self._units[i]}/s are commanded or its torque rises. Check"
            " encoder, coupling and brake" + ("" if strains else NOT_STRAINED),
            joint=self._names[i],
            value=float(self._periods[i]),
            limit=float(rules.stuck_encoder_cycles),
        )
