"""`Supervisor`: decides, every cycle, whether the motion may go on.

It reads no clock and touches no device: it is told what was measured and answers with None or the
reason to stop. It is not a safety function: the cell's own emergency stop is required.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from acquisition.motion.limits import position_bounds
from acquisition.supervision.second_answers import SecondAnswers
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.supervision.stuck_encoders import StuckEncoders
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from drivers.interfaces.servo_axes import Answers, DriveEvent, EventKind

LATE_FRACTION = 0.5
PLAUSIBLE_FACTOR = 1.5
IMPLAUSIBLE_LIMIT = 2
LATE_ANSWERS_WINDOW = 100

_CODE_OF_EVENT = {
    EventKind.EMERGENCY: StopCode.EMERGENCY,
    EventKind.BOOT_UP: StopCode.DRIVE_RESTARTED,
    EventKind.HEARTBEAT_LOST: StopCode.HEARTBEAT_LOST,
    EventKind.NOT_OPERATIONAL: StopCode.NOT_ENABLED,
}


class Supervisor:
    """Watches timing, frames, drives, measured values and set-points.

    Limits on measured values are the robot's with the cell's margins; see `Supervision`. With a
    coupled wrist, position, its plausibility and following error are judged joint by joint, torque
    and standstill motor by motor, velocity on both sides; a joint counts only where all motors that
    move it have answered. Call `begin` once the drives are enabled, then in every cycle the checks,
    in any order, and `sent` for what was commanded.

    Attributes
    ----------
    position : list of float
        What the position loop is to use [rad or m]: the plausible positions; without one, the last
        of them moved on as the set-point has moved since, so that a lost answer corrects nothing
        and the correction before it stays.
    valid : list of int
        1 for the joints whose drive answered plausibly in this cycle, 0 for held values.
    """

    def __init__(self, cell: CellConfig, robot: RobotDescription) -> None:
        rules = cell.supervision
        limits = [joint.limits for joint in robot.joints]
        margin = 1.0 + rules.limit_margin_fraction
        n = len(limits)
        self._rules = rules
        self._period_s = cell.cycle_time_s
        self._names = robot.joint_names
        self._joints = range(n)
        self._step = [PLAUSIBLE_FACTOR * each.velocity * self._period_s for each in limits]
        self._velocity_step = [
            PLAUSIBLE_FACTOR * each.acceleration * self._period_s for each in limits
        ]
        self._low, self._high = position_bounds(cell, robot)
        self._velocity_limit = [each.velocity * margin for each in limits]
        self._torque_limit = [each.torque * margin for each in limits]
        self._encoders = StuckEncoders(rules, robot)
        self._coupling = WristCoupling.of_robot(robot)
        self._partners: list[tuple[int, ...]] = [()] * n  # whose answers a joint needs besides
        if self._coupling is not None:
            self._partners = [
                tuple(j for j in motors if j != i)
                for i, motors in enumerate(self._coupling.motors_of)
            ]
        self._late_answers: deque[bool] = deque(maxlen=LATE_ANSWERS_WINDOW)
        self._second_answers = SecondAnswers(cell, robot)
        self.begin([0.0] * n)

    def begin(self, position: Sequence[float]) -> None:
        """Start afresh with all joints at rest at `position` [rad or m]."""
        n = len(self._names)
        self.position = list(position)
        self.valid = [1] * n
        self._plausible = list(position)  # the last ones
        self._late = 0
        self._late_answers.clear()
        self._second_answers.begin()
        self._missed = [0] * n
        self._implausible = [0] * n
        self._encoders.begin()
        self._velocity = [0.0] * n  # between the last two of them
        self._since = [0] * n  # periods since the last plausible position
        self._command = [0.0] * n
        self._target = list(position)
        self._target_velocity = [0.0] * n

    def check_timing(self, lateness_s: float) -> StopReason | None:
        """Check how late a cycle begins [s] (rows 27): before anything is sent in it."""
        rules = self._rules
        late_by = lateness_s / self._period_s
        if not late_by <= rules.late_by_cycles_limit:
            return StopReason(
                StopCode.LATE_CYCLE,
                f"a cycle began {lateness_s * 1e3:.1f} ms late, {late_by:.1f} periods; at most"
                f" {rules.late_by_cycles_limit:g} are allowed. Check the computer's load",
                value=late_by,
                limit=rules.late_by_cycles_limit,
            )
        self._late = self._late + 1 if late_by > LATE_FRACTION else 0
        if self._late >= rules.late_cycles_limit:
            return StopReason(
                StopCode.LATE_CYCLE,
                f"{self._late} cycles in a row began more than {LATE_FRACTION:g} period late."
                " Check the computer's load",
                value=float(self._late),
                limit=float(rules.late_cycles_limit),
            )
        return None

    def check_events(self, events: Sequence[DriveEvent]) -> StopReason | None:
        """Check what the drives made known by themselves (rows 8, 9, 11)."""
        for event in events:
            if event.kind.is_fault:
                return StopReason(
                    _CODE_OF_EVENT.get(event.kind, StopCode.BUS),
                    event.text,
                    joint=event.joint or None,
                    value=float(event.code),
                )
        return None

    def check_late_frames(self, count: int) -> StopReason | None:
        """Check how many answers came after their cycle (row 5): new ones in this cycle.

        Answers of several drives that are late together count once.
        """
        window = self._late_answers
        window.append(count > 0)
        total = sum(window) if count else 0
        limit = self._rules.late_answers_limit
        if total >= limit:
            return StopReason(
                StopCode.LATE_FRAMES,
                f"answers of drives came too late {total} times within {len(window)} cycles; fewer"
                f" than {limit} are allowed. Check the bus load and the drives' settings",
                value=float(total),
                limit=float(limit),
            )
        return None

    def check_second_answers(self, counts: Sequence[int]) -> StopReason | None:
        """Check in how many cycles each drive's identifier has answered more than once, so far."""
        return self._second_answers.check(counts)

    def check_measured(
        self,
        answers: Answers,
        target_position: Sequence[float],
        target_velocity: Sequence[float],
        periods: int = 1,
    ) -> StopReason | None:
        """Check what the drives answered in this cycle (rows 1, 2, 6, 13, 14, 15).

        Parameters
        ----------
        answers : Answers
            Of this cycle.
        target_position, target_velocity : sequence of float
            The set-point of this cycle [rad or m, and per second].
        periods : int
            Cycle times since the last check, more than 1 after skipped cycles.
        """
        rules = self._rules
        valid = self.valid
        received, enabled = answers.received.tolist(), answers.enabled.tolist()
        position, torque_nm = answers.position.tolist(), answers.torque_nm.tolist()
        for i in self._joints:
            self._since[i] += periods
            valid[i] = 0
            self.position[i] += target_position[i] - self._target[i]
            if not received[i]:
                self._missed[i] += 1
                if self._missed[i] >= rules.missed_frames_limit:
                    return self._second_answers.explain(i) or self._missed_frames(i)
                continue
            self._missed[i] = 0
            if not enabled[i]:
                return self._not_enabled(i, answers)
            if not all(received[j] for j in self._partners[i]):
                continue
            actual, since = position[i], self._since[i]
            step = actual - self._plausible[i]
            if not -self._step[i] * since <= step <= self._step[i] * since:
                self._implausible[i] += 1
                if self._implausible[i] >= IMPLAUSIBLE_LIMIT:
                    return self._jumped(i, step)
                continue
            self._implausible[i] = 0
            valid[i] = 1
            self._since[i] = 0
            self.position[i] = self._plausible[i] = actual
            velocity = self._velocity[i] = step / (since * self._period_s)
            reason = self._beyond_limits(i, actual, velocity, torque_nm[i])
            if reason is not None:
                return reason
            error = target_position[i] - actual
            allowed = rules.following_error_min_rad + rules.following_error_per_velocity_s * abs(
                target_velocity[i]
            )
            if not -allowed <= error <= allowed:
                return self._following_error(i, error, allowed)
            if self._coupling is None:
                reason = self._encoders.check(i, self._command[i], velocity, torque_nm[i], periods)
                if reason is not None:
                    return reason
        if self._coupling is None:
            return None
        return self._check_motors(self._coupling, torque_nm, periods)

    def _check_motors(
        self, coupling: WristCoupling, torque_nm: Sequence[float], periods: int
    ) -> StopReason | None:
        """Check the motors' speeds and that they turn at all, where every joint's is known."""
        if not all(self.valid):
            return None
        velocities = coupling.to_motors(self._velocity).tolist()
        commands = coupling.to_motors(self._command).tolist()
        for i, (velocity, command) in enumerate(zip(velocities, commands, strict=True)):
            limit = self._velocity_limit[i]
            if not -limit <= velocity <= limit:
                what = "motor's velocity, over its gear ratio,"
                return self._limit(i, StopCode.VELOCITY_LIMIT, what, velocity, limit, "rad/s")
            reason = self._encoders.check(i, command, velocity, torque_nm[i], periods)
            if reason is not None:
                return reason
        return None

    def check_target(
        self,
        target_position: Sequence[float],
        target_velocity: Sequence[float],
        periods: int = 1,
    ) -> StopReason | None:
        """Check the set-point of a cycle (row 17), before anything is measured against it.

        Parameters as of `check_set_point`.
        """
        for i in self._joints:
            target, velocity = target_position[i], target_velocity[i]
            step = self._step[i] * periods
            if not -step <= target - self._target[i] <= step:
                return self._set_point(i, "position jumps by", target - self._target[i], step)
            limit = self._velocity_limit[i]
            if not -limit <= velocity <= limit:
                return self._set_point(i, "velocity is", velocity, limit)
            step = self._velocity_step[i] * periods
            if not -step <= velocity - self._target_velocity[i] <= step:
                change = velocity - self._target_velocity[i]
                return self._set_point(i, "velocity jumps by", change, step)
        return None

    def check_set_point(
        self,
        target_position: Sequence[float],
        target_velocity: Sequence[float],
        command: Sequence[float],
        periods: int = 1,
    ) -> StopReason | None:
        """Check what is about to be sent (row 17); where all is well it is taken as sent.

        Parameters
        ----------
        target_position, target_velocity, command : sequence of float, length joints
            Set-point, its feedforward and the velocity to send [rad or m, and per second].
        periods : int
            Cycle times since the last check.
        """
        reason = self.check_target(target_position, target_velocity, periods)
        if reason is not None:
            return reason
        for i in self._joints:
            limit = self._velocity_limit[i]
            if not -limit <= command[i] <= limit:
                return self._set_point(i, "velocity command is", command[i], limit)
        if self._coupling is not None:
            for i, velocity in enumerate(self._coupling.to_motors(command).tolist()):
                limit = self._velocity_limit[i]
                if not -limit <= velocity <= limit:
                    return self._set_point(i, "velocity command for its motor is", velocity, limit)
        self._target = list(target_position)
        self._target_velocity = list(target_velocity)
        self._command = list(command)
        return None

    def _missed_frames(self, i: int) -> StopReason:
        count = self._missed[i]
        return StopReason(
            StopCode.MISSED_FRAMES,
            f"joint {self._names[i]}: its drive did not answer in {count} cycles in a row."
            " Check its cable, its supply and the bus termination",
            joint=self._names[i],
            value=float(count),
            limit=float(self._rules.missed_frames_limit),
        )

    def _not_enabled(self, i: int, answers: Answers) -> StopReason:
        faulty, word = bool(answers.fault[i]), int(answers.statusword[i])
        return StopReason(
            StopCode.DRIVE_FAULT if faulty else StopCode.NOT_ENABLED,
            f"joint {self._names[i]}: its drive "
            + ("reports a fault" if faulty else "is no longer enabled")
            + f" (statusword {word:04X}h). Read the drive's error, then start again from preflight",
            joint=self._names[i],
            value=float(word),
        )

    def _jumped(self, i: int, step: float) -> StopReason:
        limit = self._step[i] * self._since[i]
        return StopReason(
            StopCode.IMPLAUSIBLE_POSITION,
            f"joint {self._names[i]}: its position jumps by {step:.4g} rad, at most {limit:.4g} are"
            " possible. Check the encoder and its cable",
            joint=self._names[i],
            value=step,
            limit=limit,
        )

    def _beyond_limits(
        self, i: int, position: float, velocity: float, torque_nm: float
    ) -> StopReason | None:
        if not self._low[i] <= position <= self._high[i]:
            limit = self._low[i] if position < self._low[i] else self._high[i]
            return self._limit(i, StopCode.POSITION_LIMIT, "position", position, limit, "rad")
        limit = self._velocity_limit[i]
        if not -limit <= velocity <= limit:
            return self._limit(i, StopCode.VELOCITY_LIMIT, "velocity", velocity, limit, "rad/s")
        limit = self._torque_limit[i]
        if not -limit <= torque_nm <= limit:
            return self._limit(i, StopCode.TORQUE_LIMIT, "torque", torque_nm, limit, "N m")
        return None

    def _limit(
        self, i: int, code: StopCode, what: str, value: float, limit: float, unit: str
    ) -> StopReason:
        return StopReason(
            code,
            f"joint {self._names[i]}: its {what} is {value:.4g} {unit}, beyond {limit:.4g} {unit}."
            " Check the motion and the limits in the robot file",
            joint=self._names[i],
            value=value,
            limit=limit,
        )

    def _following_error(self, i: int, error: float, allowed: float) -> StopReason:
        return StopReason(
            StopCode.FOLLOWING_ERROR,
            f"joint {self._names[i]}: it is {abs(error):.4g} rad off its set-point, {allowed:.4g}"
            " are allowed at this speed. Check direction, gear ratio, brake and the velocity loop",
            joint=self._names[i],
            value=error,
            limit=allowed,
        )

    def _set_point(self, i: int, what: str, value: float, limit: float) -> StopReason:
        return StopReason(
            StopCode.SET_POINT,
            f"joint {self._names[i]}: the set-point's {what} {value:.4g}, at most {limit:.4g} is"
            " allowed; it was not sent. Check the motion",
            joint=self._names[i],
            value=value,
            limit=limit,
        )
