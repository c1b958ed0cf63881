"""`rid-daq init`: a commented cell, robot and motion to start from."""

from __future__ import annotations

from importlib import resources
from pathlib import Path
from typing import Annotated

import typer

from config.errors import ConfigError
from config.whole_file import write_whole
from rid_daq.console import AsJson, Console


def init(
    folder: Annotated[
        Path, typer.Argument(metavar="DIR", help="Where to write; it may exist already.")
    ],
    as_json: AsJson = False,
) -> None:
    """Write a commented cell, robot and two motions to start from.

    They run as they are, on a simulated cell. Change them towards your own robot.
    """
    console = Console(as_json)
    files = _starter_files()
    present = [name for name in files if (folder / name).exists()]
    if present:
        raise ConfigError(
            f"{folder}: {', '.join(present)} is already there; nothing was written."
            " Give another folder, or move the files away."
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise ConfigError(f"{folder}: cannot make the folder: {error.strerror}") from None
    for name, text in files.items():
        write_whole(folder / name, text.encode())
    console.document({"folder": str(folder), "files": list(files)})
    console.say(f"{folder}: wrote {', '.join(files)}.")
    console.say("Next, on the simulated cell that they describe:")
    console.say(f"  rid-daq check {folder / 'cell.yaml'}")
    console.say(f"  rid-daq record {folder / 'cell.yaml'} {folder / 'motion.yaml'}")


def _starter_files() -> dict[str, str]:
    folder = resources.files("rid_daq") / "starter"
    names = ("cell.yaml", "robot.yaml", "motion.yaml", "validation.yaml")
    return {name: (folder / name).read_text(encoding="utf-8") for name in names}
