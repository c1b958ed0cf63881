"""`ModelFile`: name and checksum of the model that sections of a report refer to."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Final, Self

from config.errors import RecordingError, system_errors
from rid_daq.report.sections.section import Section

BY_MODEL: Final = (
    *("validation", "curves", "estimate", "plate", "comparison", "reaction", "base_load"),
)
"""Sections that refer to one model."""

_SHOWN: Final = 8


class ModelFile(Section):
    """Name and checksum of the model file that sections of a result refer to.

    Two model files can have the same name; the checksum distinguishes them.

    Attributes:
        name: Name of the file.
        sha256: SHA-256 of the file's bytes.
    """

    name: str
    sha256: str

    @classmethod
    def of(cls, path: Path) -> Self:
        """Return name and checksum of a model file that was just read or written.

        Raises:
            RecordingError: The file can no longer be read.
        """
        with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"):
            return cls(name=path.name, sha256=hashlib.sha256(path.read_bytes()).hexdigest())

    def __str__(self) -> str:
        """Return the name, and the beginning of the checksum."""
        return f"{self.name} ({self.sha256[:_SHOWN]})"
