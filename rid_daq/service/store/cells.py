"""`CellStore`: what is known of cells over a restart: the newest preflight, and an open fault."""

from __future__ import annotations

from rid_daq.service.records import Preflight
from rid_daq.service.store.database import Database


class CellStore:
    """The table of cells, and all of it in memory.

    Args:
        database: The service's file.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._preflights: dict[str, tuple[Preflight, str]] = {}
        self._faults: dict[str, str] = {}
        for cell, preflight, files_hash, fault in database.read(
            "SELECT cell, preflight, files_hash, fault FROM cells"
        ):
            self._faults[cell] = str(fault)
            if preflight is not None:
                found = Preflight.model_validate_json(preflight)
                self._preflights[cell] = (found, str(files_hash))

    def add(self, cell: str) -> None:
        """Begin to know a cell."""
        self._faults.setdefault(cell, "")
        self._database.write("INSERT OR IGNORE INTO cells VALUES (?, NULL, NULL, '')", cell)

    def note_preflight(self, cell: str, preflight: Preflight, files_hash: str) -> None:
        """Keep a preflight, and of which files it was."""
        self._preflights[cell] = (preflight, files_hash)
        self._database.write(
            "UPDATE cells SET preflight = ?, files_hash = ? WHERE cell = ?",
            preflight.model_dump_json(),
            files_hash,
            cell,
        )

    def preflight(self, cell: str) -> tuple[Preflight, str] | None:
        """Return the newest preflight and of which files it was, None if there is none."""
        return self._preflights.get(cell)

    def note_fault(self, cell: str, fault: str) -> None:
        """Keep why a cell must be reset by a person; empty if it has been."""
        self._faults[cell] = fault
        self._database.write("UPDATE cells SET fault = ? WHERE cell = ?", fault, cell)

    def fault(self, cell: str) -> str:
        """Return why a cell must be reset, empty if it need not."""
        return self._faults.get(cell, "")
