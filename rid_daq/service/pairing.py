"""`Pairing`: a new device shows a code, and somebody at the cell confirms it."""

from __future__ import annotations

import hmac
import secrets
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

from config.errors import LockedError
from config.process.safety_clock import safety_now_s
from rid_daq.service.records import Record, Role, Token
from rid_daq.service.refusals import UnknownError
from rid_daq.service.store.tokens import TokenStore, hashed

LASTS_S: Final = 300.0
MOST_WAITING: Final = 10


class WaitingDevice(Record):
    """A device that waits, as those who may confirm it see it."""

    code: str
    device: str
    since_s: float


@dataclass(frozen=True)
class _Waiting:
    code: str
    secret_hash: str
    device: str
    since_s: float
    began_s: float
    secret: str = ""
    token: Token | None = None


class Pairing:
    """The devices that wait to be let in.

    Parameters
    ----------
    tokens : TokenStore
        Where a confirmed device gets its token.
    now_s : callable
        The safety clock [s].
    """

    def __init__(self, tokens: TokenStore, now_s: Callable[[], float] = safety_now_s) -> None:
        self._tokens = tokens
        self._now_s = now_s
        self._waiting: list[_Waiting] = []

    def begin(self, device: str) -> tuple[WaitingDevice, str]:
        """Return the code that a device shows, and the secret that it asks again with.

        Raises
        ------
        LockedError
            Too many wait already.
        """
        self._forget_old()
        if len(self._waiting) >= MOST_WAITING:
            raise LockedError("too many devices wait to be paired: try again in some minutes")
        taken = {each.code for each in self._waiting}
        while (code := f"{secrets.randbelow(1_000_000):06d}") in taken:
            continue
        secret = secrets.token_urlsafe(24)
        clean = "".join(c for c in device[:80] if c.isprintable())
        self._waiting.append(_Waiting(code, hashed(secret), clean, time.time(), self._now_s()))
        return self.waiting()[-1], secret

    def waiting(self) -> Sequence[WaitingDevice]:
        """Return the devices that nobody has confirmed yet."""
        self._forget_old()
        return [
            WaitingDevice(code=each.code, device=each.device, since_s=each.since_s)
            for each in self._waiting
            if each.token is None
        ]

    def confirm(self, code: str, name: str, role: Role) -> Token:
        """Let in the device that shows a code.

        Raises
        ------
        UnknownError
            No device that waits shows it.
        """
        self._forget_old()
        for number, each in enumerate(self._waiting):
            if each.token is None and hmac.compare_digest(each.code.encode(), code.encode()):
                token, secret = self._tokens.add(name, role, person=True)
                self._waiting[number] = replace(each, token=token, secret=secret)
                return token
        raise UnknownError(f"no device that waits shows {code!r}: look at its page again")

    def collect(self, secret: str) -> str | None:
        """Return the token of the device that asks again; None while nobody has confirmed it.

        Raises
        ------
        UnknownError
            It does not wait any more: it must begin again.
        """
        self._forget_old()
        for each in self._waiting:
            if hmac.compare_digest(each.secret_hash, hashed(secret)):
                if each.token is None:
                    return None
                self._waiting.remove(each)
                return each.secret
        raise UnknownError("this code has run out: begin again")

    def _forget_old(self) -> None:
        oldest_s = self._now_s() - LASTS_S
        self._waiting = [each for each in self._waiting if each.began_s > oldest_s]
