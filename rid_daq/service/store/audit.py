"""`AuditLog`: who did what, when. It is only added to."""

from __future__ import annotations

import time
from collections.abc import Sequence

from rid_daq.service.records import AuditEntry
from rid_daq.service.store.database import Database


class AuditLog:
    """The table of what was done.

    Args:
        database: The service's file.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def note(self, who: str, what: str, cell: str = "", details: str = "") -> None:
        """Keep what somebody did; it is written afterwards and never waited for."""
        entry = AuditEntry(at_s=time.time(), who=who, what=what, cell=cell, details=details)
        self._database.note(
            "INSERT INTO audit (at_s, entry) VALUES (?, ?)", entry.at_s, entry.model_dump_json()
        )

    def newest(self, limit: int = 200) -> Sequence[AuditEntry]:
        """Read what was done, newest first; in a thread."""
        rows = self._database.read("SELECT entry FROM audit ORDER BY number DESC LIMIT ?", limit)
        return [AuditEntry.model_validate_json(row[0]) for row in rows]
