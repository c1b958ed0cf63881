"""`measure_friction`: friction curves and models, from runs that measure friction alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion
from acquisition.motion.kinds.reversed import ReversedMotion
from acquisition.motion.motion_file import load_motion
from acquisition.runs.catalogue import find_runs
from acquisition.runs.folder import RunFolder
from config.errors import ConfigError
from identification.friction.curve import FrictionCurve, join_curves
from identification.friction.experiments import constant_velocity_curves, reversed_curves
from identification.friction.fits import fit_friction
from identification.validation.estimated_friction import EstimatedFriction
from rid_daq.operations.cell_files import read_estimate_for
from rid_daq.operations.identify.friction import FrictionRequest
from rid_daq.report.sections.friction import ComparedFriction, FrictionSection
from rid_daq.report_page.write import write_result
from rid_daq.runs.run_data import RunData, data_defects, result_of


@dataclass(frozen=True)
class FrictionMeasurement:
    """Friction that was measured.

    Attributes:
        run_id: Id of the first run.
        section: Section of the report.
        report: Path of the first run's report.
        notes: Defects of the runs' data.
    """

    run_id: str
    section: FrictionSection
    report: Path
    notes: list[str]


def measure_friction(request: FrictionRequest) -> FrictionMeasurement:
    """Measure the friction of each joint, and fit models to it.

    Raises:
        ConfigError: The runs are of several robots, or of motions that do not measure friction, or
            a run is compared with itself.
        RidDaqError: A run cannot be used.
    """
    folders = find_runs(request.runs, request.run)
    others = find_runs(request.runs, request.against) if request.against else ()
    _refuse_repeated(folders, others)
    data = [RunData.load(each, unfinished=request.unfinished) for each in (*folders, *others)]
    notes = data_defects(data)
    first = data[0]
    curves: dict[str, list[FrictionCurve]] = {}
    beside: dict[str, list[ComparedFriction]] = {}
    for number, one in enumerate(data):
        if first.robot.differences(one.robot):
            raise ConfigError(
                f"{one.folder.path} is of robot {one.robot.name!r}, but {first.folder.path} is of"
                f" {first.robot.name!r}: give runs of one robot",
                code="RID-ROBOT-OTHER",
            )
        for curve in _friction_curves(one):
            if number < len(folders):
                curves.setdefault(curve.joint, []).append(curve)
            elif curve.joint in curves:
                own = join_curves(curves[curve.joint])
                label = one.folder.manifest().label
                beside.setdefault(curve.joint, []).append(ComparedFriction.of(label, curve, own))
    whole = [join_curves(curves[name]) for name in first.robot.joint_names if name in curves]
    model = request.model
    compared = None
    if model is not None:
        compared = EstimatedFriction(read_estimate_for(model, first.robot, despite_misfit=True))
    fits = [fit_friction(curve, first.robot) for curve in whole]
    section = FrictionSection.of(whole, fits, first.robot, compared, beside)
    report = write_result(first.folder, result_of(first, notes).with_sections(friction=section))
    return FrictionMeasurement(first.folder.run_id, section, report, notes)


def _refuse_repeated(folders: tuple[RunFolder, ...], others: tuple[RunFolder, ...]) -> None:
    ids = {folder.run_id for folder in folders}
    for other in others:
        if other.run_id in ids:
            raise ConfigError(
                f"--against {other.path}: this run is compared with itself; give another run",
                code="RID-OPTION-NO-EFFECT",
            )


def _friction_curves(data: RunData) -> tuple[FrictionCurve, ...]:
    file = data.folder.file("motion.yaml")
    motion = load_motion(file) if file.exists() else None
    match motion:
        case ConstantVelocityMotion():
            return constant_velocity_curves(data.recording, motion, data.robot)
        case ReversedMotion():
            return reversed_curves(data.recording, motion, data.robot)
        case None:
            kind = "a recording of an unknown motion"
        case _:
            kind = f"a recording of a motion of kind {motion.kind}"
    raise ConfigError(
        f"{data.folder.path} is {kind}; a friction measurement needs constant speeds, or a path"
        " that is driven forward and backward: design one with `rid-daq design CELL --kind"
        " constant-velocity -o MOTION` (or `--kind reversed`) and record it",
        code="RID-FRICTION-RUNS",
    )
