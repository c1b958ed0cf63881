"""The option of every command that writes a file which the user names."""

from __future__ import annotations

from typing import Annotated

import typer

Overwrite = Annotated[bool, typer.Option(help="Replace the output file if it is there.")]
