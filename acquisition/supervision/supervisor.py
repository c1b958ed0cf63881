"""`Supervisor`: decides in every cycle whether the motion may continue.

It reads no clock and accesses no device: its input is a `Cycle`, its output None or the reason to
stop. It is not a safety function: the cell's own emergency stop is required.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from acquisition.motion.limits import position_bounds
from acquisition.supervision.cycle import Cycle
from acquisition.supervision.held_positions import PLAUSIBLE_FACTOR, HeldPositions
from acquisition.supervision.second_answers import SecondAnswers
from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.supervision.stuck_encoders import StuckEncoders
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from config.robot.wrist_coupling import WristCoupling
from drivers.interfaces.servo_axes import Answers, DriveEvent, EventKind

IMPLAUSIBLE_LIMIT = 2
LATE_ANSWERS_WINDOW = 100

_CODE_OF_EVENT = {
    EventKind.EMERGENCY: StopCode.EMERGENCY,
    EventKind.BOOT_UP: StopCode.DRIVE_RESTARTED,
    EventKind.HEARTBEAT_LOST: StopCode.HEARTBEAT_LOST,
    EventKind.NOT_OPERATIONAL: StopCode.NOT_ENABLED,
}


class Supervisor:
    """Supervision of frames, drives, measured values and set-points.

    Limits of measured values are those of the robot with the margins of the cell; see
    `Supervision`. With a coupled wrist, position, plausibility and following error are checked per
    joint, torque and standstill per motor, and velocity for both. A joint's position may be unknown
    for as many cycles as a drive may be silent. Call `begin` once the drives are enabled, then
    `judge` in every cycle.

    Args:
        cell, robot: Limits, margins, coupling of the wrist.
        positions: Check of positions; it must process the answers of a cycle before `judge`.
    """

    def __init__(self, cell: CellConfig, robot: RobotDescription, positions: HeldPositions) -> None:
        rules = cell.supervision
        limits = [joint.limits for joint in robot.joints]
        margin = 1.0 + rules.limit_margin_fraction
        self._rules = rules
        self._positions = positions
        self._names = robot.joint_names
        self._units = tuple(joint.unit for joint in robot.joints)
        self._torque_units = tuple(joint.torque_unit for joint in robot.joints)
        self._joints = range(len(limits))
        period_s = cell.cycle_time_s
        self._step = [PLAUSIBLE_FACTOR * each.velocity * period_s for each in limits]
        self._velocity_step = [PLAUSIBLE_FACTOR * each.acceleration * period_s for each in limits]
        self._low, self._high = position_bounds(cell, robot)
        self._velocity_limit = [each.velocity * margin for each in limits]
        self._torque_limit = [each.torque * margin for each in limits]
        self._encoders = StuckEncoders(rules, robot)
        self._coupling = WristCoupling.of_robot(robot)
        self._late_answers: deque[bool] = deque(maxlen=LATE_ANSWERS_WINDOW)
        self._second_answers = SecondAnswers(cell, robot)
        self.begin(Answers.initial(len(limits)))

    def begin(self, answers: Answers) -> None:
        """Restart with all joints at rest at the positions in `answers`."""
        position = answers.position.tolist()
        self._positions.begin(position)
        self._late_frames = answers.late_frames
        self._late_answers.clear()
        self._second_answers.begin(answers.second_answers.tolist())
        self._encoders.begin()
        self._wanted = [0.0] * len(position)  # commanded speeds of the previous cycle
        self._target = position
        self._target_velocity = [0.0] * len(position)
        self._ahead = [0.0] * len(position)

    def judge(self, cycle: Cycle) -> StopReason | None:
        """Return the reason to stop; None if the motion may continue.

        The first finding counts. The checks have this order (rows of docs/faults.md):
        1. reports of the drives (8, 9, 11),
        2. late answers (5) and second answers (49),
        3. the set-point (17),
        4. measured values, joint by joint (1, 2, 6, 13, 14, 15),
        5. the command (17).

        Args:
            cycle: The complete cycle with its command, before anything is sent.
        """
        reason = (
            self._check_events(cycle.events)
            or self._check_late_answers(cycle.late_frames)
            or self._second_answers.check(cycle.second_answers)
            or self._check_target(cycle)
            or self._check_measured(cycle)
            or self._check_command(cycle.command)
        )
        if reason is None:
            self._target, self._target_velocity = cycle.target.position, cycle.target.velocity
            self._ahead = cycle.target.feedforward
            self._wanted = _wanted_speeds(cycle)
        return reason

    def _check_events(self, events: Sequence[DriveEvent]) -> StopReason | None:
        for event in events:
            if event.kind.is_fault:
                return StopReason(
                    _CODE_OF_EVENT.get(event.kind, StopCode.BUS),
                    event.text,
                    joint=event.joint or None,
                    value=float(event.code),
                )
        return None

    def _check_late_answers(self, count: int) -> StopReason | None:
        """Check the number of recent cycles with late answers; `count` is the total so far."""
        window = self._late_answers
        late, self._late_frames = count > self._late_frames, count
        window.append(late)
        total = sum(window) if late else 0
        limit = self._rules.late_answers_limit
        if total < limit:
            return None
        return StopReason(
            StopCode.LATE_FRAMES,
            f"answers of drives came too late {total} times within {len(window)} cycles; fewer"
            f" than {limit} are allowed. Check the bus load and the drives' settings",
            value=float(total),
            limit=float(limit),
        )

    def _check_target(self, cycle: Cycle) -> StopReason | None:
        """Check the set-point before measured values are compared with it."""
        target_position, target_velocity = cycle.target.position, cycle.target.velocity
        feedforward = cycle.target.feedforward
        for i in self._joints:
            target, velocity, ahead = target_position[i], target_velocity[i], feedforward[i]
            step = self._step[i] * cycle.periods
            if not -step <= target - self._target[i] <= step:
                return self._set_point(i, "position jumps by", target - self._target[i], step)
            limit = self._velocity_limit[i]
            if not -limit <= velocity <= limit:
                return self._set_point(i, "velocity is", velocity, limit)
            step = self._velocity_step[i] * cycle.periods
            if not -step <= velocity - self._target_velocity[i] <= step:
                change = velocity - self._target_velocity[i]
                return self._set_point(i, "velocity jumps by", change, step)
            if not -limit <= ahead <= limit:
                return self._set_point(i, "feedforward is", ahead, limit)
            if not -step <= ahead - self._ahead[i] <= step:
                change = ahead - self._ahead[i]
                return self._set_point(i, "feedforward jumps by", change, step)
        return None

    def _check_measured(self, cycle: Cycle) -> StopReason | None:
        rules, positions = self._rules, self._positions
        for i in self._joints:
            if not cycle.received[i]:
                if positions.missed[i] >= rules.missed_frames_limit:
                    return self._second_answers.explain(i) or self._missed_frames(i)
                continue
            if not cycle.enabled[i]:
                return self._not_enabled(i, cycle)
            if not cycle.valid[i]:
                if positions.implausible[i] >= IMPLAUSIBLE_LIMIT:
                    return self._check_jump(i)
                continue
            actual, velocity = cycle.position[i], positions.velocity[i]
            torque_nm = cycle.torque_nm[i]
            reason = self._beyond_limits(i, actual, velocity, torque_nm)
            if reason is not None:
                return reason
            error = cycle.target.position[i] - actual
            allowed = rules.following_error_min_rad + rules.following_error_per_velocity_s * abs(
                cycle.target.velocity[i]
            )
            if not -allowed <= error <= allowed:
                return self._following_error(i, error, allowed)
            if self._coupling is None:
                reason = self._encoders.check(
                    i, self._wanted[i], velocity, torque_nm, cycle.periods
                )
                if reason is not None:
                    return reason
        if self._coupling is None:
            return None
        return self._check_motors(self._coupling, cycle)

    def _check_motors(self, coupling: WristCoupling, cycle: Cycle) -> StopReason | None:
        """Check the motors' speeds and standstill if every joint's speed is known."""
        if not all(cycle.valid):
            for i in self._joints:
                if self._positions.unknown[i] >= self._rules.missed_frames_limit:
                    return self._check_known(i, coupling.motors_of[i])
            return None
        velocities = coupling.to_motors(self._positions.velocity).tolist()
        commands = coupling.to_motors(self._wanted).tolist()
        for i, (velocity, command) in enumerate(zip(velocities, commands, strict=True)):
            limit = self._velocity_limit[i]
            if not -limit <= velocity <= limit:
                what = "motor's velocity, divided by its gear ratio,"
                return self._limit(i, StopCode.VELOCITY_LIMIT, what, velocity, limit, "rad/s")
            reason = self._encoders.check(i, command, velocity, cycle.torque_nm[i], cycle.periods)
            if reason is not None:
                return reason
        return None

    def _check_command(self, command: Sequence[float]) -> StopReason | None:
        for i in self._joints:
            limit = self._velocity_limit[i]
            if not -limit <= command[i] <= limit:
                return self._set_point(i, "velocity command is", command[i], limit)
        if self._coupling is not None:
            for i, velocity in enumerate(self._coupling.to_motors(command).tolist()):
                limit = self._velocity_limit[i]
                if not -limit <= velocity <= limit:
                    return self._set_point(i, "velocity command for its motor is", velocity, limit)
        return None

    def _missed_frames(self, i: int) -> StopReason:
        count = self._positions.missed[i]
        if len(self._names) > 1 and min(self._positions.missed) == count:
            return StopReason(
                StopCode.MISSED_FRAMES,
                f"no drive answered in {count} cycles in a row. Check this computer's adapter, its"
                " cable, the bus termination and the drives' common supply",
                value=float(count),
                limit=float(self._rules.missed_frames_limit),
            )
        return StopReason(
            StopCode.MISSED_FRAMES,
            f"joint {self._names[i]}: its drive did not answer in {count} cycles in a row."
            " Check its cable, its supply and the bus termination",
            joint=self._names[i],
            value=float(count),
            limit=float(self._rules.missed_frames_limit),
        )

    def _check_known(self, i: int, motors: Sequence[int]) -> StopReason:
        for motor in motors:
            if reason := self._second_answers.explain(motor):
                return reason
        count = self._positions.unknown[i]
        drives = ", ".join(self._names[j] for j in motors)
        return StopReason(
            StopCode.MISSED_FRAMES,
            f"joint {self._names[i]}: its position is unknown, since in {count} cycles one of the"
            f" drives that move it ({drives}) did not answer. Check their cables, their supply and"
            " the bus termination",
            joint=self._names[i],
            value=float(count),
            limit=float(self._rules.missed_frames_limit),
        )

    def _not_enabled(self, i: int, cycle: Cycle) -> StopReason:
        faulty, word = cycle.fault[i], cycle.statusword[i]
        return StopReason(
            StopCode.DRIVE_FAULT if faulty else StopCode.NOT_ENABLED,
            f"joint {self._names[i]}: its drive "
            + ("reports a fault" if faulty else "is no longer enabled")
            + f" (statusword {word:04X}h). Read the drive's error, then start again from preflight",
            joint=self._names[i],
            value=float(word),
        )

    def _check_jump(self, i: int) -> StopReason:
        step, limit = self._positions.jump[i], self._positions.jump_limit[i]
        return StopReason(
            StopCode.IMPLAUSIBLE_POSITION,
            f"joint {self._names[i]}: its position jumps by {step:.4g} {self._units[i]}, but at"
            f" most {limit:.4g} {self._units[i]} are possible. Check the encoder and its cable",
            joint=self._names[i],
            value=step,
            limit=limit,
        )

    def _beyond_limits(
        self, i: int, position: float, velocity: float, torque_nm: float
    ) -> StopReason | None:
        if not self._low[i] <= position <= self._high[i]:
            limit = self._low[i] if position < self._low[i] else self._high[i]
            unit = self._units[i]
            return self._limit(i, StopCode.POSITION_LIMIT, "position", position, limit, unit)
        limit = self._velocity_limit[i]
        if not -limit <= velocity <= limit:
            unit = f"{self._units[i]}/s"
            return self._limit(i, StopCode.VELOCITY_LIMIT, "velocity", velocity, limit, unit)
        limit = self._torque_limit[i]
        if not -limit <= torque_nm <= limit:
            unit = self._torque_units[i]
            return self._limit(i, StopCode.TORQUE_LIMIT, "torque", torque_nm, limit, unit)
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
            f"joint {self._names[i]}: it is {abs(error):.4g} {self._units[i]} off its set-point,"
            f" but at most {allowed:.4g} {self._units[i]} are allowed at this speed. Check"
            " direction, gear ratio, brake and the velocity loop",
            joint=self._names[i],
            value=error,
            limit=allowed,
        )

    def _set_point(self, i: int, what: str, value: float, limit: float) -> StopReason:
        unit = self._units[i] if what.startswith("position") else f"{self._units[i]}/s"
        return StopReason(
            StopCode.SET_POINT,
            f"joint {self._names[i]}: the set-point's {what} {value:.4g} {unit}, but at most"
            f" {limit:.4g} {unit} is allowed; it was not sent. Check the motion",
            joint=self._names[i],
            value=value,
            limit=limit,
        )


def _wanted_speeds(cycle: Cycle) -> list[float]:
    """Return the commanded speeds without the part that comes from the feedforward."""
    target = cycle.target
    return [
        command if feedforward == velocity else command - feedforward + velocity
        for command, feedforward, velocity in zip(
            cycle.command, target.feedforward, target.velocity, strict=True
        )
    ]
