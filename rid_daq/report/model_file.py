"""`ModelFile`: the model that sections of a report are of."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import Final, Self

from config.errors import RecordingError, system_errors
from rid_daq.report.sections.section import Section

BY_MODEL: Final = (
    *("validation", "curves", "estimate", "plate", "comparison", "reaction", "base_load"),
)
"""The sections that are of a model."""

_SHOWN: Final = 8


class ModelFile(Section):
    """The model file that sections are of; its name may be another's too, its bytes are not.

    Attributes:
        name: The file's name.
        sha256: Of its bytes.
    """

    name: str
    sha256: str

    @classmethod
    def of(cls, path: Path) -> Self:
        """Return what is said of a model file that was just read or written.

        Raises:
            RecordingError: It cannot be read any more.
        """
        with system_errors(RecordingError, f"{path}: cannot be read", code="RID-FILE-READ"):
            return cls(name=path.name, sha256=hashlib.sha256(path.read_bytes()).hexdigest())

    def __str__(self) -> str:
        """Return the name, and the beginning of the checksum."""
        return f"{self.name} ({self.sha256[:_SHOWN]})"
