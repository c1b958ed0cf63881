"""`CellStore`: newest preflight and open fault of each cell, kept over a restart."""

from __future__ import annotations

from rid_daq.service.records import Preflight
from rid_daq.service.store.database import Database


class CellStore:
    """Table of cells, with a copy in memory.

    Args:
        database: The service's database.
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
        """Add a cell unless the table contains it."""
        self._faults.setdefault(cell, "")
        self._database.write("INSERT OR IGNORE INTO cells VALUES (?, NULL, NULL, '')", cell)

    def note_preflight(self, cell: str, preflight: Preflight, files_hash: str) -> None:
        """Save a preflight with the hash of the cell's files."""
        self._preflights[cell] = (preflight, files_hash)
        self._database.write(
            "UPDATE cells SET preflight = ?, files_hash = ? WHERE cell = ?",
            preflight.model_dump_json(),
            files_hash,
            cell,
        )

    def preflight(self, cell: str) -> tuple[Preflight, str] | None:
        """Return the newest preflight and the hash of the checked files; None if none is saved."""
        return self._preflights.get(cell)

    def note_fault(self, cell: str, fault: str) -> None:
        """Save the fault that a person must reset; an empty text deletes it."""
        self._faults[cell] = fault
        self._database.write("UPDATE cells SET fault = ? WHERE cell = ?", fault, cell)

    def fault(self, cell: str) -> str:
        """Return the fault that a person must reset, empty without a fault."""
        return self._faults.get(cell, "")
