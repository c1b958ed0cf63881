"""`rid-daq init`: a commented cell, robot and motion to start from."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from config.errors import ConfigError, RecordingError, system_errors
from config.formats.whole_file import write_whole
from rid_daq.terminal.console import AsJson, Console, as_command


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
    as_json: AsJson = False,
) -> None:
    """Write a commented cell, robot and two motions to start from.

    They run as they are, on a simulated cell. Change them towards your own robot. With --urdf the
    robot, its limits and its links come from that file.
    """
    console = Console(as_json)
    notes: tuple[str, ...] = ()
    if urdf is not None:
        from rid_daq.jobs.starter.urdf_starter import urdf_files

        files, made = urdf_files(urdf, base, tip)
        notes = made.notes
    elif base is not None or tip is not None:
        raise ConfigError("--base and --tip name links of a URDF: give it with --urdf")
    else:
        files = _starter_files()
    present = [name for name in files if (folder / name).exists()]
    if present:
        raise ConfigError(
            f"{folder}: {', '.join(present)} is already there; nothing was written."
            " Give another folder, or move the files away."
        )
    with system_errors(RecordingError, f"{folder}: cannot make the folder"):
        folder.mkdir(parents=True, exist_ok=True)
    for name, text in files.items():
        write_whole(folder / name, text.encode())
    console.document({"folder": str(folder), "files": list(files), "notes": list(notes)})
    console.say(f"{folder}: wrote {', '.join(files)}.")
    for note in notes:
        console.say(f"  {note}")
    cell, motion = folder / "cell.yaml", folder / "motion.yaml"
    if "motion.yaml" in files:
        console.say("Next, on the simulated cell that they describe:")
        console.say(f"  {as_command('check', cell)}")
    else:
        console.say("Next, after a look at limits and rotors in robot.yaml:")
        console.say(f"  {as_command('design', cell, '-o', motion)}")
    console.say(f"  {as_command('record', cell, motion)}")


def _starter_files() -> dict[str, str]:
    folder = resources.files("rid_daq") / "starter"
    names = ("cell.yaml", "robot.yaml", "motion.yaml", "validation.yaml")
    return {name: (folder / name).read_text(encoding="utf-8") for name in names}
