"""`DriveFaults`: starts and ends the faults of a script on simulated drives.

Faults in the script's part `program` affect other processes, but their start times are times of the
cell too. Therefore this module also announces when they start.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import NamedTuple

from config.simulation.faults import DriveFault, FaultScript
from drivers.canopen.frames import Frame
from mock_hw.drive.drive import SimulatedDrive
from mock_hw.host.fault_clock import CycleCount, FaultStart


class _Due(NamedTuple):
    """An action at a time [s]."""

    time_s: float
    act: Callable[[float], None]


class DriveFaults:
    """Executes the `drives` part of a fault script, and announces when faults in `program` start.

    Args:
        script: The faults.
        joint_names: Names of the joints.
        drives: Drives in the order of the joints.
        places: Places of the controlwords, from `controlword_places`.
        now_s: Present time [s].
        announce: Called with the number of a fault in the part `program` when it starts.

    Attributes:
        reversed: For each axis, True while a fault makes it move in the wrong direction.
        blocked: For each axis, True while a fault keeps its brake closed.
        stuck: For each axis, True while a fault keeps its encoder value constant.
    """

    def __init__(
        self,
        script: FaultScript,
        joint_names: Sequence[str],
        drives: Sequence[SimulatedDrive],
        places: Mapping[int, int],
        now_s: float,
        announce: Callable[[int], None] = lambda _number: None,
    ) -> None:
        self._cycles = CycleCount(places)
        self._drives = drives
        self._axes = {name: number for number, name in enumerate(joint_names)}
        self._coming = [(FaultStart(fault, now_s), fault) for fault in script.drives]
        self._program = [(FaultStart(fault, now_s), n) for n, fault in enumerate(script.program)]
        self._announce = announce
        self._due: list[_Due] = []
        self.reversed = [False] * len(drives)
        self.blocked = [False] * len(drives)
        self.stuck = [False] * len(drives)

    @property
    def next_s(self) -> float:
        """Time at which the next fault begins or ends [s], without those that begin at a cycle."""
        coming = (*self._coming, *self._program)
        begins = (begin.at_s for begin, _ in coming if begin.at_s is not None)
        return min((*begins, *(due.time_s for due in self._due)), default=math.inf)

    def observe(self, frame: Frame, now_s: float) -> None:
        """Process a frame before the drives do; start the faults that begin in its cycle."""
        self._cycles.observe(frame.cob_id, frame.data)
        if self._coming or self._program:
            self.advance(now_s)

    def advance(self, until_s: float) -> None:
        """Start and end all faults whose time has come by `until_s` [s]."""
        now_s = until_s
        for due in [due for due in self._due if due.time_s <= now_s]:
            self._due.remove(due)
            due.act(now_s)
        for begin, fault in [*self._coming]:
            if begin.starts_now(self._cycles.cycle, now_s):
                self._coming.remove((begin, fault))
                numbers = (
                    range(len(self._drives)) if fault.joint is None else [self._axes[fault.joint]]
                )
                for number in numbers:
                    self._start(fault, number, now_s)
        for begin, number in [*self._program]:
            if begin.starts_now(self._cycles.cycle, now_s):
                self._program.remove((begin, number))
                self._announce(number)

    def _start(self, fault: DriveFault, number: int, now_s: float) -> None:
        drive, kind = self._drives[number], fault.kind
        if kind == "reset":
            drive.lose_supply(now_s)
            drive.restore_supply(now_s)
        elif kind == "fault":
            drive.fail(fault.code, now_s)
        elif kind == "emergency":
            drive.report(fault.code, now_s)
            for sent in range(1, fault.count):
                time_s = now_s + sent * fault.period_s
                self._due.append(_Due(time_s, lambda at_s: drive.report(fault.code, at_s)))
        else:
            self._change(fault, number, now_s, on=True)
            if fault.duration_s is not None:
                self._due.append(
                    _Due(
                        now_s + fault.duration_s,
                        lambda at_s: self._change(fault, number, at_s, on=False),
                    )
                )

    def _change(self, fault: DriveFault, number: int, now_s: float, *, on: bool) -> None:
        drive, kind = self._drives[number], fault.kind
        if kind == "stuck_encoder":
            self.stuck[number] = on
        elif kind == "blocked":
            self.blocked[number] = on
        elif kind == "reversed":
            self.reversed[number] = on
        elif kind == "ignores_quick_stop":
            drive.ignores_quick_stop = on
        elif kind == "heartbeat_stops":
            drive.beats = not on
        elif kind == "watch_asleep":
            drive.watches = not on
        elif kind == "clock":
            drive.clock.rate = fault.clock_rate if on else 1.0
        elif kind == "motor_power_lost":
            drive.power.supply(not on)
        elif on:
            drive.lose_supply(now_s)
        else:
            drive.restore_supply(now_s)
