"""`Authenticator`: identifies the sender of a request by the secret in the request.

No sender is trusted because of its address. With TLS, the certificate proves to a browser that it
talks to this service, and a cookie is safe. Without TLS, the service neither sets nor accepts
cookies: browsers send them to every port of 127.0.0.1, also to a program that uses this port later.
Without TLS a page therefore keeps a session secret in its own storage, which other ports cannot
read, and sends it as a bearer token. The secret expires when the service ends.
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
from rid_daq.service.store.tokens import UNUSED_S, TokenStore
from rid_daq.web.request_secrets import (
    all_secrets_of,
    bearer_of,
    cookies_of,
    hash_secret,
    socket_secret_of,
)

USE_NOTED_EVERY_S: Final = 60.0
LOCAL: Final = Identity(name="this computer", role=Role.ADMINISTRATOR, person=False, token="")


TICKET_S: Final = 30.0
MOST_TICKETS: Final = 1000


@dataclass(frozen=True)
class _Ticket:
    secret: str
    path: str
    until_s: float


class DownloadTickets:
    """Tickets for downloads: valid once, for one path, for 30 s. They are kept in memory only."""

    def __init__(self) -> None:
        self._tickets: dict[str, _Ticket] = {}

    def issue(self, secret: str, path: str) -> str:
        """Return a new ticket.

        Args:
            secret: Secret of the token that the ticket replaces.
            path: The only path for which the ticket is valid.
        """
        now_s = safety_now_s()
        self._tickets = {key: each for key, each in self._tickets.items() if each.until_s > now_s}
        while len(self._tickets) >= MOST_TICKETS:
            del self._tickets[next(iter(self._tickets))]
        ticket = secrets.token_urlsafe(24)
        self._tickets[hash_secret(ticket)] = _Ticket(secret, path, now_s + TICKET_S)
        return ticket

    def redeem(self, ticket: str, path: str) -> str | None:
        """Void a ticket and return the secret that it replaces.

        Returns:
            None if the ticket is not valid for the path.
        """
        found = self._tickets.pop(hash_secret(ticket), None)
        if found is None or found.path != path or safety_now_s() > found.until_s:
            return None
        return found.secret


class Authenticator:
    """Identifies the senders of requests.

    Args:
        tokens: Table of the tokens.
        port: Port of the pages. Cookies are the same for all ports, so their name contains the
            port.
        secure: True if pages are served with TLS.

    Attributes:
        pairing: Devices that wait for confirmation.
        tickets: Tickets of single downloads.
        link_secret: Last part of the address that the terminal shows; valid until the service ends.
    """

    def __init__(self, tokens: TokenStore, port: int, *, secure: bool) -> None:
        self.tokens = tokens
        tokens.end_sessions()
        self.secure = secure
        self.pairing = Pairing(tokens, TokenEnd.UNUSED if secure else TokenEnd.SERVICE)
        self.tickets = DownloadTickets()
        self.link_secret = secrets.token_urlsafe(32)
        self._cookie = f"__Host-rid-daq-{port}"
        self._noted: dict[str, float] = {}

    def require_identity(self, headers: Mapping[str, str], *, local: bool) -> Identity:
        """Return the identity of the sender.

        Args:
            headers: Headers of the request.
            local: True if the request arrived through the socket that only this user can open.

        Raises:
            NotKnownError: The request is not local, and contains no valid token.
        """
        found = self.find_identity(headers, local=local)
        if found is None:
            raise NotKnownError(
                "this request has no valid token: send one (Authorization: Bearer ...), or pair"
                " this device on its page",
                code="RID-ACCESS-UNKNOWN",
            )
        return found

    def find_identity(self, headers: Mapping[str, str], *, local: bool) -> Identity | None:
        """Return the sender's identity, None for a request from elsewhere without a valid token."""
        secret = self.secret_of(headers)
        token = None if secret is None else self.tokens.find_token(secret)
        if token is None:
            return LOCAL if local else None
        now_s = time.time()
        if now_s - self._noted.get(token.id, 0.0) > USE_NOTED_EVERY_S:
            self._noted[token.id] = now_s
            self.tokens.note_use(token)
        return Identity(name=token.name, role=token.role, person=token.person, token=token.id)

    def has_issued_secret(self, headers: Mapping[str, str]) -> bool:
        """Return True if a request contains a secret that was ever issued, even a revoked one."""
        return any(map(self.tokens.was_issued, all_secrets_of(headers)))

    def log_in(self, link_secret: str, agent: str = "") -> str:
        """Return the session secret of a browser that has opened the address from the terminal.

        Args:
            link_secret: Last part of that address.
            agent: User-agent header of the browser; the name of its token is built from it.

        Raises:
            NotAllowedError: The address belongs to an earlier start of the service.
        """
        if not hmac.compare_digest(link_secret.encode(), self.link_secret.encode()):
            raise NotAllowedError(
                "this address belongs to an earlier start of the service: use the address in its"
                " terminal",
                code="RID-ACCESS-UNKNOWN",
            )
        name = self._unused_name(browser_words(agent))
        _, secret = self.tokens.add(name, Role.ADMINISTRATOR, person=True, ends=TokenEnd.SERVICE)
        return secret

    def cookie(self, secret: str) -> str:
        """Return the Set-Cookie header with a session secret; only for TLS.

        The cookie expires with its token: when the browser ends, or 30 days after its last use.
        """
        if not self.secure:
            raise RuntimeError("cookies need TLS: without it, browsers send them to other programs")
        token = self.tokens.find_token(secret)
        lasts = f"; Max-Age={UNUSED_S:.0f}" if token and token.ends is TokenEnd.UNUSED else ""
        return f"{self._cookie}={secret}; Secure; HttpOnly; SameSite=Strict; Path=/{lasts}"

    def renewed_cookie(self, headers: Mapping[str, str]) -> str | None:
        """Return the Set-Cookie header that extends the access of a paired device.

        Returns:
            None for other senders.
        """
        secret = self.secret_of(headers)
        token = None if secret is None or not self.secure else self.tokens.find_token(secret)
        if secret is None or token is None or token.ends is not TokenEnd.UNUSED:
            return None
        return self.cookie(secret)

    def _unused_name(self, browser: str) -> str:
        """Return a name that no other token has: leases and the log of actions show it."""
        used_names = {token.name for token in self.tokens.all()}
        return next(
            name for n in itertools.count(1) if (name := f"{browser}, number {n}") not in used_names
        )

    def secret_of(self, headers: Mapping[str, str]) -> str | None:
        """Return the secret in a request, None if it contains no secret."""
        chosen = bearer_of(headers) or socket_secret_of(headers)
        if chosen or not self.secure:
            return chosen or None
        return next((value for name, value in cookies_of(headers) if name == self._cookie), None)


_SYSTEMS: Final = "Android|iPad|iPhone|Windows|Macintosh|Linux"
_BROWSERS: Final = MappingProxyType(
    {"Firefox": "Firefox", "Edg": "Edge", "Chrome": "Chrome", "Safari": "Safari"}
)
"""Mark of each browser in the user-agent header; browsers that also contain other marks come
first."""


def browser_words(agent: str) -> str:
    """Return a short name of browser and system from a user-agent header."""
    name = next((name for mark, name in _BROWSERS.items() if mark in agent), "browser")
    system = re.search(_SYSTEMS, agent)
    return f"{name} on {system[0]}" if system else name
