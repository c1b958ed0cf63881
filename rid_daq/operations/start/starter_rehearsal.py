"""Rehearsal for `init --urdf`: check and move the simulated cell before its files are written."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.approach import approach
from acquisition.motion.collision import rows_before_collision
from acquisition.motion.samples import MotionSamples
from acquisition.runs.folder import RunFolder
from acquisition.session.outcome import RecordOutcome
from acquisition.session.record import MotionContext, record_motion
from config.errors import RecordingError, RidDaqError, system_errors
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell
from config.robot.urdf_robot import UrdfRobot
from dynamics.geometry.clearances import Clearances
from identification.design.criteria import DOptimal
from identification.design.problem import ExcitationProblem
from identification.design.search import refine_start
from identification.design.task import excitation_problem
from rid_daq.operations.start.urdf_starter import slower_robot, starting_files
from rid_daq.preflight.last_pose import PoseRule
from rid_daq.preflight.preflight import lines_before_bus, preflight
from rid_daq.session.cells import hold_reachable_cell
from rid_daq.terminal.exit_codes import exit_code_of_stop

PERIOD_S: Final = 5.0
HARMONICS: Final = 3
ITERATIONS: Final = 20
CHECK_S: Final = 0.5
SEEDS: Final = 6
"""Number of excitations that are designed until one can be approached without collision."""
TRIES: Final = 3
SPEED: Final = 0.7
"""Factor on the speeds for the next try, if the motion was stopped."""


@dataclass(frozen=True)
class RehearsedCell:
    """A starting cell and the outcome of its rehearsal.

    Attributes:
        made: The robot, possibly with lower speeds, and its notes.
        files: Text of every file by name.
        obstacle: Reason why the rehearsal failed; empty if it passed.
    """

    made: UrdfRobot
    files: dict[str, str]
    obstacle: str


def rehearse_cell(urdf: Path, made: UrdfRobot) -> RehearsedCell:
    """Check the simulated cell of a robot and move it in simulated time.

    The motion is a short excitation within all limits. If it is stopped, the rehearsal is repeated
    with lower speeds. All its files are temporary.

    Raises:
        RecordingError: There is no space for the temporary files.
        SystemExit: A signal interrupted the rehearsal.
    """
    left = TRIES
    while True:
        left -= 1
        files = starting_files(urdf, made)
        with (
            system_errors(
                RecordingError,
                "cannot make a temporary folder for the rehearsal",
                code="RID-FILE-WRITE",
            ),
            tempfile.TemporaryDirectory(prefix="rid-daq-") as folder,
        ):
            for name, text in files.items():
                write_whole(Path(folder) / name, text.encode())
            try:
                outcome = _check_and_move(load_cell(str(Path(folder) / "cell.yaml")), Path(folder))
            except RidDaqError as error:
                return RehearsedCell(made, files, str(error))
        if outcome.stop is None:
            return RehearsedCell(made, files, "")
        if outcome.interrupted_by is not None:
            raise SystemExit(exit_code_of_stop(outcome.stop.code, outcome.interrupted_by))
        if left == 0:
            return RehearsedCell(made, files, outcome.stop.text)
        made = slower_robot(made, SPEED, f"the rehearsal was stopped: {outcome.stop.text}")


def _excitation(loaded: LoadedCell, problem: ExcitationProblem) -> MotionSamples:
    """Return a short excitation, if possible one whose approach keeps all bodies apart."""
    cell, robot = loaded.config, loaded.robot
    clearances = Clearances.of(robot, cell.workspace)
    assert loaded.plant is not None
    pose = np.array([axis.initial_position for axis in loaded.plant.axes])
    for seed in range(SEEDS):
        found = refine_start(problem, seed, cell.cycle_time_s, iterations=ITERATIONS, periods=1)
        motion = found.motion.model_copy(update={"transient_periods": 0})
        samples = motion.plan(robot, cell.cycle_time_s)
        way = approach(pose, samples.position[0], robot, cell.cycle_time_s).position
        if not found.check.broken and rows_before_collision(clearances, way) == len(way):
            break
    return samples


def _check_and_move(loaded: LoadedCell, folder: Path) -> RecordOutcome:
    """Check a cell and move it; raise an error if a check before the motion fails."""
    cell, robot = loaded.config, loaded.robot
    problem = excitation_problem(
        cell, robot, period_s=PERIOD_S, harmonics=HARMONICS, criterion=DOptimal()
    )
    samples = _excitation(loaded, problem)
    with hold_reachable_cell(loaded) as (reachable, simulated):
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
        assert simulated is not None
        return record_motion(
            reachable,
            robot,
            samples,
            RunFolder.create(folder, "rehearsal"),
            context=MotionContext(task=simulated.create_master),
        )
