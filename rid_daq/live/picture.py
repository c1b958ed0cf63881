"""`MotionPicture`: values of the live page as one JSON document, from shared memory alone."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass

from acquisition.motion.samples import Phase
from acquisition.task.control_block import ControlBlock
from acquisition.task.joint_values import JointValues, JointWatch
from acquisition.task.ring import Ring
from acquisition.task.states import RecorderState, TaskProgress, TaskState
from config.cell.cell import CellConfig
from config.plausible import ZERO_CELSIUS_K
from config.process.safety_clock import safety_now_s
from config.robot.robot import RobotDescription
from rid_daq.terminal.motion_progress import describe_state

RATE_AFTER_S = 2.0


@dataclass(frozen=True)
class ShownMotion:
    """Properties of a motion that are known before it begins.

    Attributes:
        title: Description of the motion in a sentence.
        rows: Number of cycles of the motion, 0 if unknown.
        rows_per_period: Number of cycles per period; None for a motion that is not periodic.
        cell, robot: Names, limits and cycle time.
    """

    title: str
    rows: int
    rows_per_period: int | None
    cell: CellConfig
    robot: RobotDescription


class MotionPicture:
    """Reads the latest state of a motion; it writes nothing.

    Args:
        motion: Description of the motion.
        ring, control: Shared memory of the motion.
    """

    def __init__(self, motion: ShownMotion, ring: Ring, control: ControlBlock) -> None:
        self._motion = motion
        self._ring = ring
        self._control = control
        self._watch = JointWatch(ring, motion.cell, motion.robot)
        self._values: JointValues | None = None
        self._written = 0
        self._changed_s = safety_now_s()
        self._began: tuple[float, int] | None = None
        self._row = 0

    def document(self) -> bytes:
        """Return the document on one line, in ASCII."""
        return json.dumps(self._picture(), allow_nan=False).encode("ascii")

    def _picture(self) -> dict[str, object]:
        motion, control = self._motion, self._control
        progress = control.progress
        now_s = safety_now_s()
        if self._ring.written != self._written:
            self._written, self._changed_s = self._ring.written, now_s
            self._values = self._watch.look() or self._values
        reason = control.task.stop_reason
        error = control.task.error
        return {
            "title": motion.title,
            "cell": motion.cell.name,
            "robot": motion.robot.name,
            "state": progress.state.name.lower(),
            "words": describe_state(progress),
            "phase": progress.phase.name.lower() if progress.state is TaskState.MOVING else "",
            "moving": progress.state in (TaskState.MOVING, TaskState.STOPPING),
            "age_s": round(now_s - self._changed_s, 3) if self._written else None,
            **self._progress_values(progress, now_s),
            "joints": self._joints(progress),
            "stop_asked": bool(control.program.stop_code),
            "stop": None if reason is None else reason.text,
            "stop_joint": None if reason is None else reason.joint,
            "at_rest_s": control.task.ramp_s,
            "problem": None if error is None else str(error),
            "recorder": f"failed: {control.recorder.error}"
            if control.recorder.state is RecorderState.FAILED
            else control.recorder.state.name.lower(),
            "notes": [*control.task.notes, *filter(None, [control.monitor.note])],
            "over": control.task_gone,
            "drives_off": control.task.state is TaskState.FINISHED and control.task.power_off,
        }

    def _progress_values(self, progress: TaskProgress, now_s: float) -> dict[str, object]:
        motion = self._motion
        if progress.sample_index >= 0:
            if self._began is None:
                self._began = (now_s, progress.sample_index)
            self._row = progress.sample_index
        whole = progress.state is TaskState.MOVING and progress.phase is Phase.HOLD
        row = motion.rows if whole else self._row
        per_period = motion.rows_per_period
        if per_period:
            count = f"{row / per_period:.1f} of {motion.rows / per_period:.1f} periods"
        elif motion.rows:
            period_s = motion.cell.cycle_time_s
            count = f"{row * period_s:.0f} of {motion.rows * period_s:.0f} s"
        else:
            count = f"{row * motion.cell.cycle_time_s:.0f} s"
        return {
            "share": row / motion.rows if motion.rows else None,
            "count": count,
            "left_s": self._left_s(row, now_s),
        }

    def _left_s(self, row: int, now_s: float) -> float | None:
        """Return the remaining real time [s], from the pace so far: a simulation may run faster."""
        if self._began is None or not self._motion.rows:
            return None
        began_s, first = self._began
        if now_s - began_s < RATE_AFTER_S or row <= first:
            return (self._motion.rows - row) * self._motion.cell.cycle_time_s
        return (self._motion.rows - row) * (now_s - began_s) / (row - first)

    def _joints(self, progress: TaskProgress) -> list[dict[str, object]]:
        values, temperatures = self._values, progress.temperature_k
        shown = []
        for i, joint in enumerate(self._motion.robot.joints):
            limits = joint.limits
            warm = _finite(temperatures[i] - ZERO_CELSIUS_K) if temperatures else None
            line: dict[str, object] = {
                "name": joint.name,
                "unit": joint.unit,
                "torque_unit": joint.torque_unit,
                "position_min": limits.position_min,
                "position_max": limits.position_max,
                "velocity_limit": limits.velocity,
                "torque_limit": limits.torque,
                "temperature_c": warm,
                "answers": None if values is None else bool(values.valid[i]),
            }
            for name in _NUMBERS:
                line[name] = None if values is None else _finite(float(getattr(values, name)[i]))
            shown.append(line)
        return shown


_NUMBERS = (
    "position",
    "velocity",
    "torque",
    "torque_share",
    "following_error",
    "following_error_share",
)


def _finite(value: float) -> float | None:
    return float(f"{value:.5g}") if math.isfinite(value) else None
