"""`Doorkeeper`: who asks, by what they show; nobody is trusted for where they ask from."""

from __future__ import annotations

import hmac
import itertools
import re
import secrets
import time
from collections.abc import Mapping
from types import MappingProxyType
from typing import Final

from rid_daq.service.pairing import Pairing
from rid_daq.service.records import Identity, Role
from rid_daq.service.refusals import NotAllowedError, NotKnownError
from rid_daq.service.store.tokens import TokenStore

USE_NOTED_EVERY_S: Final = 60.0
LOCAL: Final = Identity(name="this computer", role=Role.ADMINISTRATOR, person=False, token="")


class Doorkeeper:
    """Tells who somebody is.

    Parameters
    ----------
    tokens : TokenStore
        Who is let in.
    port : int
        Where pages are served: cookies do not know ports, so their name does.
    secure : bool
        Whether cookies are for TLS alone.

    Attributes
    ----------
    pairing : Pairing
        The devices that wait.
    link_secret : str
        What the address shown in the terminal ends in; good as long as the service runs.
    """

    def __init__(self, tokens: TokenStore, port: int, *, secure: bool) -> None:
        self.tokens = tokens
        self.pairing = Pairing(tokens)
        self.link_secret = secrets.token_urlsafe(32)
        self._cookie = f"rid_daq_service_{port}"
        self._secure = secure
        self._noted: dict[str, float] = {}

    def identity(self, headers: Mapping[str, str], *, local: bool) -> Identity:
        """Return who asks.

        Parameters
        ----------
        headers
            Of the request.
        local
            Whether it came by the socket that only this user can open.

        Raises
        ------
        NotKnownError
            It shows no token that is known.
        """
        found = self.look(headers, local=local)
        if found is None:
            raise NotKnownError(
                "show a token (Authorization: Bearer ...), or pair this device on its page"
            )
        return found

    def look(self, headers: Mapping[str, str], *, local: bool) -> Identity | None:
        """Return who asks, None where nobody knows."""
        secret = self._shown(headers)
        token = None if secret is None else self.tokens.known(secret)
        if token is None:
            return LOCAL if local else None
        now_s = time.time()
        if now_s - self._noted.get(token.id, 0.0) > USE_NOTED_EVERY_S:
            self._noted[token.id] = now_s
            self.tokens.note_use(token)
        return Identity(name=token.name, role=token.role, person=token.person, token=token.id)

    def was_let_in(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request shows a secret that was ever issued, also a revoked one."""
        secret = self._shown(headers)
        return secret is not None and self.tokens.was_issued(secret)

    def log_in(self, link_secret: str, agent: str = "") -> str:
        """Return the cookie of somebody who has opened the address from the terminal.

        Parameters
        ----------
        link_secret : str
            What the address ends in.
        agent : str
            What the browser says of itself; its name is made of it, with a number.

        Raises
        ------
        NotAllowedError
            It is another address.
        """
        if not hmac.compare_digest(link_secret.encode(), self.link_secret.encode()):
            raise NotAllowedError(
                "this address is of another start of the service: see its terminal"
            )
        name = self._name_of(browser_words(agent))
        _, secret = self.tokens.add(name, Role.ADMINISTRATOR, person=True)
        return self.cookie(secret)

    def cookie(self, secret: str) -> str:
        """Return the Set-Cookie header that holds a token."""
        secure = "; Secure" if self._secure else ""
        return (
            f"{self._cookie}={secret}; HttpOnly; SameSite=Strict; Path=/; Max-Age=31536000{secure}"
        )

    def _name_of(self, browser: str) -> str:
        """Return a name that no token has: leases and the log of who did what tell them apart."""
        taken = {token.name for token in self.tokens.all()}
        return next(
            name for n in itertools.count(1) if (name := f"{browser}, number {n}") not in taken
        )

    def _shown(self, headers: Mapping[str, str]) -> str | None:
        kind, _, bearer = headers.get("authorization", "").partition(" ")
        if kind.lower() == "bearer" and bearer.strip():
            return bearer.strip()
        cookies = (each.partition("=") for each in headers.get("cookie", "").split(";"))
        found = (value.strip() for name, _, value in cookies if name.strip() == self._cookie)
        return next(found, None)


_SYSTEMS: Final = "Android|iPad|iPhone|Windows|Macintosh|Linux"
_BROWSERS: Final = MappingProxyType(
    {"Firefox": "Firefox", "Edg": "Edge", "Chrome": "Chrome", "Safari": "Safari"}
)
"""What marks a browser, the ones first that say to be others too."""


def browser_words(agent: str) -> str:
    """Return what a browser says of itself, shortened to what a person recognises."""
    name = next((name for mark, name in _BROWSERS.items() if mark in agent), "browser")
    system = re.search(_SYSTEMS, agent)
    return f"{name} on {system[0]}" if system else name
