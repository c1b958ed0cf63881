"""`rid-daq design`: choose an excitation, verify it, write the motion file."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from acquisition.motion_samples import MotionSamples, plan_motion
from config.errors import ConfigError
from config.load import load_cell, to_yaml
from config.robot import RobotDescription
from config.whole_file import write_whole
from identification.experiment_design import condition_number, design_two_harmonic
from rid_daq.console import AsJson, Console
from rid_daq.sections import units


def design(
    cell: Annotated[str, typer.Argument(metavar="CELL", help="A bundled name or a cell file.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="MOTION", help="The motion file to write.")
    ],
    period_s: Annotated[
        float, typer.Option("--period", min=0.1, max=3600.0, help="Period [s], whole cycles.")
    ] = 10.0,
    periods: Annotated[int, typer.Option(min=2, help="Periods that count.")] = 16,
    highest_harmonic: Annotated[
        int, typer.Option("--harmonics", min=2, help="The highest harmonic used.")
    ] = 8,
    tries: Annotated[int, typer.Option(min=1, help="How many motions are compared.")] = 200,
    seed: Annotated[int, typer.Option(min=0, help="Where they are drawn from.")] = 0,
    overwrite: Annotated[bool, typer.Option(help="Replace MOTION if it is there.")] = False,
    as_json: AsJson = False,
) -> None:
    """Choose an excitation by the two-harmonic heuristic and verify it densely.

    One low and one high harmonic an axis; of many draws the one with the smallest condition number
    is kept. The motion written has passed the check of every limit, ramps included.
    """
    console = Console(as_json)
    if output.exists() and not overwrite:
        raise ConfigError(f"{output}: is already there; give another name, or --overwrite")
    loaded = load_cell(cell)
    motion = design_two_harmonic(
        loaded.robot,
        period_s,
        loaded.config.cycle_time_s,
        highest_harmonic=highest_harmonic,
        tries=tries,
        seed=seed,
        periods=periods,
    )
    samples = plan_motion(motion, loaded.robot, loaded.config.cycle_time_s)
    condition = condition_number(loaded.robot, motion)
    axes = _use_of_limits(samples, loaded.robot)
    comment = (
        f"Two-harmonic excitation for robot {loaded.robot.name}, verified within its limits at"
        f" {loaded.config.cycle_time_ms} ms.\nCondition number {condition:.4g}; the best of"
        f" {tries} draws from seed {seed}."
    )
    write_whole(output, to_yaml(motion, comment).encode())
    console.document(
        {
            "motion": str(output),
            "condition_number": condition,
            "duration_s": samples.duration_s,
            "axes": axes,
        }
    )
    console.say(
        f"{output}: {motion.periods} periods of {period_s:g} s, {samples.duration_s:.1f} s in all,"
        f" condition number {condition:.4g}. Verified between the samples too."
    )
    console.table(
        ("axis", "range", "max speed", "of limit", "max acceleration", "of limit"),
        [
            (
                axis["joint"],
                f"{axis['position_min']:.3f} … {axis['position_max']:.3f} {axis['unit']}",
                f"{axis['velocity']:.3f} {axis['unit']}/s",
                f"{axis['velocity_percent']:.0f} %",
                f"{axis['acceleration']:.3f} {axis['unit']}/s²",
                f"{axis['acceleration_percent']:.0f} %",
            )
            for axis in axes
        ],
    )
    console.say(f"Next: rid-daq record {cell} {output}")


def _use_of_limits(samples: MotionSamples, robot: RobotDescription) -> list[dict[str, Any]]:
    velocity = np.abs(samples.velocity).max(axis=0)
    acceleration = np.abs(samples.acceleration).max(axis=0)
    return [
        {
            "joint": joint.name,
            "unit": units(joint)[0],
            "position_min": float(samples.position[:, column].min()),
            "position_max": float(samples.position[:, column].max()),
            "velocity": float(velocity[column]),
            "velocity_percent": float(100.0 * velocity[column] / joint.limits.velocity),
            "acceleration": float(acceleration[column]),
            "acceleration_percent": float(100.0 * acceleration[column] / joint.limits.acceleration),
        }
        for column, joint in enumerate(robot.joints)
    ]
