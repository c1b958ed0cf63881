"""`identify_gears`: stiffness and damping of the gears from runs, with a report."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.motion_file import load_motion
from acquisition.runs.catalogue import find_runs
from acquisition.tracker.link_file import read_link_positions
from acquisition.tracker.tracker_file import read_tracked_point
from config.errors import ConfigError, DataQualityError
from dynamics.geometry.kinematics import Chain
from identification.elasticity.elastic_arm import ElasticArm
from identification.elasticity.elastic_runs import (
    ExcitationBins,
    excitation_bins,
    multisine_bins,
)
from identification.elasticity.gear_estimate import estimate_gears
from rid_daq.operations.calibration.stiffness import StiffnessRequest
from rid_daq.report.sections.gears import GearsSection
from rid_daq.report_page.write import write_result
from rid_daq.runs.run_data import MOTION, RunData, all_defects, result_of


@dataclass(frozen=True)
class IdentifiedGears:
    """Gears that were identified.

    Attributes:
        section: Section of the report of the first excitation run.
        report: Path of the report.
        notes: Defects of the runs' data.
        excitations: Ids of the excitation runs.
    """

    section: GearsSection
    report: Path
    notes: list[str]
    excitations: tuple[str, ...]


def identify_gears(request: StiffnessRequest) -> IdentifiedGears:
    """Identify the gears of a robot and write the report.

    Raises:
        ConfigError: The runs are of several robots, a kind of run is missing, or the files of
            instruments do not fit the number of runs or cannot be read.
        DataQualityError: A run lacks rows, periods or the data of its force plate, or the file of
            an instrument does not fit its run.
        EstimationError: The runs do not determine the arm, or its wrist is coupled.
        RecordingError, LockedError: A run cannot be read, or is still being recorded.
    """
    data = [
        RunData.load(folder, unfinished=request.unfinished)
        for folder in find_runs(request.runs, request.run)
    ]
    robot = data[0].robot
    for other in data[1:]:
        if other.robot.differences(robot):
            raise ConfigError(
                f"run {other.folder.run_id} is of robot {other.robot.name!r} (or of another"
                f" version of its file), but run {data[0].folder.run_id} is of {robot.name!r}: use"
                " runs of one robot",
                code="RID-ROBOT-OTHER",
            )
    motions = [(item, _multisine_of(item)) for item in data]
    multisines = [(item, motion) for item, motion in motions if motion is not None]
    excitations = [item for item, motion in motions if motion is None]
    _require_kinds(excitations, [item for item, _ in multisines], request.plate)
    arm = ElasticArm.of(robot, plate=request.plate)
    large = _with_instruments(
        request,
        excitations,
        [
            excitation_bins(item.folder.run_id, item.average, plate=request.plate)
            for item in excitations
        ],
    )
    small = [
        part
        for item, motion in multisines
        for part in multisine_bins(item.folder.run_id, item.recording, motion, robot, arm)
    ]
    found = estimate_gears(robot, [item.average for item in excitations], large, small, arm)
    section = GearsSection.of(robot, found, tuple(item.folder.run_id for item in data))
    notes = all_defects(data)
    first = excitations[0]
    result = result_of(first, notes).with_sections(title=f"Gears of {robot.name}", gears=section)
    return IdentifiedGears(
        section,
        write_result(first.folder, result),
        notes,
        tuple(item.folder.run_id for item in excitations),
    )


def _with_instruments(
    request: StiffnessRequest, runs: list[RunData], bins: list[ExcitationBins]
) -> list[ExcitationBins]:
    """Return the excitation runs with the data of trackers and encoders on the link side.

    Raises:
        ConfigError: There are more or fewer files than excitation runs, or a file cannot be read.
        DataQualityError: A file does not fit its run.
    """
    chain = Chain.from_description(runs[0].robot)
    if request.point is not None:
        chain = replace(chain, tool_m=np.array(request.point))
    for option, files in (("tracker", request.tracker), ("link-encoders", request.link_encoders)):
        if files and len(files) != len(runs):
            raise ConfigError(
                f"--{option}: {len(files)} files for {len(runs)} excitation runs: give one file for"
                " each excitation run, in the same order",
                code="RID-OPTION-COUNT",
            )
    for number, path in enumerate(request.tracker):
        with _prefix_path(path):
            tracked = read_tracked_point(path)
            bins[number] = bins[number].with_tracker(tracked, runs[number].recording, chain)
    for number, path in enumerate(request.link_encoders):
        with _prefix_path(path):
            links = read_link_positions(path, runs[number].robot)
            bins[number] = bins[number].with_link_encoders(links, runs[number].recording)
    return bins


@contextlib.contextmanager
def _prefix_path(path: Path) -> Iterator[None]:
    """Name a file in front of the errors of its data.

    Raises:
        DataQualityError: As raised in the `with` block.
    """
    try:
        yield
    except DataQualityError as error:
        raise DataQualityError(f"{path}: {error}", code=error.refusal) from None


def _multisine_of(data: RunData) -> MultisineMotion | None:
    """Return the multisine of a run; None if the run is of another motion."""
    path = data.folder.file(MOTION)
    return MultisineMotion.of(load_motion(path)) if path.exists() else None


def _require_kinds(excitations: list[RunData], multisines: list[RunData], plate: bool) -> None:
    """Refuse runs of which one kind is missing or cannot be used.

    Raises:
        ConfigError: There is no excitation run, or no multisine run.
        DataQualityError: A run is not periodic, or lacks the force plate.
    """
    if not excitations or not multisines:
        missing = "a periodic excitation" if multisines else "a multisine"
        have = "multisines" if multisines else "excitations"
        raise ConfigError(
            f"all {len(excitations) + len(multisines)} runs are {have}: the stiffness also needs a"
            f" run of {missing} (`rid-daq design`)",
            code="RID-STIFFNESS-RUNS",
        )
    for item in excitations:
        if not item.is_periodic:
            raise DataQualityError(
                f"run {item.folder.run_id} is not periodic: use a run of `rid-daq design` with at"
                " least 2 periods",
                code="RID-STIFFNESS-RUNS",
            )
        if plate and not item.has_plate:
            raise DataQualityError(
                f"run {item.folder.run_id} has no data of a force plate: leave --plate out",
                code="RID-PLATE-MISSING",
            )
