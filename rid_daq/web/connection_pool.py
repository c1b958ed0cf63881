"""`ConnectionPool`: connections in one state; no owner can keep the others out."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterator
from typing import Generic, TypeVar

Member = TypeVar("Member")


class ConnectionPool(Generic[Member]):
    """Members and the keys of their owners; the owner with the most members loses members first.

    Args:
        most: Maximum number of members.
        most_of_one: Maximum number of members of one owner.
    """

    def __init__(self, most: int, most_of_one: int | None = None) -> None:
        self._most = most
        self._most_of_one = most if most_of_one is None else most_of_one
        self._keys: dict[Member, str] = {}
        self._of: dict[str, OrderedDict[Member, None]] = {}

    def __len__(self) -> int:
        return len(self._keys)

    def __iter__(self) -> Iterator[Member]:
        return iter(tuple(self._keys))

    def __contains__(self, member: object) -> bool:
        return member in self._keys

    def add(self, member: Member, key: str) -> Member | None:
        """Add a member.

        Returns:
            The member that loses its place: the oldest member of the same owner if it has too many,
            or else of the owner with the most members. None if there was a free place.
        """
        self._keys[member] = key
        own = self._of.setdefault(key, OrderedDict())
        own[member] = None
        if len(own) > self._most_of_one:
            return self._remove_oldest(own)
        if len(self._keys) > self._most:
            return self._remove_oldest(max(self._of.values(), key=len))
        return None

    def has_place(self, key: str) -> bool:
        """Return True if an owner may add a connection.

        If there is no free place, another owner must have more members, even after the addition.
        """
        own = len(self._of.get(key, ()))
        if own >= self._most_of_one:
            return False
        return len(self._keys) < self._most or own + 1 < max(map(len, self._of.values()))

    def remove(self, member: Member) -> bool:
        """Remove a member; return True if it was in the pool."""
        key = self._keys.pop(member, None)
        if key is None:
            return False
        own = self._of[key]
        del own[member]
        if not own:
            del self._of[key]
        return True

    def _remove_oldest(self, own: OrderedDict[Member, None]) -> Member:
        oldest = next(iter(own))
        self.remove(oldest)
        return oldest
