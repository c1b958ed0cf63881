"""`LeaseStore`: who may move which cell; one lease a cell."""

from __future__ import annotations

import hmac
import sqlite3
from collections.abc import Sequence

from rid_daq.service.records import Lease
from rid_daq.service.store.tokens import hashed


class LeaseStore:
    """The table of leases.

    Parameters
    ----------
    connection : sqlite3.Connection
        Of the service's file.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def put(self, lease: Lease, key: str) -> None:
        """Write the lease of a cell, in place of the one before."""
        self._connection.execute(
            "INSERT OR REPLACE INTO leases VALUES (?, ?, ?)",
            (lease.cell, hashed(key), lease.model_dump_json()),
        )

    def note_token(self, lease: Lease, token: str) -> None:
        """Write which token a lease was taken with."""
        self._connection.execute(
            "INSERT OR REPLACE INTO lease_tokens VALUES (?, ?, ?)", (lease.cell, lease.id, token)
        )

    def of_token(self, token: str) -> Sequence[Lease]:
        """Return the leases that were taken with a token, also those that have run out."""
        rows = self._connection.execute(
            "SELECT cell, lease FROM lease_tokens WHERE token = ?", (token,)
        ).fetchall()
        found = [(self.get(cell), lease_id) for cell, lease_id in rows]
        return [lease for lease, lease_id in found if lease is not None and lease.id == lease_id]

    def get(self, cell: str) -> Lease | None:
        """Return the lease of a cell as it was written, also one that has run out."""
        row = self._connection.execute(
            "SELECT lease FROM leases WHERE cell = ?", (cell,)
        ).fetchone()
        return None if row is None else Lease.model_validate_json(row[0])

    def has_key(self, cell: str, key: str) -> bool:
        """Return whether this is the key of the cell's lease."""
        row = self._connection.execute(
            "SELECT key_hash FROM leases WHERE cell = ?", (cell,)
        ).fetchone()
        return row is not None and hmac.compare_digest(row[0], hashed(key))

    def remove(self, cell: str) -> None:
        """Forget the lease of a cell."""
        self._connection.execute("DELETE FROM leases WHERE cell = ?", (cell,))
