"""`LeaseStore`: table of leases, one lease per cell."""

from __future__ import annotations

import hmac
from collections.abc import Sequence
from dataclasses import dataclass

from rid_daq.service.records import Lease
from rid_daq.service.store.database import Database
from rid_daq.web.request_secrets import hash_secret


@dataclass(frozen=True)
class StoredLease:
    """Lease as the service stores it.

    Attributes:
        lease: Public part of the lease; its `until_s` is for display only.
        key_hash: Hash of its key.
        ends_s: Its end on the safety clock [s].
        boot: Id of the computer's start to which `ends_s` belongs.
    """

    lease: Lease
    key_hash: str
    ends_s: float
    boot: str

    def has_key(self, key: str) -> bool:
        """Return True if this is the key of the lease."""
        return hmac.compare_digest(self.key_hash, hash_secret(key))


class LeaseStore:
    """Table of leases, with a copy in memory.

    Args:
        database: The service's database.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._leases = {
            str(cell): StoredLease(Lease.model_validate_json(lease), key_hash, ends_s, boot)
            for cell, key_hash, lease, ends_s, boot in database.read(
                "SELECT cell, key_hash, leases.lease, ends_s, boot FROM leases JOIN lease_ends"
                " USING (cell) WHERE json_extract(leases.lease, '$.id') = lease_ends.lease"
            )
        }
        rows = database.read("SELECT cell, lease, token FROM lease_tokens")
        self._tokens = {str(cell): (str(lease), str(token)) for cell, lease, token in rows}

    def put(self, kept: StoredLease) -> None:
        """Save the lease of a cell; it replaces the previous lease."""
        lease = kept.lease
        self._leases[lease.cell] = kept
        self._database.write(
            "INSERT OR REPLACE INTO leases VALUES (?, ?, ?)",
            lease.cell,
            kept.key_hash,
            lease.model_dump_json(),
        )
        self._database.write(
            "INSERT OR REPLACE INTO lease_ends VALUES (?, ?, ?, ?)",
            lease.cell,
            lease.id,
            kept.ends_s,
            kept.boot,
        )

    def renew(self, kept: StoredLease) -> None:
        """Save the new end of a lease."""
        lease = kept.lease
        self._leases[lease.cell] = kept
        self._database.note(
            "UPDATE leases SET lease = ? WHERE cell = ?", lease.model_dump_json(), lease.cell
        )
        self._database.note(
            "UPDATE lease_ends SET ends_s = ? WHERE cell = ? AND lease = ?",
            kept.ends_s,
            lease.cell,
            lease.id,
        )

    def note_token(self, lease: Lease, token: str) -> None:
        """Save the token with which a lease was taken."""
        self._tokens[lease.cell] = (lease.id, token)
        self._database.write(
            "INSERT OR REPLACE INTO lease_tokens VALUES (?, ?, ?)", lease.cell, lease.id, token
        )

    def of_token(self, token: str) -> Sequence[Lease]:
        """Return the leases that were taken with a token, including expired ones."""
        of_token = {cell: lease for cell, (lease, each) in self._tokens.items() if each == token}
        leases = (kept.lease for kept in self._leases.values())
        return [lease for lease in leases if of_token.get(lease.cell) == lease.id]

    def get(self, cell: str) -> StoredLease | None:
        """Return the stored lease of a cell, even if it has expired."""
        return self._leases.get(cell)

    def remove(self, cell: str) -> None:
        """Delete the lease of a cell."""
        self._leases.pop(cell, None)
        self._database.write("DELETE FROM leases WHERE cell = ?", cell)
