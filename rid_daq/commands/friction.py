"""`rid-daq friction`: friction alone, out of the runs that were made to measure it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion
from acquisition.motion.kinds.reversed import ReversedMotion
from acquisition.motion.motion_file import load_motion
from acquisition.runs.catalogue import find_runs
from config.errors import ConfigError
from identification.estimation.file import read_estimate
from identification.friction.curve import FrictionCurve, joined
from identification.friction.experiments import constant_velocity_curves, reversed_curves
from identification.friction.fits import fit_friction
from identification.validation.estimated_friction import estimated_friction
from rid_daq.report.result_file import write_result
from rid_daq.report.sections.friction import FrictionSection
from rid_daq.runs.run_data import RunData, Unfinished, result_of, tell_lacks
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console


def friction(
    run: Annotated[
        list[str],
        typer.Argument(metavar="RUN...", help="Run folders, ids or labels, or `latest`."),
    ],
    model: Annotated[
        Path | None,
        typer.Option("--model", metavar="MODEL", help="A model file to compare with."),
    ] = None,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Measure friction alone: torque over speed, joint by joint, and the models that fit it.

    RUN is a recording of runs at constant speed, or of a path there and back in time; `rid-daq
    design --kind constant-velocity` or `--kind reversed` makes the motion. Several runs of the same
    robot are taken together.
    """
    console = Console(as_json)
    data = [RunData.load(folder, unfinished=unfinished) for folder in find_runs(runs, run)]
    notes = tell_lacks(console, data)
    first = data[0]
    curves: dict[str, list[FrictionCurve]] = {}
    for one in data:
        if one.robot.joint_names != first.robot.joint_names:
            raise ConfigError(
                f"{one.folder.path}: is of robot {one.robot.name!r},"
                f" {first.folder.path} of {first.robot.name!r}: give runs of one robot"
            )
        for curve in _curves(one):
            curves.setdefault(curve.joint, []).append(curve)
    whole = [joined(curves[name]) for name in first.robot.joint_names if name in curves]
    compared = None if model is None else estimated_friction(read_estimate(model), first.robot)
    fits = [fit_friction(curve, first.robot) for curve in whole]
    section = FrictionSection.of(whole, fits, first.robot, compared)
    path = write_result(first.folder, result_of(first, notes).updated(friction=section))
    console.document(
        {
            "run": first.folder.run_id,
            "friction": section,
            "notes": notes,
            "report": str(path),
        }
    )
    section.print(console)
    console.say(f"Report: {path}")


def _curves(data: RunData) -> tuple[FrictionCurve, ...]:
    """Return the friction in one run."""
    file = data.folder.file("motion.yaml")
    motion = load_motion(file) if file.exists() else None
    if isinstance(motion, ConstantVelocityMotion):
        return constant_velocity_curves(data.recording, motion, data.robot)
    if isinstance(motion, ReversedMotion):
        return reversed_curves(data.recording, motion, data.robot)
    kind = "a recording from elsewhere" if motion is None else f"a motion of kind {motion.kind}"
    raise ConfigError(
        f"{data.folder.path}: is {kind}; friction alone is measured by constant speeds or by a path"
        " there and back: make one with `rid-daq design CELL --kind constant-velocity -o MOTION`"
        " (or `--kind reversed`) and record it"
    )
