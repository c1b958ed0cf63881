"""`PointSource`: reads the points of a path and returns compensated set-points, one per cycle."""

from __future__ import annotations

import copy
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.supervision.cycle import SetPoint
from acquisition.supervision.stop_reason import StopCode, StopReason
from compensation.online import online_kernel as stage
from compensation.online import path_kernels as path
from compensation.online import rate_kernels as rate
from compensation.online.online import OnlineFeedforward
from compensation.online.patience import BUFFER_S
from compensation.online.point_ring import READ, PointRing, PointsFailed
from config.arrays import FloatArray, PhaseArray
from config.errors import ConfigError, DriverError
from drivers.interfaces.servo_axes import Answers
from dynamics.kernels.presliding import FOUND
from dynamics.model.hysteretic_sample import initial_states

FEWEST_NODES: Final = 64
MOST_NODES: Final = 2048
FADE_S: Final = 0.1
DOUBT_S: Final = 0.5
PREFILL_PATIENCE_S: Final = 10.0
STALL_PATIENCE_S: Final = 2.0
PAUSE_S: Final = 0.0005
LONGEST_STREAM_S: Final = 3600.0

_WHAT: Final = {
    path.TORQUE_LIMIT: ("model torque", ""),
    path.POSITION_LIMIT: ("position", ""),
    path.SPEED_LIMIT: ("speed", "/s"),
    path.ACCELERATION_LIMIT: ("acceleration", "/s^2"),
    path.MOTOR_SPEED_LIMIT: ("motor speed", "/s"),
}


