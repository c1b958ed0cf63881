"""`Proposal`: a proposed import map, with the reasons for it."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from acquisition.imports.report import ImportReport
from acquisition.recording.recording import Recording
from config.refusals import PLACEHOLDER


@dataclass(frozen=True)
class Proposal:
    """A proposed import map.

    Attributes:
        keys: Contents of the map; a value that a person must state is `?`.
        reasons: Reason for each part, one sentence each.
        doubts: Doubts, and notes for a person, one sentence each.
        report: Import with this map; None if it was not possible.
        recording: The imported recording; None without a report.
    """

    keys: dict[str, Any]
    reasons: tuple[str, ...]
    doubts: tuple[str, ...]
    report: ImportReport | None
    recording: Recording | None = None

    @property
    def missing(self) -> tuple[str, ...]:
        """Keys with a value that a person must state."""
        return tuple(dict.fromkeys(_placeholders(self.keys)))


def _placeholders(value: Any, name: str = "") -> Iterator[str]:
    """Yield the names of the keys whose value is missing."""
    if value == PLACEHOLDER:
        yield name
    elif isinstance(value, dict):
        for key, each in value.items():
            yield from _placeholders(each, key)
    elif isinstance(value, list):
        for each in value:
            yield from _placeholders(each, name)


def map_name(path: Path) -> str:
    """Return a name for the map of a file."""
    return re.sub(r"[^\w.-]+", "_", path.stem, flags=re.ASCII)[:64].lstrip("_.-") or "recording"
