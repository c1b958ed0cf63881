"""`AuditLog`: log of user actions with their times. Entries are only added."""

from __future__ import annotations

import time
from collections.abc import Sequence

from rid_daq.service.records import AuditEntry
from rid_daq.service.store.database import Database


class AuditLog:
    """Table of user actions.

    Args:
        database: The service's database.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def note(self, who: str, what: str, cell: str = "", details: str = "") -> None:
        """Add the action of a user; the entry is written later, and no caller waits for it."""
        entry = AuditEntry(at_s=time.time(), who=who, what=what, cell=cell, details=details)
        self._database.note(
            "INSERT INTO audit (at_s, entry) VALUES (?, ?)", entry.at_s, entry.model_dump_json()
        )

    def newest(self, limit: int = 200) -> Sequence[AuditEntry]:
        """Return the newest entries, newest first; this blocks, so call it in a thread.

        Args:
            limit: Largest number of entries.
        """
        rows = self._database.read("SELECT entry FROM audit ORDER BY number DESC LIMIT ?", limit)
        return [AuditEntry.model_validate_json(row[0]) for row in rows]
