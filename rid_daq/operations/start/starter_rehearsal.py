"""The rehearsal of a cell that `init --urdf` is about to write: checked, and moved a little."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from acquisition.runs.folder import RunFolder
from acquisition.session.outcome import RecordOutcome
from acquisition.session.record import record_motion
from config.errors import RecordingError, RidDaqError, system_errors
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell
from config.robot.urdf_robot import UrdfRobot
from identification.design.criteria import DOptimal
from identification.design.search import refine_start
from identification.design.task import excitation_problem
from rid_daq.operations.start.urdf_starter import slower_robot, starting_files
from rid_daq.preflight.last_pose import PoseRule
from rid_daq.preflight.preflight import lines_before_bus, preflight
from rid_daq.session.cells import mountable_cell
from rid_daq.terminal.exit_codes import exit_code_of_stop

PERIOD_S: Final = 5.0
HARMONICS: Final = 3
ITERATIONS: Final = 20
CHECK_S: Final = 0.5
TRIES: Final = 3
SPEED: Final = 0.7
"""Share of its speeds that a cell is tried with again when its motion was stopped."""


@dataclass(frozen=True)
class Rehearsed:
    """A cell to start from, as it was rehearsed.

    Attributes:
        made: The robot, perhaps slower than before, and its notes.
        files: The text of every file by name.
        obstacle: What stands in the way of a motion; empty where the cell ran.
    """

    made: UrdfRobot
    files: dict[str, str]
    obstacle: str


def rehearsed(urdf: Path, made: UrdfRobot) -> Rehearsed:
    """Check the simulated cell of a robot and move it, in simulated time; slower where it stops.

    The motion is a short excitation, designed within every limit. Nothing stays on the disk.

    Raises:
        RecordingError: There is no room for it.
        SystemExit: It was interrupted.
    """
    left = TRIES
    while True:
        left -= 1
        files = starting_files(urdf, made)
        with (
            system_errors(RecordingError, "no folder for the rehearsal", code="RID-FILE-WRITE"),
            tempfile.TemporaryDirectory(prefix="rid-daq-") as folder,
        ):
            for name, text in files.items():
                write_whole(Path(folder) / name, text.encode())
            try:
                outcome = _run(load_cell(str(Path(folder) / "cell.yaml")), Path(folder))
            except RidDaqError as error:
                return Rehearsed(made, files, str(error))
        if outcome.stop is None:
            return Rehearsed(made, files, "")
        if outcome.interrupted_by is not None:
            raise SystemExit(exit_code_of_stop(outcome.stop.code, outcome.interrupted_by))
        if left == 0:
            return Rehearsed(made, files, outcome.stop.text)
        made = slower_robot(made, SPEED, f"in the rehearsal {outcome.stop.text}")


def _run(loaded: LoadedCell, folder: Path) -> RecordOutcome:
    """Check a cell and move it; raise what stands in the way before it moves."""
    cell, robot = loaded.config, loaded.robot
    problem = excitation_problem(
        cell, robot, period_s=PERIOD_S, harmonics=HARMONICS, criterion=DOptimal()
    )
    found = refine_start(problem, 0, cell.cycle_time_s, iterations=ITERATIONS, periods=1)
    motion = found.motion.model_copy(update={"transient_periods": 0})
    samples = motion.plan(robot, cell.cycle_time_s)
    with mountable_cell(loaded) as (reachable, _):
        lines, failure = preflight(
            loaded,
            reachable,
            lines_before_bus(loaded, folder),
            CHECK_S,
            cleared=True,
            pose=PoseRule.LEFT_OUT,
        )
        if failure is not None:
            raise failure
        for line in lines:
            if line.verdict == "red":
                raise RidDaqError(
                    f"{line.where}, {line.what}: {line.found}. {line.next_action}",
                    code="RID-PREFLIGHT-RED",
                )
        return record_motion(reachable, robot, samples, RunFolder.create(folder, "rehearsal"))
