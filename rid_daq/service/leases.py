"""`Leases`: motion is one person's. Who may move a cell, given, renewed, taken over, run out."""

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
from rid_daq.service.store.leases import KeptLease, LeaseStore
from rid_daq.service.store.tokens import hashed

LEAST_S: Final = 2.0
MOST_S: Final = 3600.0


class Leases:
    """The leases of the service's cells.

    A lease outlives a restart of the service, not one of the computer.

    Args:
        store: Where they are kept over a restart.
        now_s: The safety clock [s].
        boot: The start of the computer that `now_s` belongs to; this one if not given.
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

    def of(self, cell: str) -> Lease | None:
        """Return the lease of a cell, None where nobody has one that runs."""
        held = self._held(cell)
        return None if held is None else held.lease

    def end_s(self, cell: str, lease: str | None) -> float:
        """Return when a lease ends on the safety clock [s]; minus infinity where it has ended."""
        held = self._held(cell)
        return held.ends_s if held is not None and held.lease.id == lease else -inf

    def take(
        self, cell: str, who: Identity, note: str, seconds: float, confirmed: str | None = None
    ) -> HeldLease:
        """Give a cell to somebody.

        Args:
            who: Who asks.
            note: What for; others see it.
            seconds: How long it holds unless it is renewed [s].
            confirmed: The cell's name, typed by a person who takes it over from somebody.

        Raises:
            LockedError: Somebody has it.
            NotAllowedError: A program wants to take it over.
            ConfigError: The time is too short or too long, or the confirmation is not the cell's
                name.
        """
        self._check(seconds)
        running = self._held(cell)
        held = None if running is None else running.lease
        if running is not None and held is not None and confirmed is None:
            left_s = running.ends_s - self._now_s()
            raise LockedError(
                f"cell {cell}: {held.owner} has it ({held.note or 'no note'}; {left_s:.0f} s left"
                " unless renewed): wait, ask them, or take it over on the page",
                code="RID-LEASE-OTHER",
            )
        if held is not None and not who.person:
            raise NotAllowedError(
                f"cell {cell}: only a person takes it over from {held.owner}, on the page",
                code="RID-ACCESS-ROLE",
            )
        if held is not None and confirmed != cell:
            raise ConfigError(
                f"{confirmed!r} is not the cell's name {cell!r}: nothing was taken",
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
        self._store.put(KeptLease(lease, hashed(key), self._now_s() + seconds, self._boot))
        return HeldLease(**lease.model_dump(), key=key)

    def renew(self, cell: str, key: str, seconds: float) -> Lease:
        """Let a lease hold on.

        Raises:
            LockedError: It has run out, or somebody else has the cell.
        """
        self._check(seconds)
        held = self._require(cell, key)
        renewed = held.lease.model_copy(update={"until_s": time.time() + seconds})
        self._store.renew(replace(held, lease=renewed, ends_s=self._now_s() + seconds))
        return renewed

    def require(self, cell: str, key: str | None) -> Lease:
        """Return the lease whose key this is.

        Raises:
            LockedError: It is no key of the lease that runs.
        """
        return self._require(cell, key).lease

    def give_back(self, cell: str, key: str) -> None:
        """End a lease.

        Raises:
            LockedError: It is not this one.
        """
        self._require(cell, key)
        self._store.remove(cell)

    def end_of(self, token: str) -> list[str]:
        """End the leases that were taken with a token; return their cells."""
        cells = [lease.cell for lease in self._store.of_token(token) if self.of(lease.cell)]
        for cell in cells:
            self._store.remove(cell)
        return cells

    def _held(self, cell: str) -> KeptLease | None:
        """Return the lease of a cell that runs; None where there is none."""
        kept = self._store.get(cell)
        runs = kept is not None and kept.boot == self._boot and kept.ends_s > self._now_s()
        return kept if runs else None

    def _require(self, cell: str, key: str | None) -> KeptLease:
        held = self._held(cell)
        if held is None:
            raise LockedError(
                f"cell {cell}: take it first (a lease); nobody has it now", code="RID-LEASE-NONE"
            )
        if key is None or not held.has_key(key):
            raise LockedError(
                f"cell {cell}: {held.lease.owner} has it: this lease is not theirs",
                code="RID-LEASE-OTHER",
            )
        return held

    def _check(self, seconds: float) -> None:
        if not LEAST_S <= seconds <= MOST_S:
            raise ConfigError(
                f"seconds: {seconds:g}: give {LEAST_S:g} to {MOST_S:g}", code="RID-OPTION-RANGE"
            )
