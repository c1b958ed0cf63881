"""The demo's story on one simulated robot: record, average, identify, validate, compensate."""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from pydantic import JsonValue

from acquisition.journal.cycles import read_journal
from acquisition.motion.plan import plan_motion
from acquisition.motion.samples import MotionSamples
from acquisition.processing.periods import average_periods
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from acquisition.session.record import RecordOutcome, record_motion
from acquisition.task.control_block import Progress, TaskState
from config.cell.cell import CellConfig
from config.errors import ConfigError, RecordingError, SafetyStop
from config.load import LoadedCell, load_cell, to_yaml
from config.motion.motion import AnyMotion, FourierMotion, MultipointMotion
from config.robot.robot import RobotDescription
from identification.estimation.estimators import estimate_periodic
from identification.estimation.file import write_estimate
from identification.validation.torque_prediction import validate
from mock_hw.cell import SimulatedCell
from rid_daq.demo.demo_paths import PathMotions, Recorded, tell_paths
from rid_daq.jobs.truth import true_parameters
from rid_daq.report.curves import period_curves, torque_curves, validation_section
from rid_daq.report.sections import (
    average_section,
    estimate_section,
    loop_section,
    motion_sentence,
    run_section,
)
from rid_daq.session.session import hold_cell
from rid_daq.session.versions import software_versions

DEMO_CELL = "ir361"

Show = Callable[[float, str], None]
"""Called with the seconds of motion that are done, and a word on what is being done."""


@dataclass(frozen=True)
class Motions:
    """What the robot does: the excitation, the motion that the model is judged by, and paths."""

    excitation: FourierMotion
    validation: MultipointMotion
    paths: PathMotions | None


def tell_story(
    folder: RunFolder, motions: Motions, seed: int, unmodelled: bool, show: Show
) -> dict[str, Any]:
    """Run the story on one simulated robot; return the sections of its result.

    Parameters
    ----------
    folder
        The demo's run folder; the two runs become folders below it.
    motions
        What is run.
    seed
        Of the simulation.
    unmodelled
        Whether the robot has the effects that no model has.
    show
        Told how far the story is.

    Raises
    ------
    RidDaqError
        A step failed; the message says which.
    """
    loaded = load_cell(DEMO_CELL)
    robot, cell, plant = loaded.robot, loaded.config, loaded.plant
    if plant is None:
        raise ConfigError(f"cell {cell.name}: names no plant, so nothing can be simulated")
    with (
        SimulatedCell(
            cell,
            robot,
            plant,
            realtime=False,
            seed=seed,
            unmodelled=unmodelled,
            profile=loaded.amplifier_profile,
        ) as simulated,
        hold_cell(simulated.cell),
    ):
        tell = _Recorder(folder, loaded, simulated.cell, unmodelled, show)
        excited = tell.record("excitation", motions.excitation)
        validated = tell.record("validation", motions.validation)
        show(tell.done_s, "identifying")
        average = average_periods(excited.recording)
        estimate = estimate_periodic(robot, [average], cell_name=cell.name)
        write_estimate(folder.path / f"model_{_name(unmodelled)}.json", estimate)
        chapter: dict[str, Any] = {"runs": [], "run_ids": []}
        if unmodelled and motions.paths is not None:
            chapter = tell_paths(tell.record, motions.paths, robot, cell, estimate, folder)
    truth = estimate.base.from_standard(true_parameters(estimate.model, robot, plant))
    noise_nm = np.sqrt(average.torque_variance)
    validation = validate(estimate, validated.recording, noise_nm=noise_nm)
    floor = validate(replace(estimate, values=truth), validated.recording)
    return {
        "runs": [
            run_section(role, motion_sentence(motion), run.recording, robot)
            for role, motion, run in (
                ("Excitation", motions.excitation, excited),
                ("Validation", motions.validation, validated),
            )
        ]
        + chapter["runs"],
        **({"tracking": chapter["tracking"]} if "tracking" in chapter else {}),
        "average": average_section(average, robot),
        "estimate": estimate_section(estimate, truth),
        "validation": validation_section(
            validation,
            robot,
            f"{motions.validation.points} random points, not used for the estimate.",
            floor.rms_nm,
        ),
        "curves": {
            "spectrum": period_curves(estimate, average)["spectrum"],
            "torque": torque_curves(validation, robot),
        },
        "loops": [
            loop_section(role, run.outcome.statistics)
            for role, run in (("Excitation", excited), ("Validation", validated))
        ],
        "run_ids": [excited.folder.run_id, validated.folder.run_id, *chapter["run_ids"]],
    }


class _Recorder:
    """Records motions one after the other on one simulated cell."""

    def __init__(
        self, folder: RunFolder, loaded: LoadedCell, cell: CellConfig, unmodelled: bool, show: Show
    ) -> None:
        self._root = folder.path / _name(unmodelled)
        self._loaded = loaded
        self._cell = cell
        self._show = show
        self.done_s = 0.0

    def record(
        self,
        role: str,
        motion: AnyMotion,
        planned: MotionSamples | None = None,
        files: Mapping[str, bytes] | None = None,
    ) -> Recorded:
        """Record one motion into a run folder of its own, as planned where that is given.

        Raises
        ------
        SafetyStop
            It did not come to its end.
        """
        robot = self._loaded.robot
        samples = planned or plan_motion(motion, robot, self._cell.cycle_time_s)
        folder = RunFolder.create(self._root, role, software=software_versions())
        for name, content in self._loaded.files.items():
            folder.write(name, content)
        folder.write("motion.yaml", to_yaml(motion).encode())
        for name, content in (files or {}).items():
            folder.write(name, content)
        outcome = self._run(robot, samples, folder, role)
        facts: dict[str, JsonValue] = {"robot": robot.name, "rows": outcome.rows}
        if outcome.stop is not None:
            with contextlib.suppress(RecordingError):  # of a disk that may be why it was stopped
                folder.finish(RunStatus.STOPPED, facts)
            why = "; ".join((outcome.stop.text, *outcome.notes))
            raise SafetyStop(f"the demo's {role} was stopped: {why}")
        folder.finish(RunStatus.COMPLETE, facts)
        self.done_s += samples.duration_s
        return Recorded(folder, outcome, read_journal(outcome.path).recording())

    def _run(
        self, robot: RobotDescription, samples: MotionSamples, folder: RunFolder, role: str
    ) -> RecordOutcome:
        shown_s = 0.0

        def on_progress(progress: Progress) -> None:
            nonlocal shown_s
            now_s = time.monotonic()
            if progress.state is TaskState.MOVING and now_s - shown_s > 0.2:
                shown_s = now_s
                into_s = max(0, progress.sample_index) * samples.sample_period_s
                self._show(self.done_s + into_s, role)

        return record_motion(self._cell, robot, samples, folder, on_progress=on_progress)


def _name(unmodelled: bool) -> str:
    return "with_unmodelled" if unmodelled else "without_unmodelled"
