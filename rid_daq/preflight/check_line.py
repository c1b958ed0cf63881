"""`CheckLine`: one line of the preflight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class CheckLine:
    """One line of the preflight: what was measured, what is required, what to do if red."""

    where: str
    what: str
    required: str
    found: str
    verdict: Literal["ok", "red", "allowed", "shown"]
    next_action: str = ""
    of_drive: bool = False
