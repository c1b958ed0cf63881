"""`Leases`: grants, renews, transfers and ends the leases of the cells."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from dataclasses import replace
from math import inf
from typing import Final

from config.errors import ConfigError, LockedError
from config.process.safety_clock import boot_id, safety_now_s
from rid_daq.service.records import HeldLease, Identity, Lease
from rid_daq.service.refusals import NotAllowedError
from rid_daq.service.store.leases import LeaseStore, StoredLease
from rid_daq.web.request_secrets import hash_secret

LEAST_S: Final = 2.0
MOST_S: Final = 3600.0


class Leases:
    """Leases of the service's cells.

    A lease remains valid after a restart of the service, but not after a restart of the computer.

    Args:
        store: Database table of the leases.
        now_s: The safety clock [s].
        boot: Id of the computer's start to which `now_s` belongs (default: the present one).
    """

    def __init__(
        self,
        store: LeaseStore,
        now_s: Callable[[], float] = safety_now_s,
        boot: str | None = None,
    ) -> None:
        self._store = store
        self._now_s = now_s
        self._boot = boot_id() if boot is None else boot

    def lease_of(self, cell: str) -> Lease | None:
        """Return the valid lease of a cell, None if there is no valid lease."""
        held = self._current_lease(cell)
        return None if held is None else held.lease

    def end_s(self, cell: str, lease: str | None) -> float:
        """Return the end of a lease on the safety clock [s]; -inf if it is no longer valid."""
        held = self._current_lease(cell)
        return held.ends_s if held is not None and held.lease.id == lease else -inf

    def take(
        self, cell: str, who: Identity, note: str, seconds: float, confirmed: str | None = None
    ) -> HeldLease:
        """Grant the lease of a cell to a client.

        Args:
            who: The client.
            note: Purpose of the lease; other clients can read it.
            seconds: Duration of the lease unless it is renewed [s].
            confirmed: Name of the cell, typed by a person who takes the cell over from another
                client.

        Raises:
            LockedError: The cell has a valid lease, and `confirmed` is None.
            NotAllowedError: A program tries to take the cell over.
            ConfigError: The duration is too short or too long, or the confirmation differs from the
                cell's name.
        """
        self._check_duration(seconds)
        running = self._current_lease(cell)
        held = None if running is None else running.lease
        if running is not None and held is not None and confirmed is None:
            left_s = running.ends_s - self._now_s()
            raise LockedError(
                f"cell {cell}: {held.owner} holds it ({held.note or 'no note'}; {left_s:.0f} s"
                f" left unless renewed): wait, ask {held.owner}, or take it over on the page",
                code="RID-LEASE-OTHER",
            )
        if held is not None and not who.person:
            raise NotAllowedError(
                f"cell {cell}: only a person can take it over from {held.owner}, on the page",
                code="RID-ACCESS-ROLE",
            )
        if held is not None and confirmed != cell:
            raise ConfigError(
                f"{confirmed!r} is not the cell's name {cell!r}: type the name to take the cell"
                " over",
                code="RID-ANSWER-NO",
            )
        lease = Lease(
            id=secrets.token_hex(8),
            cell=cell,
            owner=who.name,
            note=note,
            person=who.person,
            until_s=time.time() + seconds,
        )
        key = secrets.token_urlsafe(24)
        self._store.note_token(lease, who.token)
        self._store.put(StoredLease(lease, hash_secret(key), self._now_s() + seconds, self._boot))
        return HeldLease(**lease.model_dump(), key=key)

    def renew(self, cell: str, key: str, seconds: float) -> Lease:
        """Extend a lease.

        Raises:
            ConfigError: The duration is too short or too long.
            LockedError: The key does not belong to the cell's valid lease.
        """
        self._check_duration(seconds)
        held = self._require_key(cell, key)
        renewed = held.lease.model_copy(update={"until_s": time.time() + seconds})
        self._store.renew(replace(held, lease=renewed, ends_s=self._now_s() + seconds))
        return renewed

    def require(self, cell: str, key: str | None) -> Lease:
        """Return the lease that a key belongs to.

        Raises:
            LockedError: The key does not belong to the cell's valid lease.
        """
        return self._require_key(cell, key).lease

    def give_back(self, cell: str, key: str) -> None:
        """End a lease.

        Raises:
            LockedError: The key does not belong to the cell's valid lease.
        """
        self._require_key(cell, key)
        self._store.remove(cell)

    def end_leases_of_token(self, token: str) -> list[str]:
        """End the leases that were taken with a token; return their cells."""
        cells = [lease.cell for lease in self._store.of_token(token) if self.lease_of(lease.cell)]
        for cell in cells:
            self._store.remove(cell)
        return cells

    def _current_lease(self, cell: str) -> StoredLease | None:
        """Return the valid lease of a cell, None if there is no valid lease."""
        kept = self._store.get(cell)
        runs = kept is not None and kept.boot == self._boot and kept.ends_s > self._now_s()
        return kept if runs else None

    def _require_key(self, cell: str, key: str | None) -> StoredLease:
        held = self._current_lease(cell)
        if held is None:
            raise LockedError(
                f"cell {cell}: no client holds it now: take its lease first", code="RID-LEASE-NONE"
            )
        if key is None or not held.has_key(key):
            raise LockedError(
                f"cell {cell}: {held.lease.owner} holds it, and this request does not contain the"
                " key of its lease",
                code="RID-LEASE-OTHER",
            )
        return held

    def _check_duration(self, seconds: float) -> None:
        if not LEAST_S <= seconds <= MOST_S:
            raise ConfigError(
                f"seconds: {seconds:g}: must be {LEAST_S:g} to {MOST_S:g}", code="RID-OPTION-RANGE"
            )
