"""Elastic chapter of the demo: a circle whose deflection of the gears is corrected."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.motion.kinds.circle import CircleMotion
from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.motion_file import AnyMotion
from acquisition.runs.folder import RunFolder
from acquisition.tracker.tracker_file import read_tracked_point
from compensation.compensated_motion import compensated_motion
from compensation.feedforward.file import FeedforwardOrigin, feedforward_bytes
from compensation.feedforward.motor_reference import motor_reference
from compensation.feedforward.tool_side import tool_side_error
from compensation.loops.frequency_response import frequency_responses
from compensation.loops.velocity_loop import fit_velocity_loop, in_order
from config.load import LoadedCell, load_cell
from dynamics.geometry.kinematics import Chain
from identification.elasticity.elastic_fit import fit_elastic
from identification.estimation.estimate import Estimate
from identification.estimation.file import write_estimate
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from rid_daq.demo.demo_paths import PathMotions, PathRecorder
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.report.elastic_path_entry import ElasticPathSection, ElasticRun
from rid_daq.report.sections.runs import RunSection
from rid_daq.report.tool_error_entries import ToolDeflection
from rid_daq.runs.followed_motion import deflection_of_run, motor_lead, path_error_of_run
from rid_daq.runs.motion_runs import read_motion_run
from rid_daq.runs.run_data import FEEDFORWARD

ELASTIC_CELL: Final = "ir361_elastic"
MODEL: Final = "model_of_links.json"
PERIODS: Final = 2
DIGITS: Final = 8
TERMS: Final = ("coulomb", "viscous", "presliding")


@dataclass(frozen=True)
class ElasticMotions:
    """Motions of the chapter: an excitation, multisines, and a circle."""

    excitation: FourierMotion
    multisine: MultisineMotion
    circle: CircleMotion

    @classmethod
    def of_paths(cls, excitation: FourierMotion, paths: PathMotions) -> ElasticMotions:
        """Return the motions of the demo's arm with fewer periods."""
        return cls(
            excitation=excitation.model_copy(update={"periods": PERIODS}),
            multisine=paths.multisine.model_copy(update={"realisations": 1}),
            circle=paths.circle.model_copy(update={"periods": 1}),
        )


@dataclass(frozen=True)
class ElasticChapter:
    """Result section of the chapter, and its runs."""

    section: ElasticPathSection
    runs: tuple[RunSection, ...]
    run_ids: tuple[str, ...]


def elastic_cell() -> LoadedCell:
    """Return the cell of the chapter: its robot file has the stiffness of the simulated gears."""
    loaded = load_cell(ELASTIC_CELL)
    plant = loaded.plant
    assert plant is not None
    assert plant.unmodelled is not None
    joints = tuple(
        joint.model_copy(
            update={
                "stiffness_nm_rad": gear.joint_stiffness_nm_rad,
                "damping_nm_s": gear.joint_damping_nm_s,
                "motor_inertia_kg_m2": axis.rotor_inertia_kg_m2 * joint.gear_ratio**2,
            }
        )
        for joint, axis, gear in zip(
            loaded.robot.joints, plant.axes, plant.unmodelled.axes, strict=True
        )
    )
    return replace(loaded, robot=loaded.robot.model_copy(update={"joints": joints}))


def run_elastic_chapter(
    recorder: Callable[[Path | None], AbstractContextManager[PathRecorder]],
    motions: ElasticMotions,
    loaded: LoadedCell,
    root: RunFolder,
) -> ElasticChapter:
    """Identify an arm with elastic gears, and follow a circle with and without correction.

    Args:
        recorder: Function that opens the simulated cell, and returns a function that records a
            motion. A laser tracker writes its measurements into the given file.
        motions: Motions of the chapter.
        loaded: Result of `elastic_cell`.
        root: Folder for the model and the tracker's files.

    Raises:
        RidDaqError: A step failed; the message names it.
    """
    robot, cell = loaded.robot, loaded.config
    with recorder(None) as record:
        excited = record("elastic-excitation", motions.excitation)
        shaken = record("elastic-multisine", motions.multisine)
    options = EstimationOptions(model=ModelOptions(friction_terms=TERMS))
    model = fit_elastic(robot, [excited.measured.average], options).estimate(cell.name)
    write_estimate(root.path / MODEL, model)
    responses = frequency_responses(shaken.measured.recording, motions.multisine, robot)
    fitted = [fit_velocity_loop(response) for response in responses]
    loops = in_order(robot.joint_names, model.robot.joint_names, fitted)
    planned = motions.circle.plan(robot, cell.cycle_time_s).whole()
    reference = motor_reference(planned, model, robot)
    runs: list[tuple[str, AnyMotion, RecordedRun]] = [
        ("Excitation", motions.excitation, excited),
        ("Multisine", motions.multisine, shaken),
    ]
    elastic = []
    for name, motors in (("rigid", None), ("corrected", reference)):
        ahead = compensated_motion(planned, model, loops, reference=motors)
        bent = None if motors is None else motors.deflection
        file = feedforward_bytes(motions.circle, ahead, FeedforwardOrigin(), bent)
        tracked = root.path / f"tracker-{name}.csv"
        with recorder(tracked) as record:
            run = record(f"elastic-{name}", motions.circle, ahead, {FEEDFORWARD: file})
        runs.append((f"Circle, {name}", motions.circle, run))
        elastic.append(_tool_errors(run, tracked, model))
    largest = np.abs(reference.deflection).max(axis=0)
    return ElasticChapter(
        section=ElasticPathSection(
            sentence=motions.circle.describe(),
            largest_deflection=tuple(largest.tolist()),
            rigid=elastic[0],
            corrected=elastic[1],
        ),
        runs=tuple(
            RunSection.of(f"{role}, elastic gears", motion.describe(), run.measured.tally, robot)
            for role, motion, run in runs
        ),
        run_ids=tuple(run.folder.run_id for _, _, run in runs),
    )


def _tool_errors(run: RecordedRun, tracked: Path, model: Estimate) -> ElasticRun:
    """Return the errors of a run at the tool, estimated and measured by the tracker."""
    one = read_motion_run(run.folder)
    chain = Chain.from_description(one.data.robot)
    lead = motor_lead(one.data, one.file)
    error = tool_side_error(chain, one.data.recording, read_tracked_point(tracked), lead)
    bent = deflection_of_run(one.data, model.robot, model, one.file)
    assert bent is not None
    return ElasticRun(
        estimated=ToolDeflection.of(bent),
        # The tracker's clock begins with the process: its last digits differ between executions.
        measured_mean_m=round(error.mean_m, DIGITS),
        measured_max_m=round(error.max_m, DIGITS),
        motor_mean_m=path_error_of_run(one.data, one.file).mean_m,
    )