class PointSource:
    """A `SetPointSource` that follows streamed points with the on-line compensation.

    Args:
        feedforward: Model, velocity loops and limits.
        compensated: False for plain velocity feedforward without compensation, for comparisons.
        phase: Shape (points,). `Phase` of each point (default: `Phase.MAIN`).
        samples_per_period: Points per period of a periodic motion.
        buffer_s: Length of the path read ahead, in which the robot can stop; 64 points or more [s].
        prefill_patience_s, stall_patience_s: Wall-clock time that `prepare` waits for the first
            points, and that a cell in lock-step waits for points [s].

    Raises:
        ConfigError: The number of joints is not the robot's, or the buffer is too long.
    """

    def __init__(
        self,
        feedforward: OnlineFeedforward,
        ring: PointRing,
        *,
        compensated: bool = True,
        phase: PhaseArray | None = None,
        samples_per_period: int | None = None,
        buffer_s: float = BUFFER_S,
        prefill_patience_s: float = PREFILL_PATIENCE_S,
        stall_patience_s: float = STALL_PATIENCE_S,
    ) -> None:
        n = len(feedforward.robot.joints)
        if ring.joints != n:
            raise ConfigError(
                f"the points have {ring.joints} values, but the robot has {n} joints: send one"
                " value per joint",
                code="RID-MOTION-JOINTS",
            )
        self._feedforward = feedforward
        self._ring = ring
        self._compensated = compensated
        self._phase = phase
        self._samples_per_period = samples_per_period
        self._buffer = buffer_points(buffer_s, feedforward.cycle_time_s)
        self._prefill_patience_s = prefill_patience_s
        self._stall_patience_s = stall_patience_s
        self._row = -1
        self._late = 0
        self._shown_at_rest = False
        self._signals = feedforward.signals
        self._loads = feedforward.loads
        self._signal_stop: StopReason | None = None
        self._kept_at_start = False

    @property
    def samples_per_period(self) -> int | None:
        """Rows per period of a periodic motion; None for any other motion."""
        return self._samples_per_period

    @property
    def rows_expected(self) -> int:
        """Number of points; the number of one hour if the stream's length is not known."""
        if self._phase is not None:
            return len(self._phase)
        return round(LONGEST_STREAM_S / self._feedforward.cycle_time_s)

    @property
    def period_ends(self) -> Mapping[int, int]:
        """Empty, because a streamed path is driven to its end."""
        return {}

    @property
    def stop(self) -> StopReason | None:
        """Reason why the motion stopped before the path's end; None if it reached the end."""
        if self._signal_stop is not None:
            return self._signal_stop
        if self._counts[path.STATE] == path.ARRIVED:
            return None
        if self._counts[path.CLOSED] == path.REFUSED:
            return self._stop_reason()
        at = f" The robot stopped on its path, at point {self._point(path.NODE)}."
        if self._ring.failed is not PointsFailed.NO:
            refused = self._ring.failed is PointsFailed.REFUSED
            code = StopCode.POINTS_REFUSED if refused else StopCode.POINTS_LOST
            return StopReason(code, f"{self._ring.failure}.{at}")
        return StopReason(
            StopCode.POINTS_LOST,
            f"no new points arrived in time: {int(self._ring.counters[READ])} had arrived.{at}"
            " Keep the buffer full, and announce the end",
        )

    @property
    def notes(self) -> Sequence[str]:
        """Limitations of the compensation during this motion."""
        counts, notes = self._counts, []
        if counts[stage.INVALID_TORQUES] or counts[stage.LARGE] or self._late:
            notes.append(
                "compensation: replaced by plain velocity feedforward for a while, because of"
                f" {counts[stage.INVALID_TORQUES]} cycles with an invalid model torque,"
                f" {counts[stage.LARGE]} with a correction that was too large, {self._late} late"
                " cycles"
            )
        if counts[stage.LIMITED]:
            notes.append(
                "compensation: torque, speed or acceleration limited in"
                f" {counts[stage.LIMITED]} cycles"
            )
        return notes + ([] if self._signals is None else self._signals.notes)

    def prepare(self) -> None:
        """Allocate memory, compile, read the first points and check them.

        Raises:
            DriverError: No points arrive, or too few for a stop.
            ConfigError: The first points are refused.
        """
        forward, ring = self._feedforward, self._ring
        n, step_s = ring.joints, forward.cycle_time_s
        nodes = self._buffer + path.SPARE
        places = forward.delay_cycles + 2
        self._counts = np.zeros(stage.COUNTS, dtype=np.int64)
        self._pace = np.zeros(stage.PACE)
        self._nodes = np.zeros((nodes, path.NODE_ROWS, n))
        self._line = np.zeros((places, stage.PLACE_ROWS, n))
        self._state = np.zeros((stage.STATE_ROWS, n))
        self._memory = np.array([initial_states(n), initial_states(n)])
        self._found = np.zeros((n, FOUND))
        self._position = np.zeros(n)  # of the motors, link side
        self._seen = np.full(n, np.iinfo(np.int64).max // 2)  # no encoder counts yet
        self._out, head = np.zeros((3, n)), np.zeros((3, n))
        profiles = np.zeros((2, nodes))
        self._path: path.PathArrays = (
            forward.axes, self._nodes, profiles, self._counts, self._pace, step_s
        )  # fmt: skip
        self._stage: stage.StageArrays = (
            self._line, self._state, self._memory, self._found, head, self._out
        )  # fmt: skip
        if self._signals is not None:
            self._loads = self._signals.begin(forward.loads, forward.delay_cycles * step_s)
            self._counts[path.SIGNALLED] = 1
            # call the kernel once on a path that has stopped, so that numba compiles it
            stopped = np.full(stage.COUNTS, path.STOPPED)
            rate.cut_path((forward.axes, self._nodes, profiles, stopped, self._pace, step_s))
        self._counts[stage.DELAY] = forward.delay_cycles
        self._counts[stage.RESTED] = -1
        self._counts[stage.HYSTERETIC] = (forward.axes[stage.PRESLIDING] > 0.0).any()
        self._counts[stage.HOLD] = max(1, round(DOUBT_S / step_s))
        self._counts[stage.FADE] = max(1, round(FADE_S / step_s))
        if not self._compensated:
            self._counts[stage.SUSPENDED_UNTIL] = np.iinfo(np.int64).max // 2
        until_s = time.monotonic() + self._prefill_patience_s
        while True:
            self._take_points(nodes)
            if self._filled or ring.closed or time.monotonic() > until_s:
                self._take_points(nodes)
                break
            time.sleep(PAUSE_S)
        if self._counts[path.CLOSED] == path.REFUSED and self._counts[path.KNOWN] < 2 * path.SPARE:
            raise ConfigError(
                f"{self._stop_reason().text}; nothing was moved", code="RID-STREAM-POINTS"
            )
        begin = rate.plan_stop(self._path, 0)
        if self._counts[path.KNOWN] == 0 or begin < 1:
            why = ring.failure or f"only {int(ring.counters[READ])} arrived"
            raise DriverError(
                f"too few points to begin: {why}; nothing was moved. Send points that begin at"
                " rest: either enough points for a stop, or the whole path with its end",
                code="RID-STREAM-POINTS",
            )
        self._counts[path.SAFE] = begin
        self._counts[path.HORIZON] = self._counts[path.KNOWN] - 1
        at_rest = self._nodes[0, path.TAU]
        self._state[[stage.CARRIED, stage.LATEST]] = np.where(np.isfinite(at_rest), at_rest, 0.0)
        self._line[:, 0] = self._nodes[0, 0]
        for _ in range(forward.delay_cycles):
            self._may_continue()
        # call the kernel once, so that numba compiles it; the result is not used
        self._observe_joints()
        self._memory[stage.MEASURED] = initial_states(n)

    def refuse_begin(self, answers: Answers) -> None:
        """Refuse to begin while the input of the first load change is active.

        Raises:
            PreflightError: The input is active.
        """
        if self._signals is not None:
            self._signals.refuse_active(answers)

    def begin(self, lockstep: bool, position: FloatArray) -> FloatArray:
        """Return the pose at which the motion begins."""
        self._lockstep = lockstep
        self._position[:] = self._motors_by_joints @ position
        if self._counts[stage.HYSTERETIC]:
            self._observe_joints()
        return np.array(self._nodes[0, 0])

    def watch(self, answers: Answers) -> None:
        """Observe the joints until they leave the first point, and the signals on the path.

        A change by one encoder count does not count as motion, because the last digit fluctuates at
        rest.
        """
        if self._signals is not None and self._row < 0 and not self._kept_at_start:
            self._signal_stop = self._signals.watch_approach(answers)
        elif self._signals is not None and self._signal_stop is None:
            head_s = (self._counts[path.NODE] - path.BEFORE) * self._feedforward.cycle_time_s
            time_s = self._present_point * self._feedforward.cycle_time_s
            self._signal_stop = self._signals.observe(time_s, head_s, answers)
            if self._signal_stop is not None:
                rate.cut_path(self._path)
        elif self._signals is not None and self._row >= 0:
            self._signals.note_stated(self._present_point * self._feedforward.cycle_time_s)
        beginning = self._row < 0 or self._counts[stage.MEASURING]
        if beginning and self._counts[stage.HYSTERETIC]:
            counts = answers.position_counts
            moved = np.abs(counts - self._seen) > 1
            of_motors = self._motors_by_joints @ answers.position
            self._seen[moved], self._position[moved] = counts[moved], of_motors[moved]
            self._observe_joints()

    def at(self, row: int) -> SetPoint | None:
        """Return the set-point of a cycle; None once the robot is at rest on the path."""
        if self._row < 0 and self._signal_stop is not None:
            self._kept_at_start = True
            return None
        if self._lockstep:
            self._wait_for_points()
        if self._row < 0:
            self._counts[stage.MEASURING] = self._counts[stage.HYSTERETIC]
        missed = row - self._row - 1
        if missed > 0:
            self._late += 1
            if self._compensated:
                self._counts[stage.SUSPENDED_UNTIL] = (
                    self._counts[stage.HEAD] + self._counts[stage.HOLD]
                )
        over = False
        for _ in range(1 + missed):
            over = self._may_continue()
        self._row = row
        if over and self._shown_at_rest:
            return None
        self._shown_at_rest = over
        position, velocity, ahead = self._out.tolist()
        point = self._present_point
        phase = Phase.MAIN if self._phase is None else int(self._phase[point])
        return SetPoint(position, velocity, ahead, point, phase)

    @property
    def _present_point(self) -> int:
        """Number of the point of the latest set-point."""
        at = self._counts.item(stage.HEAD) - 1 - self._counts.item(stage.DELAY)
        node = int(self._line.item(at % len(self._line), stage.INDEX, 0))
        return self._clip(node - path.BEFORE)

    @property
    def _motors_by_joints(self) -> FloatArray:
        return np.asarray(self._feedforward.torque.arrays[5][1])

    def _observe_joints(self) -> None:
        stage.observe_position(self._position, self._feedforward.axes, self._memory, self._found)

    def _may_continue(self) -> bool:
        forward, ring = self._feedforward, self._ring
        return bool(
            stage.next_set_point(
                ring.counters,
                ring.rows,
                forward.torque.arrays,
                self._loads,
                self._path,
                self._stage,
            )
        )

    def _take_points(self, most: int) -> None:
        forward, ring = self._feedforward, self._ring
        model, loads = forward.torque.arrays, self._loads
        path.take_points(ring.counters, ring.rows, model, loads, self._path, most)

    @property
    def _filled(self) -> bool:
        room = len(self._nodes) - path.SPARE - (self._counts[path.FILLED] - self._counts[path.NODE])
        return bool(self._counts[path.CLOSED] != path.OPEN or room <= 0)

    def _wait_for_points(self) -> None:
        """Pause simulated time while the path has room for points and none is waiting."""
        until_s = time.monotonic() + self._stall_patience_s
        while not self._filled and not self._ring.failed:
            waiting = self._ring.written - int(self._ring.counters[READ])
            if waiting > 0 or self._ring.ended:
                return
            if time.monotonic() > until_s:
                self._stall_patience_s = 0.0
                return
            time.sleep(PAUSE_S)

    def _clip(self, point: int) -> int:
        return min(max(point, 0), max(int(self._ring.counters[READ]) - 1, 0))

    def _point(self, word: int) -> int:
        return self._clip(int(self._counts[word]) - path.BEFORE)

    def _stop_reason(self) -> StopReason:
        counts, pace = self._counts, self._pace
        joint = self._feedforward.robot.joints[int(counts[path.REASON_JOINT])]
        why, point = int(counts[path.REASON]), int(counts[path.REASON_POINT])
        found, allowed = float(pace[path.FOUND]), float(pace[path.ALLOWED])
        base = joint.torque_unit if why == path.TORQUE_LIMIT else joint.unit
        where = f"point {point}, joint {joint.name}"
        limits: dict[str, Any] = {"joint": joint.name, "value": found, "limit": allowed}
        if why == path.NOT_FINITE:
            text = f"{where}: the position is not a number"
            limits = {"joint": joint.name}
        else:
            quantity, per = _WHAT[why]
            text = (
                f"{where}: the {quantity} of the path is {found:.4g} {base}{per}, the limit is"
                f" {allowed:.4g}"
            )
        rested = counts[stage.RESTED] >= 0
        at = " The robot stopped on its path before this point." if rested else ""
        return StopReason(StopCode.POINTS_REFUSED, f"{text}.{at}", **limits)


def buffer_points(buffer_s: float, cycle_time_s: float) -> int:
    """Return the number of points in a buffer of this length [s]; 64 or more.

    Raises:
        ConfigError: The buffer would have more than 2048 points.
    """
    points = max(round(buffer_s / cycle_time_s), FEWEST_NODES)
    if points > MOST_NODES:
        raise ConfigError(
            f"a buffer of {buffer_s:g} s has {points} points, more than {MOST_NODES}: choose a"
            " shorter buffer",
            code="RID-OPTION-RANGE",
        )
    return points


def compile_stage(feedforward: OnlineFeedforward) -> None:
    """Compile or load the kernels, so that the cyclic task begins without delay.

    numba compiles a kernel again for arrays that are read-only. The arrays here are those that the
    cyclic task receives: copies, which can be written.

    Args:
        feedforward: Data of any robot; the compiled code is the same for all robots.
    """
    copied = copy.deepcopy(replace(feedforward, signals=None))
    axes = copied.axes
    axes[path.TORQUE] = np.inf
    ring = PointRing.create(axes.shape[1], FEWEST_NODES)
    ring.write(np.tile(0.5 * (axes[path.LOW] + axes[path.HIGH]), (FEWEST_NODES, 1)))
    ring.end()
    PointSource(replace(copied, signals=feedforward.signals), ring).prepare()
