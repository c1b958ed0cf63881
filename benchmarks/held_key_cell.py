"""Path from the service's challenges to the set-points of the cyclic task, in simulated time.

Only the clock, the processes and the links are simulated. The service's check, the orders as lines
of JSON, the worker's check, the dead-man thread, the dead-man in shared memory and the set-points
are those of the program.
"""

from __future__ import annotations

import io
import json
from collections import deque
from contextlib import ExitStack
from dataclasses import dataclass
from typing import Final, Self

import numpy as np

from acquisition.hold_to_run.dead_man import DeadMan
from acquisition.hold_to_run.dead_man_thread import LOOK_S, DeadManThread
from acquisition.hold_to_run.held_motion import HeldMotion
from acquisition.hold_to_run.line import LineCheck
from benchmarks.held_key_links import Message, Page, Way
from config.load import load_cell
from rid_daq.operations.cell.jogging import JogKeys
from rid_daq.service.api.challenges import Challenges
from rid_daq.terminal.console import Console
from rid_daq.worker.orders import Orders

TICK_S: Final = 0.002
JOB: Final = "job"
SPEED_SHARE: Final = 0.05
LOADED: Final = load_cell("ir361")
START: Final = np.array(LOADED.config.home)


class Connection:
    """Connection of a page: its challenges and the direction to the page.

    Args:
        to_page: Link in the direction to the page.
        clock: The simulated time.
    """

    def __init__(self, to_page: Way, clock: Clock) -> None:
        self.to_page = to_page
        self.challenges = Challenges(clock)
        self._next_s = 0.0

    def work(self, now_s: float) -> None:
        """Issue a challenge if one is due."""
        if now_s >= self._next_s:
            self.to_page.send(now_s, self.challenges.issue(JOB))
            self._next_s = now_s + self.challenges.pause_s

    def order(self, received: Message) -> str | None:
        """Return the order that the service sends to the worker for a page's message, if any."""
        message = self.challenges.parse_key_message(JOB, "lease", received)
        return None if message is None else json.dumps(message.to_order())


@dataclass
class Clock:
    """The simulated time."""

    now_s: float = 1000.0

    def __call__(self) -> float:
        """Return the time [s]."""
        return self.now_s


@dataclass
class Stall:
    """Time span in which a process is suspended; it handles pending messages afterwards."""

    begin_s: float = 0.0
    end_s: float = 0.0

    def __contains__(self, now_s: float) -> bool:
        return self.begin_s <= now_s < self.end_s


class SimulatedJog:
    """Context manager of a jog whose keys are held by one page.

    Args:
        page: The page.
        to_page: Link in the direction from the service to the page.
    """

    def __init__(self, page: Page, to_page: Way) -> None:
        self.clock = Clock()
        self.page = page
        self.connection = Connection(to_page, self.clock)
        self.service_stall, self.worker_stall = Stall(), Stall()
        self.refused: list[str] = []
        self.speed = 0.0
        self._orders = Orders(io.StringIO(), self.clock)
        self._pipe: deque[str] = deque()
        robot, self._cycle_s = LOADED.robot, LOADED.config.cycle_time_s
        dead_man = DeadMan.create()
        self._motion = HeldMotion(LOADED.config, robot, dead_man, now_s=self.clock)
        self._motion.begin(False, START)
        line = LineCheck(LOADED.config, robot, SPEED_SHARE)
        self._jogging = JogKeys(robot, None, line, Console(as_json=True))
        self._pilot = DeadManThread(dead_man, len(robot.joints), self._orders, self._jogging.line)
        self._row = 0
        self._next_cycle_s = self._next_look_s = self.clock.now_s
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        self._stack.enter_context(
            self._orders.receive_keys(
                lambda _key: None,
                lambda text, _round_trip_s: self.refused.append(text),
                lambda: None,
            )
        )
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def connect(self, to_service: Way, to_page: Way) -> None:
        """Reconnect the page; messages in transit on the old connection are lost."""
        self.connection = Connection(to_page, self.clock)
        self.page.connect(to_service)

    def tick(self) -> None:
        """Advance the time by `TICK_S`."""
        now_s = self.clock.now_s = self.clock.now_s + TICK_S
        for received in self.connection.to_page.arrived(now_s):
            self.page.receive(received, now_s)
        self.page.watch(now_s)
        if now_s not in self.service_stall:
            for received in self.page.to_service.arrived(now_s):
                line = self.connection.order(received)
                if line is not None:
                    self._pipe.append(line)
            self.connection.work(now_s)
        if now_s not in self.worker_stall:
            self._work(now_s)
        if now_s >= self._next_cycle_s:
            self._next_cycle_s += self._cycle_s
            point = self._motion.at(self._row)
            self._row += 1
            self.speed = 0.0 if point is None else float(np.abs(point.velocity).max())

    def _work(self, now_s: float) -> None:
        while self._pipe:
            self._orders.take(json.loads(self._pipe.popleft()))
        if now_s >= self._next_look_s:
            self._next_look_s = now_s + LOOK_S
            self._pilot.look()
