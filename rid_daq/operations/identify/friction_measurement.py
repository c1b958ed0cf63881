"""`measure_friction`: friction curves and models of runs that measure friction alone."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion
from acquisition.motion.kinds.reversed import ReversedMotion
from acquisition.motion.motion_file import load_motion
from acquisition.runs.catalogue import find_runs
from config.errors import ConfigError
from identification.friction.curve import FrictionCurve, join_curves
from identification.friction.experiments import constant_velocity_curves, reversed_curves
from identification.friction.fits import fit_friction
from identification.validation.estimated_friction import EstimatedFriction
from rid_daq.operations.cell_files import estimate_for
from rid_daq.operations.identify.friction import FrictionRequest
from rid_daq.report.sections.friction import FrictionSection
from rid_daq.report_page.write import write_result
from rid_daq.runs.run_data import RunData, lacks, result_of


@dataclass(frozen=True)
class FrictionMeasured:
    """Friction that was measured.

    Attributes:
        run_id: The first run.
        section: Its section of a report.
        report: The report of the first run.
        notes: What the runs lack.
    """

    run_id: str
    section: FrictionSection
    report: Path
    notes: list[str]


def measure_friction(request: FrictionRequest) -> FrictionMeasured:
    """Measure friction joint by joint, and fit models to it.

    Raises:
        ConfigError: The runs are of several robots, or of motions that do not measure friction.
        RidDaqError: A run cannot be used.
    """
    folders = find_runs(request.runs, request.run)
    data = [RunData.load(folder, unfinished=request.unfinished) for folder in folders]
    notes = lacks(data)
    first = data[0]
    curves: dict[str, list[FrictionCurve]] = {}
    for one in data:
        if first.robot.differences(one.robot):
            raise ConfigError(
                f"{one.folder.path}: is of robot {one.robot.name!r},"
                f" {first.folder.path} of {first.robot.name!r}: give runs of one robot",
                code="RID-ROBOT-OTHER",
            )
        for curve in _curves(one):
            curves.setdefault(curve.joint, []).append(curve)
    whole = [join_curves(curves[name]) for name in first.robot.joint_names if name in curves]
    model = request.model
    compared = None if model is None else EstimatedFriction(estimate_for(model, first.robot))
    fits = [fit_friction(curve, first.robot) for curve in whole]
    section = FrictionSection.of(whole, fits, first.robot, compared)
    report = write_result(first.folder, result_of(first, notes).updated(friction=section))
    return FrictionMeasured(first.folder.run_id, section, report, notes)


def _curves(data: RunData) -> tuple[FrictionCurve, ...]:
    """Return the friction in one run."""
    file = data.folder.file("motion.yaml")
    motion = load_motion(file) if file.exists() else None
    match motion:
        case ConstantVelocityMotion():
            return constant_velocity_curves(data.recording, motion, data.robot)
        case ReversedMotion():
            return reversed_curves(data.recording, motion, data.robot)
        case None:
            kind = "a recording from elsewhere"
        case _:
            kind = f"a motion of kind {motion.kind}"
    raise ConfigError(
        f"{data.folder.path}: is {kind}; friction alone is measured by constant speeds or by a path"
        " there and back: make one with `rid-daq design CELL --kind constant-velocity -o MOTION`"
        " (or `--kind reversed`) and record it",
        code="RID-FRICTION-RUNS",
    )
