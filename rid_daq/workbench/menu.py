"""`MENU`: the pages of a cell, in the order of the work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class MenuEntry:
    """A page of a cell.

    Attributes:
        path: What follows `/cells/CELL` in its address; empty for the cell's own page.
        title: What it is called.
    """

    path: str
    title: str


MENU: Final = (
    MenuEntry("", "Cell"),
    MenuEntry("/experiment", "Experiment"),
    MenuEntry("/identify", "Identify"),
    MenuEntry("/friction", "Friction"),
    MenuEntry("/payload", "Payload"),
    MenuEntry("/compensation", "Compensation"),
    MenuEntry("/runs", "Runs"),
    MenuEntry("/settings", "Settings"),
)
