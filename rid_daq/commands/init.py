"""`rid-daq init`: a commented cell, robot and motion to start from."""

from __future__ import annotations

import math
from collections.abc import Iterable
from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from config.errors import ConfigError, RecordingError, system_errors
from config.formats.number import parse_numbers
from config.formats.whole_file import write_whole
from rid_daq.terminal.console import Console, as_command
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.options import AsJson

URDF_FILES = ("robot.yaml", "plant.yaml", "cell.yaml", "validation.yaml")


def init(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Where to write; it may exist already.")
    ],
    urdf: Annotated[
        Path | None,
        typer.Option("--urdf", metavar="FILE", help="Make robot and cell from this URDF."),
    ] = None,
    base: Annotated[
        str | None,
        typer.Option("--base", metavar="LINK", help="The URDF's link that stands still."),
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option("--tip", metavar="LINK", help="The URDF's link that is the tool point."),
    ] = None,
    position: Annotated[
        str | None,
        typer.Option(
            "--range",
            metavar="RAD",
            help="Joints go from minus to plus this [rad or m] where the URDF states no range.",
        ),
    ] = None,
    velocity: Annotated[
        str | None,
        typer.Option(metavar="RAD/S", help="Speed where the URDF states none [rad/s or m/s]."),
    ] = None,
    acceleration: Annotated[
        str | None,
        typer.Option(
            metavar="RAD/S2", help="Acceleration where the URDF states none [rad/s² or m/s²]."
        ),
    ] = None,
    effort: Annotated[
        str | None,
        typer.Option(metavar="NM", help="Torque where the URDF states none [N m or N]."),
    ] = None,
    rehearsal: Annotated[
        bool,
        typer.Option(
            "--rehearsal/--no-rehearsal",
            help="Whether a URDF's cell is tried before it is written.",
        ),
    ] = True,
    as_json: AsJson = False,
) -> None:
    """Write a commented cell, robot and two motions to start from.

    They run as they are, on a simulated cell. Change them towards your own robot. With --urdf the
    robot, its limits and its links come from that file. --range, --velocity, --acceleration and
    --effort take one number for all joints, or one a joint with commas between; without them the
    robot's size decides. The cell of a URDF is rehearsed in simulated time: checked, and moved for
    some seconds; where the motion is stopped, slower. Where it does not run, the exit code is 1.
    """
    console = Console(as_json)
    notes: tuple[str, ...] = ()
    obstacle = ""
    limits = {"range": position, "velocity": velocity, "acceleration": acceleration}
    limits |= {"effort": effort}
    if urdf is not None:
        from config.robot.urdf_limits import LimitDefaults
        from rid_daq.jobs.starter.urdf_starter import (
            UrdfRequest,
            starting_files,
            starting_robot,
        )

        defaults = LimitDefaults(*(_numbers(f"--{name}", text) for name, text in limits.items()))
        made = starting_robot(UrdfRequest(urdf, folder, base, tip, defaults))
        _refuse_present(folder, URDF_FILES)
        if rehearsal:
            from rid_daq.recording.starter_rehearsal import rehearsed

            tried = rehearsed(urdf, made)
            files, notes, obstacle = tried.files, tried.made.notes, tried.obstacle
        else:
            files, notes = starting_files(urdf, made), made.notes
    elif given := [
        f"--{name}" for name, value in (limits | {"base": base, "tip": tip}).items() if value
    ]:
        raise ConfigError(
            f"{', '.join(given)}: this is about a URDF: give it with --urdf",
            code="RID-OPTION-NEEDS",
        )
    else:
        files = _starter_files()
    _refuse_present(folder, files)
    with system_errors(RecordingError, f"{folder}: cannot make the folder", code="RID-FILE-WRITE"):
        folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        write_whole(folder / name, text.encode())
    console.document(
        {
            "folder": str(folder),
            "files": list(files),
            "notes": list(notes),
            "rehearsed": urdf is not None and rehearsal and not obstacle,
            "obstacle": obstacle,
        }
    )
    console.say(f"{folder}: wrote {', '.join(files)}.")
    for note in notes:
        console.say(f"  {note}")
    if obstacle:
        console.verdict(False, f"The simulated cell did not run in its rehearsal: {obstacle}")
        raise typer.Exit(ExitCode.VERDICT_FAILED)
    if urdf is not None and rehearsal:
        console.verdict(True, "Rehearsed: the simulated cell was checked and moved.")
    cell, motion = folder / "cell.yaml", folder / "motion.yaml"
    if "motion.yaml" in files:
        console.say("Next, on the simulated cell that they describe:")
        console.say(f"  {as_command('check', cell)}")
    else:
        console.say("Next, after a look at limits and rotors in robot.yaml:")
        console.say(f"  {as_command('design', cell, '-o', motion)}")
    console.say(f"  {as_command('record', cell, motion)}")


def _refuse_present(folder: Path, names: Iterable[str]) -> None:
    present = [name for name in names if (folder / name).exists()]
    if present:
        raise ConfigError(
            f"{folder}: {', '.join(present)} is already there; nothing was written."
            " Give another folder, or move the files away.",
            code="RID-FILE-EXISTS",
        )


def _numbers(option: str, text: str | None) -> tuple[float, ...]:
    """Return the positive numbers of an option; none where it is not given.

    Raises
    ------
    ConfigError
        It has something else.
    """
    try:
        values = parse_numbers(text) if text is not None else ()
    except ConfigError:
        values = (math.nan,)
    if not all(math.isfinite(value) and value > 0.0 for value in values):
        raise ConfigError(
            f"{option} {text}: give one number above 0, or one a joint: 3.1,3.1,2.5",
            code="RID-OPTION-SYNTAX",
        )
    return values


def _starter_files() -> dict[str, str]:
    folder = resources.files("rid_daq") / "starter"
    names = ("cell.yaml", "robot.yaml", "motion.yaml", "validation.yaml")
    return {name: (folder / name).read_text(encoding="utf-8") for name in names}
