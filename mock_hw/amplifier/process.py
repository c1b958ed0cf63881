"""`ServedAmplifier`: a simulated amplifier alone, in real time, in a process of its own.

A cell serves its amplifier beside its drives (`mock_hw.plate_service`); this one stands under a
load that swings, for whoever wants to talk to an amplifier without a robot.
"""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import select
import signal
import time
from dataclasses import dataclass
from multiprocessing.connection import Connection

import numpy as np
from numpy.typing import NDArray

from config.errors import RidDaqError
from mock_hw.amplifier.port import AmplifierPort, PlateSettings
from mock_hw.host.device_process import (
    DeviceProcess,
    catch_terminate,
    keep_pace,
    leave_signals_to_parent,
    wait_until_ready,
)

STEP_S = 0.002

Wrench = tuple[float, float, float, float, float, float]


@dataclass(frozen=True)
class SwingingLoad:
    """What the base exerts on the load: constant [N, N m] plus a sine of one frequency [Hz]."""

    constant: Wrench = (0.0, 0.0, -900.0, 0.0, 0.0, 0.0)
    amplitude: Wrench = (50.0, 30.0, 20.0, 40.0, 60.0, 10.0)
    frequency_hz: float = 0.5

    def at(self, times_s: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the wrench at times (m,) [s], (m, 6)."""
        swing = np.sin(2.0 * math.pi * self.frequency_hz * times_s)
        wrench: NDArray[np.float64] = np.array(self.constant) + np.outer(swing, self.amplitude)
        return wrench


class ServedAmplifier:
    """A simulated amplifier on a pseudo-terminal: ``with ServedAmplifier(...) as address: ...``.

    It ends with the `with`, and by itself when the process that started it has died.

    Parameters
    ----------
    settings : PlateSettings
        What is served, and where.
    load : SwingingLoad, optional
        What stands on the plate.

    Raises
    ------
    TransportError
        It cannot be served.
    """

    def __init__(self, settings: PlateSettings, load: SwingingLoad | None = None) -> None:
        self._settings = settings
        self._load = load or SwingingLoad()
        self._process: DeviceProcess | None = None

    def __enter__(self) -> str:
        """Start the process; return the port's path."""
        self._process = DeviceProcess(serve_amplifier, self._settings, self._load)
        try:
            wait_until_ready("amplifier", self._process.pipe)
        except BaseException:
            self._end()
            raise
        return str(self._settings.path)

    def __exit__(self, *_: object) -> None:
        """End the process."""
        self._end()

    def _end(self) -> None:
        if self._process is not None:
            self._process.end()
        self._process = None


def serve_amplifier(settings: PlateSettings, load: SwingingLoad, ready: Connection) -> None:
    """Serve an amplifier until SIGTERM or the parent's end.

    Sends None through `ready` once it can be talked to, or the text of what went wrong.
    """
    leave_signals_to_parent()
    stop_fd = catch_terminate()
    keep_pace(True)
    try:
        port = AmplifierPort(settings, realtime=True, now_s=time.monotonic())
        with contextlib.closing(port):
            # Kernels are compiled before anybody waits for rows.
            _step(port, load, time.monotonic())
            ready.send(None)
            ready.close()
            parent = multiprocessing.parent_process()
            ends = [stop_fd] if parent is None else [stop_fd, parent.sentinel]
            _run(port, load, ends)
    except (OSError, RidDaqError) as error:
        with contextlib.suppress(OSError):
            ready.send(str(error))
    finally:
        signal.set_wakeup_fd(-1)


def _run(port: AmplifierPort, load: SwingingLoad, stop_fds: list[int]) -> None:
    next_s = time.monotonic()
    while True:
        next_s = max(next_s + STEP_S, time.monotonic())
        if select.select(stop_fds, [], [], max(0.0, next_s - time.monotonic()))[0]:
            return
        now_s = time.monotonic()
        _step(port, load, now_s)
        if data := port.read():
            port.receive(data, load.at(np.array([now_s]))[0], now_s)


def _step(port: AmplifierPort, load: SwingingLoad, now_s: float) -> None:
    begin_s = port.time_s
    steps = max(1, math.ceil((now_s - begin_s) / STEP_S))
    ends_s = begin_s + (now_s - begin_s) * np.arange(1, steps + 1) / steps
    middles_s = ends_s - 0.5 * (now_s - begin_s) / steps
    port.feel(now_s, ends_s, load.at(middles_s))
