"""`rid-daq compensate`: the feedforward that makes a motion accurate, from model and loops."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from acquisition.motion_samples import plan_motion, verify_limits
from compensation.compensated_motion import compensated_motion
from compensation.feedforward_file import write_feedforward
from compensation.loop_file import read_loops
from config.errors import ConfigError
from config.load import load_cell, load_motion
from identification.estimate_file import read_estimate
from rid_daq.commands.record import check_robot
from rid_daq.console import AsJson, Console


def compensate(
    cell: Annotated[str, typer.Argument(metavar="CELL", help="A bundled name or a cell file.")],
    motion: Annotated[Path, typer.Argument(metavar="MOTION", help="A motion file.")],
    model: Annotated[Path, typer.Option(metavar="MODEL", help="A model by `identify`.")],
    loop: Annotated[Path, typer.Option(metavar="LOOPS", help="Velocity loops by `loop`.")],
    output: Annotated[
        Path, typer.Option("--output", "-o", metavar="FEEDFORWARD", help="The file to write.")
    ],
    as_json: AsJson = False,
) -> None:
    """Compute the speeds that make the drives produce the torques that the motion takes.

    Nothing moves. `rid-daq record CELL MOTION --feedforward FEEDFORWARD` runs the motion with it.
    """
    console = Console(as_json)
    loaded = load_cell(cell)
    asked = load_motion(motion)
    check_robot(asked, loaded, motion)
    robot, loops = read_loops(loop)
    if robot != loaded.robot.name:
        raise ConfigError(f"{loop}: is of robot {robot!r}, the cell has {loaded.robot.name!r}")
    samples = plan_motion(asked, loaded.robot, loaded.config.cycle_time_s)
    compensated = compensated_motion(samples, read_estimate(model), loops)
    verify_limits(compensated, loaded.robot)
    write_feedforward(output, asked, compensated)
    assert compensated.feedforward is not None
    more = np.abs(compensated.feedforward - compensated.velocity).max(axis=0)
    names = loaded.robot.joint_names
    console.document(
        {
            "feedforward": str(output),
            "rows": len(samples),
            "largest_correction": dict(zip(names, more.tolist(), strict=True)),
        }
    )
    changes = ", ".join(f"{name} {value:.3g}" for name, value in zip(names, more, strict=True))
    console.say(f"Largest correction of the speed [rad/s or m/s]: {changes}.")
    console.say(f"Next: rid-daq record {cell} {motion} --feedforward {output}")
