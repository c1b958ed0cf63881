"""`Access`: from where, under which name and with which secret the live page may be asked.

A browser on this machine also runs pages from unknown sites. They can send requests to 127.0.0.1,
but not choose their Host, Origin and Sec-Fetch-Site headers, nor send a header of their own without
asking first; so those are what is checked (DNS rebinding, cross-site requests).
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
import ssl
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from urllib.parse import urlsplit

from config.errors import ConfigError
from config.formats.bounded_file import read_file
from rid_daq.terminal.choices import DEFAULT_LISTEN
from rid_daq.web.request_secrets import bearer_of

LEAST_TOKEN_CHARACTERS = 32
MOST_TOKEN_BYTES = 1000
STOP_HEADER = "x-rid-daq"
_FETCH_SITES = ("same-origin", "none")


@dataclass(frozen=True)
class Access:
    """Who may ask for what.

    Attributes:
        address: The literal address that is listened on.
        port: Its port, once it is known.
        token: What a viewer must show; new at every start unless the user has given one.
        certificate: PEM file with certificate and key, for TLS.
        session: The secret in the page's addresses. It ends with the program, so that a page that
            stays open sends nothing of use to whichever program has the port afterwards.
    """

    address: str
    port: int
    token: str
    certificate: Path | None = None
    session: str = field(default_factory=lambda: secrets.token_urlsafe(32), repr=False)

    @classmethod
    def of_options(
        cls,
        listen: str = DEFAULT_LISTEN,
        token: Path | None = None,
        certificate: Path | None = None,
    ) -> Access:
        """Return what the user's options say; a loopback address is all that goes without more.

        Raises:
            ConfigError: The address is none, or can be reached from other machines and has no token
                or no TLS; a file is missing or too short.
        """
        address, port = _parse_listen(listen)
        if not ipaddress.ip_address(address).is_loopback and (token is None or certificate is None):
            missing = [
                option
                for option, given in (("--token FILE", token), ("--certificate FILE", certificate))
                if given is None
            ]
            raise ConfigError(
                f"--listen {listen}: other machines can reach this address, so the live page needs"
                f" {' and '.join(missing)} too (a secret, and TLS); without them it is served on"
                " 127.0.0.1 only",
                code="RID-LISTEN-UNPROTECTED",
            )
        secret = secrets.token_urlsafe(32) if token is None else _read_token(token)
        if certificate is not None and not certificate.is_file():
            raise ConfigError(
                f"--certificate {certificate}: there is no such file", code="RID-FILE-UNKNOWN"
            )
        return cls(address, port, secret, certificate)

    @classmethod
    def of_service(cls, listen: str, certificate: Path | None) -> Access:
        """Return what the options of `rid-daq serve` say; its tokens are its own.

        Raises:
            ConfigError: The address is none, or can be reached from other machines and has no TLS.
        """
        address, port = _parse_listen(listen)
        if not ipaddress.ip_address(address).is_loopback and certificate is None:
            raise ConfigError(
                f"--listen {listen}: other machines can reach this address, so it needs"
                " --certificate FILE (TLS); without it pages are served on 127.0.0.1 only",
                code="RID-LISTEN-UNPROTECTED",
            )
        if certificate is not None and not certificate.is_file():
            raise ConfigError(
                f"--certificate {certificate}: there is no such file", code="RID-FILE-UNKNOWN"
            )
        return cls(address, port, "", certificate)

    @property
    def scheme(self) -> str:
        """`https` with a certificate, else `http`."""
        return "http" if self.certificate is None else "https"

    @property
    def url(self) -> str:
        """What to open in a browser."""
        host = self.address
        if ipaddress.ip_address(host).is_unspecified:
            host = socket.gethostname()
        elif ":" in host:
            host = f"[{host}]"
        return f"{self.scheme}://{host}:{self.port}/?t={self.token}"

    def tls(self) -> ssl.SSLContext | None:
        """Return how connections are encrypted, None where they are not.

        Raises:
            ConfigError: The file does not hold a certificate and its key.
        """
        if self.certificate is None:
            return None
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        try:
            context.load_cert_chain(self.certificate, password="")  # a locked key must not ask
        except OSError as error:  # ssl.SSLError is one
            raise ConfigError(
                f"--certificate {self.certificate}: does not hold a certificate and its key (PEM,"
                f" without a passphrase): {error.strerror or error}",
                code="RID-LISTEN-CREDENTIALS",
            ) from None
        return context

    def is_own_name(self, host: str) -> bool:
        """Return whether a Host header names this server by an address that cannot be rebound."""
        try:
            parts = urlsplit(f"//{host}")
            name, port = parts.hostname, parts.port
        except ValueError:
            return False
        if name is None or parts.username is not None or parts.path or parts.query:
            return False
        if (port or (80 if self.certificate is None else 443)) != self.port:
            return False
        if name == "localhost":
            return True
        try:
            asked = ipaddress.ip_address(name)
        except ValueError:
            served = not ipaddress.ip_address(self.address).is_loopback
            return served and name == socket.gethostname().lower()
        if asked.is_loopback:
            return True
        own = ipaddress.ip_address(self.address)
        return own.is_unspecified or asked == own

    def is_own_page(self, headers: Mapping[str, str]) -> bool:
        """Return whether a request comes from our page, from the address bar, or from no browser.

        Args:
            headers: By lower-case name; `host` has been found to be our own name.
        """
        origin = headers.get("origin")
        if origin is not None and origin != f"{self.scheme}://{headers.get('host', '')}":
            return False
        return headers.get("sec-fetch-site", "none") in _FETCH_SITES

    def knows(self, token: str) -> bool:
        """Return whether this is the token, in a time that does not tell how much of it is."""
        return hmac.compare_digest(token.encode(), self.token.encode())

    def admits(self, headers: Mapping[str, str], session: str | None) -> bool:
        """Return whether a request shows the token as bearer, or the session in its address."""
        bearer = bearer_of(headers)
        if bearer and self.knows(bearer):
            return True
        return session is not None and hmac.compare_digest(session.encode(), self.session.encode())


def is_loopback(address: str) -> bool:
    """Return whether an IP address is one of this computer's own."""
    try:
        found = ipaddress.ip_address(address.partition("%")[0])
    except ValueError:
        return False
    mapped = getattr(found, "ipv4_mapped", None)
    return found.is_loopback or (mapped is not None and mapped.is_loopback)


def _parse_listen(listen: str) -> tuple[str, int]:
    try:
        parts = urlsplit(f"//{listen}")
        name, port = parts.hostname, parts.port
    except ValueError:
        name, port = None, None
    if name == "localhost":
        name = "127.0.0.1"
    try:
        if name is None or port is None:
            raise ValueError
        return str(ipaddress.ip_address(name)), port
    except ValueError:
        raise ConfigError(
            f"--listen {listen}: give a literal address and a port, as {DEFAULT_LISTEN} or"
            " [::1]:8642; port 0 takes any that is free",
            code="RID-LISTEN-ADDRESS",
        ) from None


def _read_token(path: Path) -> str:
    try:
        token = read_file(path, MOST_TOKEN_BYTES).decode("ascii").strip()
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(
            f"--token {path}: cannot be read: {error}", code="RID-FILE-READ"
        ) from None
    if len(token) < LEAST_TOKEN_CHARACTERS or not all(c.isalnum() or c in "-_" for c in token):
        raise ConfigError(
            f"--token {path}: must hold {LEAST_TOKEN_CHARACTERS} or more letters, digits, - or _;"
            " `openssl rand -hex 32` makes one",
            code="RID-LISTEN-CREDENTIALS",
        )
    return token
