"""`Pairing`: a new device shows a code, and a person at the cell types it."""

from __future__ import annotations

import hmac
import secrets
import time
from collections import Counter, deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from pydantic import Field

from config.errors import LockedError
from config.process.safety_clock import safety_now_s
from rid_daq.service.records import Record, Role, Token, TokenEnd
from rid_daq.service.refusals import UnknownError
from rid_daq.service.store.tokens import TokenStore, hashed

LASTS_S: Final = 300.0
MOST_WAITING: Final = 100
MOST_OF_ADDRESS: Final = 3
MOST_WRONG: Final = 10
"""Wrong codes that one token may show in `LASTS_S`: one in a million is right."""


class WaitingDevice(Record):
    """A device that waits. Its code is not listed: a person reads it on the device and types it."""

    code: str = Field(default="", description="Always empty.")
    device: str = Field(description="Its IP address; a device's own words prove nothing.")
    since_s: float


@dataclass(frozen=True)
class _Waiting:
    code: str
    secret_hash: str
    address: str
    since_s: float
    began_s: float
    secret: str = ""
    token: Token | None = None


class Pairing:
    """The devices that wait to be let in; nobody is told their codes but themselves.

    Args:
        tokens: Gives a confirmed device its token.
        ends: When that token ends.
        now_s: The safety clock [s].
    """

    def __init__(
        self,
        tokens: TokenStore,
        ends: TokenEnd = TokenEnd.UNUSED,
        now_s: Callable[[], float] = safety_now_s,
    ) -> None:
        self._tokens = tokens
        self._ends = ends
        self._now_s = now_s
        self._waiting: list[_Waiting] = []
        self._wrong: deque[tuple[float, str]] = deque()

    def begin(self, address: str) -> tuple[str, str]:
        """Return the code that a device shows, and the secret that it asks again with.

        Args:
            address: The device's IP address; its places do not count for other addresses.

        Raises:
            LockedError: Too many devices of this address wait (`RID-PAIR-ADDRESS-FULL`), or too
                many in all (`RID-PAIR-FULL`).
        """
        self._forget_old()
        if Counter(each.address for each in self._waiting)[address] >= MOST_OF_ADDRESS:
            raise LockedError(
                f"{MOST_OF_ADDRESS} devices of this address wait to be paired already: try again"
                " in 5 minutes",
                code="RID-PAIR-ADDRESS-FULL",
            )
        if len(self._waiting) >= MOST_WAITING:
            raise LockedError(
                f"{MOST_WAITING} devices wait to be paired already: try again in 5 minutes",
                code="RID-PAIR-FULL",
            )
        taken = {each.code for each in self._waiting}
        while (code := f"{secrets.randbelow(1_000_000):06d}") in taken:
            continue
        secret = secrets.token_urlsafe(24)
        waiting = _Waiting(code, hashed(secret), address, time.time(), self._now_s())
        self._waiting.append(waiting)
        return code, secret

    def waiting(self) -> Sequence[WaitingDevice]:
        """Return the devices that nobody has confirmed yet, without their codes."""
        self._forget_old()
        return [
            WaitingDevice(device=each.address, since_s=each.since_s)
            for each in self._waiting
            if each.token is None
        ]

    def confirm(self, code: str, name: str, role: Role, by: str = "") -> Token:
        """Let in the device that shows a code.

        Args:
            code: The code, as a person has typed it.
            name: The device's name, given by that person.
            by: The token of that person; wrong codes are counted for each.

        Raises:
            UnknownError: No device that waits shows it (`RID-PAIR-CODE`).
            LockedError: Too many codes were wrong (`RID-PAIR-ATTEMPTS`).
        """
        self._forget_old()
        if sum(each == by for _, each in self._wrong) >= MOST_WRONG:
            raise LockedError(
                f"{MOST_WRONG} codes were wrong in the last 5 minutes: wait, and have the device"
                " show a new code",
                code="RID-PAIR-ATTEMPTS",
            )
        for number, each in enumerate(self._waiting):
            if each.token is None and hmac.compare_digest(each.code.encode(), code.encode()):
                token, secret = self._tokens.add(name, role, person=True, ends=self._ends)
                self._waiting[number] = replace(each, token=token, secret=secret)
                return token
        self._wrong.append((self._now_s(), by))
        raise UnknownError(
            "no device that waits shows this code: look at its page again", code="RID-PAIR-CODE"
        )

    def collect(self, secret: str) -> str | None:
        """Return the token of the device that asks again; None until it is confirmed.

        Raises:
            UnknownError: It does not wait any more: it must begin again (`RID-PAIR-OVER`).
        """
        self._forget_old()
        for each in self._waiting:
            if hmac.compare_digest(each.secret_hash, hashed(secret)):
                if each.token is None:
                    return None
                self._waiting.remove(each)
                return each.secret
        raise UnknownError("this code has run out: begin again", code="RID-PAIR-OVER")

    def _forget_old(self) -> None:
        oldest_s = self._now_s() - LASTS_S
        self._waiting = [each for each in self._waiting if each.began_s > oldest_s]
        while self._wrong and self._wrong[0][0] <= oldest_s:
            self._wrong.popleft()
