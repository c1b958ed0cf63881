"""`CellStore`: what is known of cells over a restart: the newest preflight, and an open fault."""

from __future__ import annotations

import sqlite3

from rid_daq.service.records import Preflight


class CellStore:
    """The table of cells.

    Parameters
    ----------
    connection : sqlite3.Connection
        Of the service's file.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def add(self, cell: str) -> None:
        """Begin to know a cell."""
        self._connection.execute(
            "INSERT OR IGNORE INTO cells VALUES (?, NULL, NULL, '')",
            (cell,),
        )

    def note_preflight(self, cell: str, preflight: Preflight, files_hash: str) -> None:
        """Keep a preflight, and of which files it was."""
        self._connection.execute(
            "UPDATE cells SET preflight = ?, files_hash = ? WHERE cell = ?",
            (preflight.model_dump_json(), files_hash, cell),
        )

    def preflight(self, cell: str) -> tuple[Preflight, str] | None:
        """Return the newest preflight and of which files it was, None where there is none."""
        row = self._connection.execute(
            "SELECT preflight, files_hash FROM cells WHERE cell = ? AND preflight IS NOT NULL",
            (cell,),
        ).fetchone()
        return None if row is None else (Preflight.model_validate_json(row[0]), str(row[1]))

    def note_fault(self, cell: str, fault: str) -> None:
        """Keep why a cell must be reset by a person; empty where it has been."""
        self._connection.execute("UPDATE cells SET fault = ? WHERE cell = ?", (fault, cell))

    def fault(self, cell: str) -> str:
        """Return why a cell must be reset, empty where it need not."""
        row = self._connection.execute("SELECT fault FROM cells WHERE cell = ?", (cell,)).fetchone()
        return "" if row is None else str(row[0])
