"""`LeaseStore`: who may move which cell; one lease a cell."""

from __future__ import annotations

import hmac
from collections.abc import Sequence

from rid_daq.service.records import Lease
from rid_daq.service.store.database import Database
from rid_daq.service.store.tokens import hashed


class LeaseStore:
    """The table of leases, and all of it in memory.

    Parameters
    ----------
    database : Database
        The service's file.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._leases = {
            str(cell): (Lease.model_validate_json(lease), str(key_hash))
            for cell, key_hash, lease in database.read("SELECT cell, key_hash, lease FROM leases")
        }
        rows = database.read("SELECT cell, lease, token FROM lease_tokens")
        self._tokens = {str(cell): (str(lease), str(token)) for cell, lease, token in rows}

    def put(self, lease: Lease, key: str) -> None:
        """Keep the lease of a cell, in place of the one before."""
        self._leases[lease.cell] = (lease, hashed(key))
        self._database.write(
            "INSERT OR REPLACE INTO leases VALUES (?, ?, ?)",
            lease.cell,
            hashed(key),
            lease.model_dump_json(),
        )

    def renew(self, lease: Lease) -> None:
        """Keep until when a lease holds; its key stays."""
        self._leases[lease.cell] = (lease, self._leases[lease.cell][1])
        self._database.note(
            "UPDATE leases SET lease = ? WHERE cell = ?", lease.model_dump_json(), lease.cell
        )

    def note_token(self, lease: Lease, token: str) -> None:
        """Keep which token a lease was taken with."""
        self._tokens[lease.cell] = (lease.id, token)
        self._database.write(
            "INSERT OR REPLACE INTO lease_tokens VALUES (?, ?, ?)", lease.cell, lease.id, token
        )

    def of_token(self, token: str) -> Sequence[Lease]:
        """Return the leases that were taken with a token, also those that have run out."""
        of_token = {cell: lease for cell, (lease, each) in self._tokens.items() if each == token}
        return [lease for lease, _ in self._leases.values() if of_token.get(lease.cell) == lease.id]

    def get(self, cell: str) -> Lease | None:
        """Return the lease of a cell as it was kept, also one that has run out."""
        found = self._leases.get(cell)
        return None if found is None else found[0]

    def has_key(self, cell: str, key: str) -> bool:
        """Return whether this is the key of the cell's lease."""
        found = self._leases.get(cell)
        return found is not None and hmac.compare_digest(found[1], hashed(key))

    def remove(self, cell: str) -> None:
        """Forget the lease of a cell."""
        self._leases.pop(cell, None)
        self._database.write("DELETE FROM leases WHERE cell = ?", cell)
