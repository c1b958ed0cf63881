"""`PowerSequence`: switches drives through their power states, cycle by cycle, at velocity 0.

Every wait has a time limit; the error after a timeout names the drive's present state.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from config.cell.cell import CellConfig, DriveAxis
from config.errors import DeviceFaultError, DeviceTimeoutError, SafetyStop
from config.robot.robot import RobotDescription
from drivers.canopen.nmt import NmtState
from drivers.ports.clock import Clock
from drivers.servo.cia402 import (
    FOLLOWS_COMMAND,
    ControlWord,
    PowerState,
    next_controlword,
    state_of,
)
from drivers.servo.cyclic_exchange import CyclicExchange
from drivers.servo.drive_watch import DriveWatch, other_senders
from drivers.servo.stop_ramp import longest_ramp_s

START_TIMEOUT_S = 2.0
HALT_MARGIN_S = 0.5
DISABLE_S = 0.25
DISABLE_CYCLES = 5
REST_CYCLES = 5

_WITHOUT_POWER = frozenset(
    (PowerState.SWITCH_ON_DISABLED, PowerState.FAULT, PowerState.NOT_READY_TO_SWITCH_ON)
)


class AxisAnswer(NamedTuple):
    """Answer of one axis in one cycle: True if it arrived, and the statusword 6041h."""

    joint: str
    received: bool
    status: int

    @property
    def state(self) -> PowerState:
        """Power state in the statusword."""
        return state_of(self.status)

    def __str__(self) -> str:
        """Return the answer in words."""
        if not self.received:
            return f"{self.joint} is silent"
        return f"{self.joint} is {self.state.words} (6041h={self.status:04X}h)"


class PowerSequence:
    """Sends the controlwords for the next power states, and checks that the drives follow in time.

    Args:
        axes: The drives, base to flange.
        cell, robot: The cycle time, the drives' deceleration in a quick stop, and the largest
            velocities are used.
        clock: The clock of the bus.
        exchange: Source of the answers; also used to send controlwords outside a cycle.
        watch: Monitor of the drives' other frames.
        run_cycle: Runs the next cycle: SYNC, answers, then the controlwords of its argument, with
            velocity 0.
        stopped: Returns True once a stop was ordered; no drive is then switched on.
    """

    def __init__(
        self,
        axes: Sequence[DriveAxis],
        cell: CellConfig,
        robot: RobotDescription,
        clock: Clock,
        exchange: CyclicExchange,
        watch: DriveWatch,
        run_cycle: Callable[[Sequence[int]], None],
        stopped: Callable[[], bool],
    ) -> None:
        self._axes = axes
        self._clock = clock
        self._exchange = exchange
        self._watch = watch
        self._run_cycle = run_cycle
        self._stopped = stopped
        self._period_s = cell.cycle_time_s
        profiles = [cell.servo_of(axis) for axis in axes]
        self._follows = [
            FOLLOWS_COMMAND if each.follows_bit and each.mode.startswith("cyclic") else 0
            for each in profiles
        ]
        self._enable_s = max(each.enable_timeout_s for each in profiles)
        self._halt_s = longest_ramp_s(cell, robot) + HALT_MARGIN_S

    def wait_until_operational(self) -> None:
        """Wait until every drive answers SYNC and reports that it is operational.

        Raises:
            DeviceTimeoutError: A drive does not become operational within `START_TIMEOUT_S`.
            DeviceFaultError: A drive reports a fault during the wait.
            SafetyStop: A stop was ordered.
        """
        until_s = self._clock.now_s() + START_TIMEOUT_S
        waiting = [axis.joint for axis in self._axes]
        while waiting:
            self._step([ControlWord.DISABLE_VOLTAGE] * len(self._axes), until_s, "start", waiting)
            waiting = [
                answer.joint
                for answer, heartbeat in zip(self._answers(), self._watch.heartbeats, strict=True)
                if not answer.received or heartbeat.state != NmtState.OPERATIONAL
            ]

    def enable(self) -> None:
        """Switch every drive to Operation Enabled, one checked step per cycle.

        Raises:
            DeviceTimeoutError: A drive does not reach Operation Enabled within the longest
                `enable_timeout_s` of all drives, or does not report that it follows its command
                (6041h bit 12).
            DeviceFaultError: A drive is in fault, reports a fault, or has left Operation Enabled.
            SafetyStop: A stop was ordered.
        """
        until_s = self._clock.now_s() + self._enable_s
        words = [ControlWord.DISABLE_VOLTAGE] * len(self._axes)
        waiting = [axis.joint for axis in self._axes]
        enabled: set[str] = set()
        while waiting:
            self._step(words, until_s, "be enabled", waiting)
            answers = self._answers()
            _refuse_fault(answers, enabled)
            words = [
                next_controlword(answer.state) if answer.received else word
                for answer, word in zip(answers, words, strict=True)
            ]
            waiting = [
                answer.joint
                for answer, follows in zip(answers, self._follows, strict=True)
                if answer.joint not in enabled
                or not (answer.received and answer.status & follows == follows)
            ]
        self._exchange.send_words(words)

    def rest(self) -> bool:
        """Command a quick stop; return True when each drive is at rest or without power.

        Wait at most for the duration of the slowest ramp (limited to `LONGEST_STOP_S`) plus
        `HALT_MARGIN_S`.
        """
        until_s = self._clock.now_s() + self._halt_s
        words = [ControlWord.QUICK_STOP] * len(self._axes)
        still = [0] * len(self._axes)
        counts = self._exchange.answers.position_counts
        while self._clock.now_s() < until_s:
            before = counts.tolist()
            self._run_cycle(words)
            answers = self._answers()
            still = [
                cycles + 1 if answer.received and abs(counter.nearest(new, old) - old) <= 1 else 0
                for cycles, answer, old, new, counter in zip(
                    still, answers, before, counts.tolist(), self._exchange.counters, strict=True
                )
            ]
            if all(
                answer.received and (not answer.state.powered or cycles >= REST_CYCLES)
                for answer, cycles in zip(answers, still, strict=True)
            ):
                return True
        return False

    def disable_voltage(self) -> list[str]:
        """Disable voltage; return the joints whose drive did not confirm this in time."""
        unconfirmed = [axis.joint for axis in self._axes]
        words = [ControlWord.DISABLE_VOLTAGE] * len(self._axes)
        for _ in range(max(DISABLE_CYCLES, math.ceil(DISABLE_S / self._period_s))):
            self._run_cycle(words)
            unconfirmed = [
                answer.joint
                for answer in self._answers()
                if not answer.received or answer.state not in _WITHOUT_POWER
            ]
            if not unconfirmed:
                break
        return unconfirmed

    def bus_notes(self) -> tuple[str, ...]:
        """Return remarks about other senders that were detected on this bus."""
        exchange = self._exchange
        return other_senders(
            self._axes, self._watch, exchange.answers.second_answers, exchange.contradictions
        )

    def _step(
        self, words: Sequence[int], until_s: float, verb: str, waiting: Sequence[str]
    ) -> None:
        """Run a cycle; raise an error at a fault, at a stop order, or after `until_s` [s]."""
        if self._stopped():
            raise SafetyStop(
                f"a stop was ordered before the drives could {verb}", code="RID-STOP-ORDERED"
            )
        if self._clock.now_s() > until_s:
            states = "; ".join(str(a) for a in self._answers() if a.joint in waiting)
            raise DeviceTimeoutError(
                f"the drives could not {verb} in time: {'; '.join((states, *self.bus_notes()))};"
                f" {self._advice(waiting)}",
                code="RID-DRIVE-NOT-ENABLED" if verb == "be enabled" else "RID-DRIVE-NOT-STARTED",
            )
        self._run_cycle(words)
        if faults := self._watch.faults():
            raise DeviceFaultError(
                "; ".join(event.text for event in faults), code="RID-DRIVE-FAULT"
            )

    def _advice(self, waiting: Sequence[str]) -> str:
        """Return what to do about drives that do not reach their state in time."""
        without_bit = [
            answer.joint
            for answer in self._answers()
            if answer.joint in waiting and answer.state is PowerState.OPERATION_ENABLED
        ]
        if without_bit:
            return (
                "6041h bit 12 (follows the command) is missing: check mode 6060h and the drive's"
                " own limits; or, if its manual says that it never sets that bit, set follows_bit:"
                " false in the axis's servo"
            )
        return (
            "check supply, brakes, enable inputs and emergency stop; or, if the drive needs longer"
            f" than {self._enable_s:g} s, set enable_timeout_s in the axis's servo"
        )

    def _answers(self) -> list[AxisAnswer]:
        answers = self._exchange.answers
        return [
            AxisAnswer(axis.joint, received, status)
            for axis, received, status in zip(
                self._axes, answers.received.tolist(), answers.statusword.tolist(), strict=True
            )
        ]


def _refuse_fault(answers: Sequence[AxisAnswer], enabled: set[str]) -> None:
    """Raise an error for a drive in fault or a lost Operation Enabled; update `enabled`."""
    for answer in answers:
        if not answer.received:
            continue
        state = answer.state
        if state.faulty or (answer.joint in enabled and state is not PowerState.OPERATION_ENABLED):
            raise DeviceFaultError(
                f"{answer.joint}: the drive is {state.words}; find the cause, then begin again",
                code="RID-DRIVE-FAULT",
            )
        if state is PowerState.OPERATION_ENABLED:
            enabled.add(answer.joint)
