"""The file that a user names for a result: refused, if it must be, before anything is computed."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from config.errors import ConfigError, RecordingError

Overwrite = Annotated[bool, typer.Option(help="Replace the output file if it is there.")]


def refuse_output(output: Path | None, overwrite: bool) -> None:
    """Refuse a file that cannot be written, or that was not meant to be replaced.

    Parameters
    ----------
    output
        The file; None, which is never refused, where the result has its place in a run.
    overwrite
        Whether a file that is there may be replaced.

    Raises
    ------
    ConfigError
        A file of that name is there.
    RecordingError
        No file of that name can be.
    """
    if output is None:
        return
    if output.exists() and not output.is_file():
        raise RecordingError(f"{output}: cannot be written: is no file; choose another name")
    if output.exists() and not overwrite:
        raise ConfigError(f"{output}: is already there; give another name, or --overwrite")
    if not output.parent.is_dir():
        raise RecordingError(f"{output}: cannot be written: there is no folder {output.parent}")
    if not os.access(output.parent, os.W_OK | os.X_OK):
        raise RecordingError(f"{output}: cannot be written: {output.parent} may not be written to")
