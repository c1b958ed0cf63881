"""`Pairing`: gives a new device access after a person has typed the code that it shows."""

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
from rid_daq.service.store.tokens import TokenStore
from rid_daq.web.request_secrets import hash_secret

LASTS_S: Final = 300.0
MOST_WAITING: Final = 100
MOST_OF_ADDRESS: Final = 3
MOST_WRONG: Final = 10
"""Maximum number of wrong codes per token within `LASTS_S`; a guess matches a waiting device with
probability 1e-6.
"""


class WaitingDevice(Record):
    """Device that waits for confirmation.

    The list contains no codes: a person reads the code on the device.
    """

    code: str = Field(default="", description="Always empty.")
    device: str = Field(description="IP address of the device; its own description is not trusted.")
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
    """Devices that wait for confirmation. Only the device itself receives its code.

    Args:
        tokens: Creates the token of a confirmed device.
        ends: Expiry of that token.
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
        """Return the code that a device shows, and the secret with which it polls for its token.

        Args:
            address: IP address of the device. Each address has its own limit of waiting devices.

        Raises:
            LockedError: Too many devices of this address, or too many in all, wait
                (`RID-PAIR-FULL`).
        """
        self._forget_old()
        if Counter(each.address for each in self._waiting)[address] >= MOST_OF_ADDRESS:
            raise LockedError(
                f"{MOST_OF_ADDRESS} devices with this address already wait for confirmation: try"
                " again in 5 minutes",
                code="RID-PAIR-FULL",
            )
        if len(self._waiting) >= MOST_WAITING:
            raise LockedError(
                f"{MOST_WAITING} devices already wait for confirmation: try again in 5 minutes",
                code="RID-PAIR-FULL",
            )
        used_codes = {each.code for each in self._waiting}
        while (code := f"{secrets.randbelow(1_000_000):06d}") in used_codes:
            continue
        secret = secrets.token_urlsafe(24)
        waiting = _Waiting(code, hash_secret(secret), address, time.time(), self._now_s())
        self._waiting.append(waiting)
        return code, secret

    def waiting(self) -> Sequence[WaitingDevice]:
        """Return the unconfirmed devices, without their codes."""
        self._forget_old()
        return [
            WaitingDevice(device=each.address, since_s=each.since_s)
            for each in self._waiting
            if each.token is None
        ]

    def confirm(self, code: str, name: str, role: Role, by: str = "") -> Token:
        """Grant access to the device that shows a code.

        Args:
            code: The code, as a person has typed it.
            name: Name of the device, chosen by that person.
            by: Id of that person's token; wrong codes are counted per token.

        Raises:
            UnknownError: No waiting device shows this code (`RID-PAIR-CODE`).
            LockedError: Too many wrong codes were typed (`RID-PAIR-ATTEMPTS`).
        """
        self._forget_old()
        if sum(each == by for _, each in self._wrong) >= MOST_WRONG:
            raise LockedError(
                f"{MOST_WRONG} wrong codes were typed in the last 5 minutes: wait 5 minutes, then"
                " let the device show a new code",
                code="RID-PAIR-ATTEMPTS",
            )
        for number, each in enumerate(self._waiting):
            if each.token is None and hmac.compare_digest(each.code.encode(), code.encode()):
                token, secret = self._tokens.add(name, role, person=True, ends=self._ends)
                self._waiting[number] = replace(each, token=token, secret=secret)
                return token
        self._wrong.append((self._now_s(), by))
        raise UnknownError(
            "no waiting device shows this code: read the code on the device's page again",
            code="RID-PAIR-CODE",
        )

    def collect(self, secret: str) -> str | None:
        """Return the token of a confirmed device; None if it still waits for confirmation.

        Args:
            secret: The secret that `begin` returned to the device.

        Raises:
            UnknownError: The device no longer waits: pairing must start again (`RID-PAIR-OVER`).
        """
        self._forget_old()
        for each in self._waiting:
            if hmac.compare_digest(each.secret_hash, hash_secret(secret)):
                if each.token is None:
                    return None
                self._waiting.remove(each)
                return each.secret
        raise UnknownError(
            "this pairing code has expired: start the pairing again", code="RID-PAIR-OVER"
        )

    def _forget_old(self) -> None:
        oldest_s = self._now_s() - LASTS_S
        self._waiting = [each for each in self._waiting if each.began_s > oldest_s]
        while self._wrong and self._wrong[0][0] <= oldest_s:
            self._wrong.popleft()
