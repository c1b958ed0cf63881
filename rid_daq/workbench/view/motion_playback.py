"""`MotionPlayback`: poses of a motion before it is executed, and its clearances."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

import numpy as np

from acquisition.motion.approach import approach
from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.samples import Phase
from config.arrays import FloatArray, IntArray
from config.errors import ConfigError
from config.load import LoadedCell
from dynamics.geometry.clearances import Clearances
from dynamics.geometry.closest_approach import closest_approaches
from dynamics.geometry.kinematics import Chain, forward
from rid_daq.workbench.view.playback_rows import choose_rows, largest_deviations
from rid_daq.workbench.view.resting_pose import RestingPose

INTERVALS: Final = 600
"""Largest number of equal intervals in which clearances are shown."""
MOST_POSES: Final = 6000
ANGLE_RAD: Final = np.radians(0.5)
LENGTH_M: Final = 1e-3
PATH_M: Final = 5e-3
"""Permitted deviation of the drawn path from the path of the tool point."""

ROWS_AT_ONCE: Final = 10_000
"""Samples whose kinematics are computed together; this limits the memory."""

_PHASES: Final = {
    Phase.APPROACH: "approach",
    Phase.RUN_IN: "run-in",
    Phase.TRANSIENT: "transient",
    Phase.MAIN: "main part",
    Phase.RUN_OUT: "run-out",
    Phase.HOLD: "hold",
}


@dataclass(frozen=True, eq=False)
class MotionClearance:
    """Smallest distances between two solids that must stay apart, over all samples of a motion.

    Attributes:
        times_s: Shape (intervals + 1,). Ends of the intervals since the motion's start.
        distance_m: Shape (intervals,). Smallest distance in each interval.
        pairs: The two nearest solids, for each interval.
        least_at_s: Time of the smallest distance since the motion's start.
        margin_m: Smallest allowed distance.
    """

    times_s: FloatArray
    distance_m: FloatArray
    pairs: tuple[str, ...]
    least_at_s: float
    margin_m: float

    def document(self) -> dict[str, object]:
        """Return the clearances for a page."""
        return {
            "times_s": self.times_s.round(6).tolist(),
            "distance_m": self.distance_m.round(4).tolist(),
            "pairs": list(self.pairs),
            "least_at_s": round(self.least_at_s, 6),
            "margin_m": self.margin_m,
        }


@dataclass(frozen=True, eq=False)
class MotionPlayback:
    """Poses of a motion, with straight lines between them; a periodic motion has one period.

    Attributes:
        times_s: Shape (poses,). Times since the motion's start; negative in the approach.
        position: Shape (poses, joints). Positions [rad or m].
        path_m: Shape (poses, 3). The tool point in the base frame.
        phases: Parts of the motion: start time and name.
        deviation_rad: Largest difference of a revolute joint from the straight lines, in any
            sample of the motion [rad].
        deviation_m: Largest difference of a prismatic joint from the straight lines [m].
        clearance: The clearances; None if the robot file has no bodies, or no distance is required
            between any of them.
        periods: Number of periods of the whole motion; 0 if it is not periodic.
        start: Pose from which the robot approaches the motion.
        no_approach: Reason why there is no approach; empty if there is one.
    """

    times_s: FloatArray
    position: FloatArray
    path_m: FloatArray
    phases: tuple[tuple[float, str], ...]
    deviation_rad: float
    deviation_m: float
    clearance: MotionClearance | None
    periods: int
    start: RestingPose
    no_approach: str

    def document(self) -> dict[str, object]:
        """Return the motion for a page."""
        return {
            "times_s": self.times_s.round(6).tolist(),
            "position": self.position.round(5).tolist(),
            "path_m": self.path_m.round(4).tolist(),
            "phases": [{"start_s": round(start, 6), "name": name} for start, name in self.phases],
            "deviation_rad": self.deviation_rad,
            "deviation_m": self.deviation_m,
            "is_accurate": self.deviation_rad <= ANGLE_RAD and self.deviation_m <= LENGTH_M,
            "clearance": None if self.clearance is None else self.clearance.document(),
            "periods": self.periods,
            "approach": {
                "source": self.start.source,
                "at_s": self.start.at_s,
                "problem": self.no_approach,
            },
        }


def motion_playback(
    cell: LoadedCell, motion: AnyMotion, start: RestingPose, most_poses: int = MOST_POSES
) -> MotionPlayback:
    """Return a motion for playback, with the approach from the robot's present pose.

    Every sample of the motion is within `ANGLE_RAD` or `LENGTH_M` of the straight lines between the
    poses, and within `PATH_M` of the path, unless this needs more than `most_poses`.

    Args:
        cell: The cell that will execute the motion.
        motion: The motion.
        start: The newest known pose of the robot.
        most_poses: Largest number of poses.

    Raises:
        ConfigError, LimitError: The motion cannot be planned, or exceeds a limit.
    """
    period_s = cell.config.cycle_time_s
    planned = motion.plan(cell.robot, period_s)
    samples = planned.whole(1)
    way, no_approach = _approach(cell, start, samples.position[0])
    position = np.concatenate([way, samples.position])
    last = len(position) - 1
    times_s: FloatArray = np.arange(-len(way), len(samples.position), dtype=np.float64) * period_s
    edges = np.unique(np.linspace(0, last, min(last, INTERVALS) + 1).round().astype(np.intp))
    clearance, nearest = _clearance(cell, position, edges, times_s)
    chain = Chain.from_description(cell.robot)
    parts = np.array_split(position, math.ceil(len(position) / ROWS_AT_ONCE))
    tool = np.concatenate([forward(chain, part) for part in parts])
    permitted = np.where(chain.prismatic, LENGTH_M, ANGLE_RAD)
    track = np.hstack([position / permitted, tool / PATH_M])
    kept = np.unique([*edges, *nearest, len(way)])
    rows = choose_rows(track, kept, most_poses)
    deviation = largest_deviations(position, rows)
    phase = np.concatenate([np.full(len(way), Phase.APPROACH), samples.phase])
    firsts = np.flatnonzero(np.diff(phase, prepend=-1))
    return MotionPlayback(
        times_s=times_s[rows],
        position=position[rows],
        path_m=tool[rows],
        phases=tuple((float(times_s[row]), _PHASES[Phase(phase[row])]) for row in firsts),
        deviation_rad=float(deviation[~chain.prismatic].max(initial=0.0)),
        deviation_m=float(deviation[chain.prismatic].max(initial=0.0)),
        clearance=clearance,
        periods=planned.periods,
        start=start,
        no_approach=no_approach,
    )


def _approach(cell: LoadedCell, start: RestingPose, end: FloatArray) -> tuple[FloatArray, str]:
    """Return the rows of an approach without its end, (rows, n), and the reason without one."""
    none = np.zeros((0, len(end)))
    if start.position is None:
        return none, "no pose of the robot is known: check the cell"
    try:
        way = approach(np.array(start.position), end, cell.robot, cell.config.cycle_time_s)
    except ConfigError as error:
        return none, str(error)
    return way.position[:-1], ""


def _clearance(
    cell: LoadedCell, position: FloatArray, edges: IntArray, times_s: FloatArray
) -> tuple[MotionClearance | None, tuple[int, ...]]:
    """Return the clearances, and the sample with the smallest clearance."""
    clearances = Clearances.of(cell.robot, cell.config.workspace)
    if not cell.robot.bodies or len(clearances) == 0:
        return None, ()
    found = closest_approaches(clearances, position, edges)
    nearest = int(found.row[found.distance_m.argmin()])
    clearance = MotionClearance(
        times_s=times_s[edges],
        distance_m=found.distance_m,
        pairs=tuple(clearances.names[pair] for pair in found.pair),
        least_at_s=float(times_s[nearest]),
        margin_m=clearances.margin_m,
    )
    return clearance, (nearest,)
