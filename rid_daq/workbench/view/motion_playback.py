"""`MotionPlayback`: poses of a motion before it is executed, and its clearances."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.samples import MotionSamples, Phase
from config.arrays import FloatArray, IntArray
from config.load import LoadedCell
from dynamics.geometry.clearances import Clearances
from dynamics.geometry.closest_approach import closest_approaches
from dynamics.geometry.kinematics import Chain, forward
from rid_daq.operations.cell_files import read_motion_for
from rid_daq.workbench.view.playback_rows import choose_rows, deviations

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
        times_s: Shape (intervals + 1,). Ends of the intervals since the motion's begin.
        distance_m: Shape (intervals,). Smallest distance in each interval.
        pairs: The two nearest solids, for each interval.
        least_at_s: Time of the smallest distance since the motion's begin.
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
        times_s: Shape (poses,). Times since the motion's begin.
        position: Shape (poses, joints). Positions [rad or m].
        path_m: Shape (poses, 3). The tool point in the base frame.
        phases: Parts of the motion: time of the begin and name.
        deviation_rad: Largest difference of a revolute joint from the straight lines, in any
            sample of the motion.
        deviation_m: The same of a prismatic joint.
        clearance: The clearances; None if the robot file has no bodies, because then no distance is
            known.
        periods: Number of periods of the whole motion; 0 if it is not periodic.
    """

    times_s: FloatArray
    position: FloatArray
    path_m: FloatArray
    phases: tuple[tuple[float, str], ...]
    deviation_rad: float
    deviation_m: float
    clearance: MotionClearance | None
    periods: int

    def document(self) -> dict[str, object]:
        """Return the motion for a page."""
        return {
            "times_s": self.times_s.round(6).tolist(),
            "position": self.position.round(5).tolist(),
            "path_m": self.path_m.round(4).tolist(),
            "phases": [{"begin_s": round(begin, 6), "name": name} for begin, name in self.phases],
            "deviation_rad": self.deviation_rad,
            "deviation_m": self.deviation_m,
            "is_accurate": self.deviation_rad <= ANGLE_RAD and self.deviation_m <= LENGTH_M,
            "clearance": None if self.clearance is None else self.clearance.document(),
            "periods": self.periods,
        }


def motion_playback(cell: LoadedCell, path: Path, most_poses: int = MOST_POSES) -> MotionPlayback:
    """Return a motion file for playback.

    Every sample of the motion is within `ANGLE_RAD` or `LENGTH_M` of the straight lines between the
    poses, and within `PATH_M` of the path, unless this needs more than `most_poses`.

    Args:
        cell: The cell that will execute the motion.
        path: The file.
        most_poses: Largest number of poses.

    Raises:
        ConfigError, LimitError: The file is invalid or of another robot, or the motion exceeds a
            limit.
    """
    motion = read_motion_for(path, cell)
    planned = motion.plan(cell.robot, cell.config.cycle_time_s)
    samples = planned.whole(1)
    last = len(samples.position) - 1
    edges = np.unique(np.linspace(0, last, min(last, INTERVALS) + 1).round().astype(np.intp))
    clearance = _clearance(cell, samples, edges)
    kept = edges
    if clearance is not None:
        kept = np.union1d(edges, round(clearance.least_at_s / samples.sample_period_s))
    chain = Chain.from_description(cell.robot)
    parts = np.array_split(samples.position, math.ceil(len(samples.position) / ROWS_AT_ONCE))
    tool = np.concatenate([forward(chain, part) for part in parts])
    permitted = np.where(chain.prismatic, LENGTH_M, ANGLE_RAD)
    track = np.hstack([samples.position / permitted, tool / PATH_M])
    rows = choose_rows(track, kept, most_poses)
    deviation = deviations(samples.position, rows)
    return MotionPlayback(
        times_s=rows * samples.sample_period_s,
        position=samples.position[rows],
        path_m=tool[rows],
        phases=_phases(samples),
        deviation_rad=float(deviation[~chain.prismatic].max(initial=0.0)),
        deviation_m=float(deviation[chain.prismatic].max(initial=0.0)),
        clearance=clearance,
        periods=planned.periods,
    )


def _clearance(cell: LoadedCell, samples: MotionSamples, edges: IntArray) -> MotionClearance | None:
    clearances = Clearances.of(cell.robot, cell.config.workspace)
    if not cell.robot.bodies or len(clearances) == 0:
        return None
    found = closest_approaches(clearances, samples.position, edges)
    return MotionClearance(
        times_s=edges * samples.sample_period_s,
        distance_m=found.distance_m,
        pairs=tuple(clearances.names[pair] for pair in found.pair),
        least_at_s=float(found.row[found.distance_m.argmin()] * samples.sample_period_s),
        margin_m=clearances.margin_m,
    )


def _phases(samples: MotionSamples) -> tuple[tuple[float, str], ...]:
    begins = np.flatnonzero(np.diff(samples.phase, prepend=samples.phase[0] + 1))
    return tuple(
        (float(row * samples.sample_period_s), _PHASES[Phase(samples.phase[row])]) for row in begins
    )
