"""`rid-daq friction`: friction alone, out of the runs that were made to measure it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

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
from rid_daq.report.friction_section import friction_section
from rid_daq.report.render import number
from rid_daq.report.result import write_result
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
    section = friction_section(
        whole,
        [fit_friction(curve, first.robot) for curve in whole],
        first.robot,
        None if model is None else read_estimate(model),
    )
    result = result_of(first, notes) | {"friction": section}
    path = write_result(first.folder, result)
    console.document(
        {
            "run": first.folder.run_id,
            "friction": section,
            "notes": notes,
            "report": str(path),
        }
    )
    _tell(console, section)
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


def _tell(console: Console, section: dict[str, Any]) -> None:
    console.say(section["sentence"])
    for joint in section["joints"]:
        curve, torque = joint["curve"], joint["torque_unit"]
        ways = curve["forward"] is not None
        console.say()
        console.table(
            (
                joint["joint"],
                "friction",
                "± 2σ",
                *(("forwards", "backwards", "± 2σ") if ways else ()),
            ),
            [
                (
                    f"{number(speed, 3)} {joint['unit']}/s",
                    f"{number(curve['odd'][i])} {torque}",
                    number(2.0 * curve["odd_std"][i], 2),
                    *(_directions(curve, i) if ways else ()),
                )
                for i, speed in enumerate(curve["speed"])
            ],
        )
        console.table(
            ("model", "rms error", "criterion", "coefficients ± 2σ"),
            [
                (
                    fit["name"],
                    f"{number(fit['rms'], 3)} {torque}",
                    number(fit["criterion"], 3),
                    ", ".join(_coefficient(p) for p in fit["parameters"]),
                )
                for fit in joint["fits"]
            ],
        )
        console.verdict(None, joint["sentence"])


def _directions(curve: dict[str, Any], i: int) -> tuple[str, str, str]:
    return (
        number(curve["forward"][i]),
        number(curve["backward"][i]),
        number(2.0 * curve["direction_std"][i], 2),
    )


def _coefficient(p: dict[str, Any]) -> str:
    return f"{p['name']} {number(p['value'])} ± {number(2.0 * p['std'], 2)} {p['unit']}"
