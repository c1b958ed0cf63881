"""`MENU`: the pages of a cell, in the usual order of the work."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final


@dataclass(frozen=True)
class MenuEntry:
    """A page of a cell.

    Attributes:
        path: Part of its address after `/cells/CELL`; empty for the cell's own page.
        title: Title of the page.
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
