"""`AuditLog`: who did what, when. It is only added to."""

from __future__ import annotations

import sqlite3
import time
from collections.abc import Sequence

from rid_daq.service.records import AuditEntry


class AuditLog:
    """The table of what was done.

    Parameters
    ----------
    connection : sqlite3.Connection
        Of the service's file.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def note(self, who: str, what: str, cell: str = "", details: str = "") -> None:
        """Keep what somebody did."""
        entry = AuditEntry(at_s=time.time(), who=who, what=what, cell=cell, details=details)
        self._connection.execute(
            "INSERT INTO audit (at_s, entry) VALUES (?, ?)", (entry.at_s, entry.model_dump_json())
        )

    def newest(self, limit: int = 200) -> Sequence[AuditEntry]:
        """Return what was done, newest first."""
        rows = self._connection.execute(
            "SELECT entry FROM audit ORDER BY number DESC LIMIT ?", (limit,)
        )
        return [AuditEntry.model_validate_json(row[0]) for row in rows]
