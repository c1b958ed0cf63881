"""Fields that several operations on a cell have."""

from __future__ import annotations

from typing import Annotated, Final

from pydantic import Field

from rid_daq.operations.option import Option

BEFORE: Final = "Before it moves"

Cleared = Annotated[
    bool,
    Field(
        description="Nobody is in the cell and the emergency stop is at hand; needed for real"
        " robots if nobody can be asked."
    ),
    Option(group=BEFORE, flag="i-have-cleared-the-cell", owned=True),
]
