"""What `rid-daq design` does, and says of it."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import NamedTuple

import numpy as np

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.samples import MotionSamples
from config.robot.robot import RobotDescription
from rid_daq.jobs.design_job import Designed, DesignRequest, design_motion
from rid_daq.report.sections.section import units
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output
from rid_daq.terminal.choices import Kind
from rid_daq.terminal.console import Console


class _ShownAxis(NamedTuple):
    """What an axis does in a multisine."""

    joint: str
    unit: str
    lines: int
    rms_velocity: float
    crest_factor: float
    slow_amplitude: float
    velocity_percent: float
    acceleration_percent: float
    torque_percent: float | None


class _UseOfLimits(NamedTuple):
    """How far an axis goes, and how near its limits."""

    joint: str
    unit: str
    position_min: float
    position_max: float
    velocity: float
    velocity_percent: float
    acceleration: float
    acceleration_percent: float


def perform(request: DesignRequest, console: Console, scheduler: str | None = None) -> None:
    """Design, and say what is in the motion file; exit codes as the command has them.

    Parameters
    ----------
    request : DesignRequest
        What is wanted.
    console : Console
        Where it is said.
    scheduler : str, optional
        Address of a Dask scheduler to compute on.
    """
    refuse_output(request.output, request.overwrite, made_file.MOTION)
    designed = design_motion(request, console, scheduler)
    _print(console, designed, request)
    console.next_step("record", request.cell, request.output)
    if request.kind is Kind.MULTISINE:
        console.next_step("loop", "latest", lead="Then")
    if designed.found is not None and designed.found.exit_code:
        raise SystemExit(designed.found.exit_code)


def _print(console: Console, designed: Designed, request: DesignRequest) -> None:
    """Say what is in the motion file."""
    motion, samples, output = designed.motion, designed.samples, request.output
    told = {"motion": str(output), "kind": motion.kind, "duration_s": samples.duration_s}
    said = f"{output}: {motion.describe()} {samples.duration_s:.0f} s in all."
    match motion:
        case FourierMotion():
            _print_excitation(console, designed, motion, output)
        case MultisineMotion():
            axes = _axes(designed, motion)
            band = [motion.lowest_hz, motion.highest_hz]
            console.document(told | {"band_hz": band, "axes": [axis._asdict() for axis in axes]})
            console.say(said)
            _print_multisine(console, axes)
            if not request.multisine.slow:
                console.say("Without the slow sine friction sticks: wrong inertia and margins.")
        case _:
            console.document(told)
            console.say(said)
            table = motion.joint_table()
            if table is not None:
                console.table(*table)


def _axes(designed: Designed, motion: MultisineMotion) -> list[_ShownAxis]:
    """Return what each axis does in a multisine."""
    robot = designed.cell.robot
    assert designed.use is not None
    return [
        _ShownAxis(
            joint=joint.name,
            unit=units(joint)[0],
            lines=len(own),
            rms_velocity=settings.velocity,
            crest_factor=crest,
            slow_amplitude=settings.slow_amplitude,
            velocity_percent=100.0 * float(shares[0]),
            acceleration_percent=100.0 * float(shares[1]),
            torque_percent=100.0 * float(shares[2]) if shares[2] > 0.0 else None,
        )
        for joint, own, settings, crest, shares in zip(
            robot.joints,
            motion.excited_lines(robot),
            motion.joints,
            motion.crest_factors(robot),
            designed.use,
            strict=True,
        )
    ]


def _print_multisine(console: Console, axes: list[_ShownAxis]) -> None:
    console.table(
        (
            "axis",
            "lines",
            "RMS speed",
            "crest factor",
            "slow sine",
            "of speed limit",
            "of acceleration limit",
            "of torque limit",
        ),
        [
            (
                axis.joint,
                str(axis.lines),
                f"{axis.rms_velocity:.3g} {axis.unit}/s",
                f"{axis.crest_factor:.2f}",
                f"{axis.slow_amplitude:.3g} {axis.unit}",
                f"{axis.velocity_percent:.0f} %",
                f"{axis.acceleration_percent:.0f} %",
                "not told" if axis.torque_percent is None else f"{axis.torque_percent:.0f} %",
            )
            for axis in axes
        ],
    )
    if any(axis.torque_percent is None for axis in axes):
        console.say("Torque is told where the robot file has `cad`, or a --model is given.")


def _print_excitation(
    console: Console, designed: Designed, motion: FourierMotion, output: Path
) -> None:
    samples, condition, found = designed.samples, designed.condition, designed.found
    axes = _use_of_limits(samples, designed.cell.robot)
    document: dict[str, object] = {
        "motion": str(output),
        "condition_number": condition,
        "duration_s": samples.duration_s,
        "axes": [axis._asdict() for axis in axes],
    }
    if found is not None:
        document["limits"] = [asdict(use) for use in found.best.check.uses]
        document["trials"] = [
            {
                "elapsed_s": trial.elapsed_s,
                "seed": trial.seed,
                "worth": trial.objective,
                "broken": trial.broken,
            }
            for trial in found.trials
        ]
        document["interrupted"] = found.interrupted_by is not None
    console.document(document)
    if found is not None and found.interrupted_by is not None:
        console.verdict(None, "Interrupted: this is the best motion found so far.")
    console.say(
        f"{output}: {motion.periods} periods of {motion.period_s:g} s,"
        f" {samples.duration_s:.1f} s in all, condition number {condition:.4g}. Verified between"
        " the samples too."
    )
    console.table(
        ("axis", "range", "max speed", "of limit", "max acceleration", "of limit"),
        [
            (
                axis.joint,
                f"{axis.position_min:.3f} … {axis.position_max:.3f} {axis.unit}",
                f"{axis.velocity:.3f} {axis.unit}/s",
                f"{axis.velocity_percent:.0f} %",
                f"{axis.acceleration:.3f} {axis.unit}/s²",
                f"{axis.acceleration_percent:.0f} %",
            )
            for axis in axes
        ],
    )
    if found is not None:
        found.print(console, designed.cell.config)


def _use_of_limits(samples: MotionSamples, robot: RobotDescription) -> list[_UseOfLimits]:
    velocity = np.abs(samples.velocity).max(axis=0)
    acceleration = np.abs(samples.acceleration).max(axis=0)
    return [
        _UseOfLimits(
            joint=joint.name,
            unit=units(joint)[0],
            position_min=float(samples.position[:, column].min()),
            position_max=float(samples.position[:, column].max()),
            velocity=float(velocity[column]),
            velocity_percent=float(100.0 * velocity[column] / joint.limits.velocity),
            acceleration=float(acceleration[column]),
            acceleration_percent=float(100.0 * acceleration[column] / joint.limits.acceleration),
        )
        for column, joint in enumerate(robot.joints)
    ]
