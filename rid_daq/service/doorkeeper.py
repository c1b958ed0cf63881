"""`Doorkeeper`: who asks, by what they show; nobody is trusted for where they ask from.

With TLS the certificate proves that a browser talks to this service, and a cookie is safe. Without
TLS cookies are neither given nor taken: browsers send them to every port of 127.0.0.1, and to
whoever has this port after the service. There a page keeps a session secret in its own storage,
which other ports cannot read, sends it as a bearer token, and it ends with this run of the service.
"""

from __future__ import annotations

import hmac
import itertools
import re
import secrets
import time
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Final

from config.process.safety_clock import safety_now_s
from rid_daq.service.pairing import Pairing
from rid_daq.service.records import Identity, Role, TokenEnd
from rid_daq.service.refusals import NotAllowedError, NotKnownError
from rid_daq.service.store.tokens import UNUSED_S, TokenStore, hashed
from rid_daq.web.request_secrets import bearer_of, cookies_of, secrets_of, socket_secret_of

USE_NOTED_EVERY_S: Final = 60.0
LOCAL: Final = Identity(name="this computer", role=Role.ADMINISTRATOR, person=False, token="")


TICKET_S: Final = 30.0
MOST_TICKETS: Final = 1000


@dataclass(frozen=True)
class _Ticket:
    secret: str
    path: str
    until_s: float


class DoorTickets:
    """Tickets that are good once, for one path, for 30 s. They are kept in memory only."""

    def __init__(self) -> None:
        self._tickets: dict[str, _Ticket] = {}

    def issue(self, secret: str, path: str) -> str:
        """Return a ticket.

        Args:
            secret: The secret of the token that it stands for.
            path: The only path that it is good for.
        """
        now_s = safety_now_s()
        self._tickets = {key: each for key, each in self._tickets.items() if each.until_s > now_s}
        while len(self._tickets) >= MOST_TICKETS:
            del self._tickets[next(iter(self._tickets))]
        ticket = secrets.token_urlsafe(24)
        self._tickets[hashed(ticket)] = _Ticket(secret, path, now_s + TICKET_S)
        return ticket

    def take(self, ticket: str, path: str) -> str | None:
        """Return the secret that a ticket stands for, and void it; None if it is not good here."""
        found = self._tickets.pop(hashed(ticket), None)
        if found is None or found.path != path or safety_now_s() > found.until_s:
            return None
        return found.secret


class Doorkeeper:
    """Tells who somebody is.

    Args:
        tokens: Who is let in.
        port: Where pages are served: cookies do not know ports, so their name does.
        secure: Whether pages are served by TLS.

    Attributes:
        pairing: The devices that wait.
        tickets: Tickets of single downloads.
        link_secret: What the address shown in the terminal ends in; good as long as the service
            runs.
    """

    def __init__(self, tokens: TokenStore, port: int, *, secure: bool) -> None:
        self.tokens = tokens
        tokens.end_sessions()
        self.secure = secure
        self.pairing = Pairing(tokens, TokenEnd.UNUSED if secure else TokenEnd.SERVICE)
        self.tickets = DoorTickets()
        self.link_secret = secrets.token_urlsafe(32)
        self._cookie = f"__Host-rid-daq-{port}"
        self._noted: dict[str, float] = {}

    def identity(self, headers: Mapping[str, str], *, local: bool) -> Identity:
        """Return who asks.

        Args:
            headers: Of the request.
            local: Whether it came by the socket that only this user can open.

        Raises:
            NotKnownError: It shows no token that is known.
        """
        found = self.look(headers, local=local)
        if found is None:
            raise NotKnownError(
                "show a token (Authorization: Bearer ...), or pair this device on its page",
                code="RID-ACCESS-UNKNOWN",
            )
        return found

    def look(self, headers: Mapping[str, str], *, local: bool) -> Identity | None:
        """Return who asks, None where nobody knows."""
        secret = self.secret_of(headers)
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
        return any(map(self.tokens.was_issued, secrets_of(headers)))

    def log_in(self, link_secret: str, agent: str = "") -> str:
        """Return the session secret of a browser that has opened the address from the terminal.

        Args:
            link_secret: What the address ends in.
            agent: What the browser says of itself; its name is made of it, with a number.

        Raises:
            NotAllowedError: It is another address.
        """
        if not hmac.compare_digest(link_secret.encode(), self.link_secret.encode()):
            raise NotAllowedError(
                "this address is of another start of the service: see its terminal",
                code="RID-ACCESS-UNKNOWN",
            )
        name = self._name_of(browser_words(agent))
        _, secret = self.tokens.add(name, Role.ADMINISTRATOR, person=True, ends=TokenEnd.SERVICE)
        return secret

    def cookie(self, secret: str) -> str:
        """Return the Set-Cookie header that holds a session secret; only for TLS.

        It lasts as long as its token: to the browser's end, or 30 days after its last use.
        """
        if not self.secure:
            raise RuntimeError("a cookie without TLS would be sent to other programs")
        token = self.tokens.known(secret)
        lasts = f"; Max-Age={UNUSED_S:.0f}" if token and token.ends is TokenEnd.UNUSED else ""
        return f"{self._cookie}={secret}; Secure; HttpOnly; SameSite=Strict; Path=/{lasts}"

    def renewed_cookie(self, headers: Mapping[str, str]) -> str | None:
        """Return the Set-Cookie header that keeps a paired device let in while it is used."""
        secret = self.secret_of(headers)
        token = None if secret is None or not self.secure else self.tokens.known(secret)
        if secret is None or token is None or token.ends is not TokenEnd.UNUSED:
            return None
        return self.cookie(secret)

    def _name_of(self, browser: str) -> str:
        """Return a name that no token has: leases and the log of who did what tell them apart."""
        taken = {token.name for token in self.tokens.all()}
        return next(
            name for n in itertools.count(1) if (name := f"{browser}, number {n}") not in taken
        )

    def secret_of(self, headers: Mapping[str, str]) -> str | None:
        """Return the secret that a request shows, None if it shows none."""
        chosen = bearer_of(headers) or socket_secret_of(headers)
        if chosen or not self.secure:
            return chosen or None
        return next((value for name, value in cookies_of(headers) if name == self._cookie), None)


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
