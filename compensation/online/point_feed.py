"""Write points into the ring, after checks of the points and of stops that begin at them."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Iterable
from typing import Final

import numpy as np

from acquisition.motion.collision import ROWS_AT_ONCE, refuse_collision
from acquisition.motion.stop_distance import ORDERED_STOP_CYCLES, bad_rest, stop_travel
from compensation.online.online import ROUNDING
from compensation.online.point_ring import PointRing, PointsFailed
from config.arrays import BoolArray, FloatArray
from config.cell.cell import CellConfig
from config.errors import ConfigError, PreflightError, RidDaqError
from config.robot.robot import RobotDescription
from dynamics.geometry.clearances import Clearances

PAUSE_S: Final = 0.001


class PointGate:
    """Check of points for collisions, and of the stops that can begin at them.

    The speed at a point is that from the point before it.

    Args:
        cell: Surroundings, cycle time and decelerations of a quick stop.
        robot: Robot with its limits and bodies.
    """

    def __init__(self, cell: CellConfig, robot: RobotDescription) -> None:
        self._cell = cell
        self._robot = robot
        self._clearances = Clearances.of(robot, cell.workspace)
        limits = [joint.limits for joint in robot.joints]
        self._low = np.array([each.position_min for each in limits])
        self._high = np.array([each.position_max for each in limits])
        self._speed = (1.0 + ROUNDING) * np.array([each.velocity for each in limits])
        self._first: FloatArray | None = None
        self._last: FloatArray | None = None

    def check(self, points: FloatArray) -> None:
        """Refuse points at which two bodies come too close, or a stop ends where it must not.

        Points from the first non-finite one on are not checked. Bodies may stay as close as they
        are at the first point of the path.

        Raises:
            PreflightError: Two bodies come too close, or a stop would end beyond a limit or with
                two bodies in contact; the message names them.
        """
        points = points[: _rows_until_not(np.isfinite(points))]
        if len(points) == 0:
            return
        if self._first is None or self._last is None:
            self._first = self._last = points[:1].copy()
        step_s = self._cell.cycle_time_s
        # Bodies that are too close at the first point of the path may stay as close in every batch.
        rows = np.concatenate([self._first, points])
        refuse_collision(self._clearances, rows, step_s, "the path")
        velocity = np.diff(points, axis=0, prepend=self._last) / step_s
        # `path_kernels` refuses points beyond these limits, and names their number.
        inside = (self._low <= points) & (points <= self._high) & (np.abs(velocity) <= self._speed)
        brief = slice(_rows_until_not(inside))
        delay_s = ORDERED_STOP_CYCLES * step_s
        travel = stop_travel(velocity[brief], self._cell, self._robot, delay_s)
        found = bad_rest(points[brief] + travel, self._cell, self._robot, self._clearances)
        if found is not None:
            row, text = found
            pose = ", ".join(f"{value:.4g}" for value in points[row])
            raise PreflightError(
                f"a stop at the point {pose} of the path would end with {text}",
                code="RID-MOTION-STOP",
            )
        self._last = points[-1:].copy()


def _rows_until_not(good: BoolArray) -> int:
    """Return the number of rows before the first with an element that is False."""
    bad = np.flatnonzero(~good.all(axis=1))
    return int(bad[0]) if len(bad) else len(good)


def feed(
    ring: PointRing,
    gate: PointGate,
    batches: Iterable[FloatArray],
    given_up: Callable[[], bool] = lambda: False,
) -> None:
    """Write all batches of points, shape (any, joints), to a ring, and announce the end.

    Blocks while the ring is full. Errors are reported through the ring: the robot then stops on the
    points that have arrived.

    Args:
        gate: Check of the points.
        batches: One point, shape (joints,), or several, shape (any, joints).
        given_up: Function that returns True to end early.
    """
    try:
        for batch in batches:
            points = np.atleast_2d(np.asarray(batch, dtype=np.float64))
            if points.ndim != 2 or points.shape[1] != ring.joints:
                ring.fail(
                    PointsFailed.REFUSED,
                    f"points have the shape {np.shape(batch)}; each point needs {ring.joints}"
                    " joint positions",
                )
                return
            for first in range(0, len(points), ROWS_AT_ONCE):
                if not _write_points(ring, gate, points[first : first + ROWS_AT_ONCE], given_up):
                    return
    except PreflightError as error:
        ring.fail(PointsFailed.REFUSED, str(error))
    except RidDaqError as error:
        ring.fail(PointsFailed.LOST, str(error))
    except Exception as error:
        ring.fail(PointsFailed.LOST, f"the source of the points failed: {error!r}")
        raise
    else:
        ring.end()


def _write_points(
    ring: PointRing, gate: PointGate, points: FloatArray, given_up: Callable[[], bool]
) -> bool:
    gate.check(points)
    sent = ring.write(points)
    while sent < len(points):
        if given_up() or ring.concluded:
            return False
        time.sleep(PAUSE_S)
        sent += ring.write(points[sent:])
    return True


class PointFeed:
    """Thread that feeds a ring from an iterator; a context manager.

    Args:
        ring, gate, batches: As for `feed`.
    """

    def __init__(self, ring: PointRing, gate: PointGate, batches: Iterable[FloatArray]) -> None:
        self._ring = ring
        self._error: Exception | None = None
        self._thread = threading.Thread(
            target=self._run, args=(gate, batches), name="rid-daq points", daemon=True
        )

    def _run(self, gate: PointGate, batches: Iterable[FloatArray]) -> None:
        try:
            feed(self._ring, gate, batches)
        except Exception as error:  # the user's own iterator: its error is reported at the end
            self._error = error

    def __enter__(self) -> PointFeed:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ring.conclude("the motion is over")
        self._thread.join(10.0 * PAUSE_S)

    def wait(self, points: int, patience_s: float) -> None:
        """Wait until this many points have arrived, no more will arrive, or the time is over.

        Raises:
            ConfigError: The iterator failed before the first point.
        """
        wait_for_points(self._ring, points, patience_s)
        if self._error is not None and self._ring.written == 0:
            raise ConfigError(
                f"no points: {self._ring.failure}", code="RID-STREAM-POINTS"
            ) from self._error


def wait_for_points(
    ring: PointRing,
    points: int,
    patience_s: float,
    given_up: Callable[[], bool] = lambda: False,
) -> bool:
    """Wait until `points` have arrived or no more will arrive; return False after `patience_s`."""
    until_s = time.monotonic() + patience_s
    while ring.written < points and not ring.closed:
        if given_up() or time.monotonic() > until_s:
            return False
        time.sleep(PAUSE_S)
    return True
