"""`CheckLine`: a line of the preflight."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Verdict = Literal["ok", "red", "allowed", "shown"]


@dataclass(frozen=True)
class CheckLine:
    """One line of the preflight: the finding, the requirement, and the remedy if it is red.

    `code` is the stable error code of a red line; empty for lines without their own code. If
    `headline` is not empty, the summary of the device contains this name and the finding.
    `position` is the measured position in the line of a joint's position [rad or m],
    `temperature_c` the temperature in the line of a motor's temperature [°C].
    """

    where: str
    what: str
    required: str
    found: str
    verdict: Verdict
    next_action: str = ""
    of_drive: bool = False
    code: str = ""
    headline: str = ""
    position: float | None = None
    temperature_c: float | None = None
