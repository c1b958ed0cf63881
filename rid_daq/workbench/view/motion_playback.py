"""`MotionPlayback`: poses of a motion before it is executed, with the clearance in each pose."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.samples import Phase
from config.arrays import FloatArray
from config.load import LoadedCell
from dynamics.geometry.clearances import Clearances
from rid_daq.operations.cell_files import read_motion_for

MOST_POSES: Final = 600

_PHASES: Final = {
    Phase.APPROACH: "approach",
    Phase.RUN_IN: "run-in",
    Phase.TRANSIENT: "transient",
    Phase.MAIN: "main part",
    Phase.RUN_OUT: "run-out",
    Phase.HOLD: "hold",
}


@dataclass(frozen=True, eq=False)
class MotionPlayback:
    """Poses of a motion at equal intervals; a periodic motion has one period.

    Attributes:
        times_s: Shape (poses,). Times since the motion's begin.
        position: Shape (poses, joints). Positions [rad or m].
        phases: Part of the motion, for each pose.
        clearance_m: Shape (poses,). Smallest distance between two solids that must stay apart; None
            if the robot file has no bodies, because then no distance is known.
        pairs: The two nearest solids, for each pose; empty without clearances.
        margin_m: Smallest allowed distance.
        periods: Number of periods of the whole motion; 0 if it is not periodic.
    """

    times_s: FloatArray
    position: FloatArray
    phases: tuple[str, ...]
    clearance_m: FloatArray | None
    pairs: tuple[str, ...]
    margin_m: float
    periods: int

    def document(self) -> dict[str, object]:
        """Return the motion for a page."""
        clearance = None if self.clearance_m is None else self.clearance_m.round(4).tolist()
        return {
            "times_s": self.times_s.round(4).tolist(),
            "position": self.position.round(5).tolist(),
            "phases": list(self.phases),
            "clearance_m": clearance,
            "pairs": list(self.pairs),
            "margin_m": self.margin_m,
            "periods": self.periods,
        }


def motion_playback(cell: LoadedCell, path: Path) -> MotionPlayback:
    """Return the poses of a motion file, at most `MOST_POSES`.

    Args:
        cell: The cell that will execute the motion.
        path: The file.

    Raises:
        ConfigError, LimitError: The file is invalid or of another robot, or the motion exceeds a
            limit.
    """
    motion = read_motion_for(path, cell)
    planned = motion.plan(cell.robot, cell.config.cycle_time_s)
    samples = planned.whole(1)
    last = len(samples.position) - 1
    rows = np.unique(np.linspace(0, last, min(last + 1, MOST_POSES)).round().astype(np.intp))
    position = samples.position[rows]
    clearance, pairs = None, ()
    clearances = Clearances.of(cell.robot, cell.config.workspace)
    if cell.robot.bodies and len(clearances):
        distances = np.array([clearances.nearest(pose[np.newaxis]) for pose in position])
        clearance = distances.min(axis=1)
        pairs = tuple(clearances.names[column] for column in distances.argmin(axis=1))
    return MotionPlayback(
        times_s=np.asarray(rows * samples.sample_period_s, dtype=np.float64),
        position=position,
        phases=tuple(_PHASES[Phase(phase)] for phase in samples.phase[rows]),
        clearance_m=clearance,
        pairs=pairs,
        margin_m=clearances.margin_m,
        periods=planned.periods,
    )
