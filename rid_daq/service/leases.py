"""`Leases`: motion is one person's. Who may move a cell, given, renewed, taken over, run out."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from typing import Final

from config.errors import ConfigError, LockedError
from rid_daq.service.records import HeldLease, Identity, Lease
from rid_daq.service.refusals import NotAllowedError
from rid_daq.service.store.leases import LeaseStore

LEAST_S: Final = 2.0
MOST_S: Final = 3600.0


class Leases:
    """The leases of the service's cells.

    Parameters
    ----------
    store : LeaseStore
        Where they are kept over a restart.
    now_s : callable
        The time since 1970 [s].
    """

    def __init__(self, store: LeaseStore, now_s: Callable[[], float] = time.time) -> None:
        self._store = store
        self._now_s = now_s

    def of(self, cell: str) -> Lease | None:
        """Return the lease of a cell, None where nobody has one that runs."""
        lease = self._store.get(cell)
        return lease if lease is not None and lease.until_s > self._now_s() else None

    def take(
        self, cell: str, who: Identity, note: str, seconds: float, confirmed: str | None = None
    ) -> HeldLease:
        """Give a cell to somebody.

        Parameters
        ----------
        cell : str
            The cell.
        who : Identity
            Who asks.
        note : str
            What for; others see it.
        seconds : float
            How long it holds unless it is renewed [s].
        confirmed : str, optional
            The cell's name, typed by a person who takes it over from somebody.

        Raises
        ------
        LockedError
            Somebody has it.
        NotAllowedError
            A program wants to take it over.
        ConfigError
            The time is too short or too long, or the confirmation is not the cell's name.
        """
        self._check(seconds)
        held = self.of(cell)
        if held is not None and confirmed is None:
            left_s = held.until_s - self._now_s()
            raise LockedError(
                f"cell {cell}: {held.owner} has it ({held.note or 'no note'}; {left_s:.0f} s left"
                " unless renewed): wait, ask them, or take it over on the page"
            )
        if held is not None and not who.person:
            raise NotAllowedError(
                f"cell {cell}: only a person takes it over from {held.owner}, on the page"
            )
        if held is not None and confirmed != cell:
            raise ConfigError(f"{confirmed!r} is not the cell's name {cell!r}: nothing was taken")
        lease = Lease(
            id=secrets.token_hex(8),
            cell=cell,
            owner=who.name,
            note=note,
            person=who.person,
            until_s=self._now_s() + seconds,
        )
        key = secrets.token_urlsafe(24)
        self._store.note_token(lease, who.token)
        self._store.put(lease, key)
        return HeldLease(**lease.model_dump(), key=key)

    def renew(self, cell: str, key: str, seconds: float) -> Lease:
        """Let a lease hold on.

        Raises
        ------
        LockedError
            It has run out, or somebody else has the cell.
        """
        self._check(seconds)
        lease = self.require(cell, key)
        renewed = lease.model_copy(update={"until_s": self._now_s() + seconds})
        self._store.renew(renewed)
        return renewed

    def require(self, cell: str, key: str | None) -> Lease:
        """Return the lease whose key this is.

        Raises
        ------
        LockedError
            It is no key of the lease that runs.
        """
        lease = self.of(cell)
        if lease is None:
            raise LockedError(f"cell {cell}: take it first (a lease); nobody has it now")
        if key is None or not self._store.has_key(cell, key):
            raise LockedError(f"cell {cell}: {lease.owner} has it: this lease is not theirs")
        return lease

    def give_back(self, cell: str, key: str) -> None:
        """End a lease.

        Raises
        ------
        LockedError
            It is not this one.
        """
        self.require(cell, key)
        self._store.remove(cell)

    def end_of(self, token: str) -> list[str]:
        """End the leases that were taken with a token; return their cells."""
        cells = [lease.cell for lease in self._store.of_token(token) if self.of(lease.cell)]
        for cell in cells:
            self._store.remove(cell)
        return cells

    def _check(self, seconds: float) -> None:
        if not LEAST_S <= seconds <= MOST_S:
            raise ConfigError(f"seconds: {seconds:g}: give {LEAST_S:g} to {MOST_S:g}")
