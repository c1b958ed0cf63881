"""A running motion, and the time at which its process receives a stop."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Iterator
from dataclasses import dataclass

from playwright.sync_api import Page

from acquisition.task.control_block import ControlBlock
from rid_daq.service.records import CellState
from tests.rid_daq.service.conftest import ServedProcess
from tests.rid_daq.service.moving import CHECK, begin_motion, until

CELL = "ir361"
SOON_S = 0.5
"""Maximum time from a press of STOP to its arrival in the driving process, with an undisturbed
link.
"""


@dataclass
class StoppedMotion:
    """A motion, and the time at which its process received the stop [s of `time.monotonic`]."""

    stopped: threading.Event
    stopped_s: float = 0.0

    def require_stopped(self, pressed_s: float, within_s: float = SOON_S) -> None:
        """Require that the process received the stop within a time after the press."""
        assert self.stopped.wait(60.0), "the process did not receive the stop"
        assert 0.0 < self.stopped_s - pressed_s <= within_s


@contextlib.contextmanager
def moving(served: ServedProcess, lease: str) -> Iterator[StoppedMotion]:
    """Move the robot, and monitor the process that drives it."""
    with served.client as client:
        if client.cell(CELL).state is not CellState.READY:
            client.run(CELL, "check", CHECK, lease=lease).require_done()
    job = begin_motion(served, lease)
    with served.client as client:
        pid = client.job(job.id).pid
    assert pid is not None
    control = ControlBlock.of_process(pid)
    assert control is not None
    motion = StoppedMotion(threading.Event())

    def watch() -> None:
        while control.task.stop_reason is None:
            time.sleep(0.001)
        motion.stopped_s = time.monotonic()
        motion.stopped.set()

    watching = threading.Thread(target=watch, daemon=True)
    watching.start()
    try:
        yield motion
    finally:
        with served.client as client:
            client.stop(CELL)
            until(lambda: client.cell(CELL).job is None)
        watching.join()


def press(page: Page) -> float:
    """Press STOP without releasing it or waiting for the page.

    Returns:
        Time of the press [s of `time.monotonic`].
    """
    box = page.locator("#stop").bounding_box()
    assert box is not None
    page.mouse.up()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    pressed_s = time.monotonic()
    page.mouse.down()
    return pressed_s


def words_of(page: Page) -> str:
    """Return the page's text about the stop."""
    return page.locator("#stop-words").inner_text()
