"""`LiveWrench`: the wrench that a force plate measures during a motion, for the 3-D view."""

from __future__ import annotations

import math
import time

import numpy as np

from acquisition.recording.plate_geometry import PlateGeometry
from acquisition.session.plate_block import PlateBlock, PlateState
from config.cell.plate import CHANNELS, PlateConfig


class LiveWrench:
    """Reads the newest row of the force plate from the shared memory of a job's process.

    Args:
        plate: The cell's plate.
        pid: Process of the job.
    """

    def __init__(self, plate: PlateConfig, pid: int) -> None:
        self._matrix = PlateGeometry.from_config(plate).base_wrench_matrix
        self._offset_n = np.zeros(CHANNELS)
        if plate.zero is not None:
            self._offset_n = np.array(plate.zero.offset_n)
        self._pid = pid
        self._block: PlateBlock | None = None

    def document(self) -> dict[str, object] | None:
        """Return the wrench of the base on the robot; None while no plate is recorded.

        The wrench is about the origin of the base frame and in its axes, relative to the plate's
        zero. It contains `force_n` [N], `moment_nm` [N m], `age_s` [s] (None before the first row)
        and `overloaded` (True if a channel was overloaded since the start of the recording).
        """
        if self._block is None or self._block.state is not PlateState.RECORDING:
            self._block = self._find_block()
        if self._block is None:
            return None
        status = self._block.status(time.monotonic())
        wrench = [round(each, 3) for each in (self._matrix @ (status.force_n - self._offset_n))]
        return {
            "force_n": wrench[:3],
            "moment_nm": wrench[3:],
            "age_s": round(status.age_s, 3) if math.isfinite(status.age_s) else None,
            "overloaded": any(status.overloads),
        }

    def _find_block(self) -> PlateBlock | None:
        """Return the block of the plate that is being recorded; None without one."""
        try:
            blocks = PlateBlock.all_of_process(self._pid)
            return next((each for each in blocks if each.state is PlateState.RECORDING), None)
        except OSError:  # the process has just ended
            return None
