"""`Access`: the addresses, names and secrets with which clients may use the web server.

A browser on this computer also runs pages of unknown sites. Such a page can send requests to
127.0.0.1. It cannot choose their Host, Origin and Sec-Fetch-Site headers, and it cannot add its own
header without a preflight request. The server therefore checks these headers (against DNS rebinding
and cross-site requests).
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
    """Address and secrets of the web server.

    Attributes:
        address: IP address on which the server listens.
        port: Port of the server, 0 until it is known.
        token: Secret that a viewer must send; new at every start unless the user sets one.
        certificate: PEM file with certificate and key, for TLS.
        session: Secret in the addresses of the page. It expires when the program ends: a page that
            stays open cannot give a valid secret to another program that uses the port later.
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
        """Return the access according to the user's options (default: a loopback address only).

        Raises:
            ConfigError: The address is invalid, or other computers can reach it and it has no token
                or no TLS; or the file of the token or certificate cannot be used.
        """
        address, port = _parse_listen(listen)
        if not ipaddress.ip_address(address).is_loopback and (token is None or certificate is None):
            missing = [
                option
                for option, given in (("--token FILE", token), ("--certificate FILE", certificate))
                if given is None
            ]
            raise ConfigError(
                f"--listen {listen}: other computers can reach this address, so the live page"
                f" also needs {' and '.join(missing)} (a secret, and TLS); without them it is"
                " served on 127.0.0.1 only",
                code="RID-LISTEN-UNPROTECTED",
            )
        secret = secrets.token_urlsafe(32) if token is None else _read_token(token)
        if certificate is not None and not certificate.is_file():
            raise ConfigError(
                f"--certificate {certificate}: the file does not exist", code="RID-FILE-UNKNOWN"
            )
        return cls(address, port, secret, certificate)

    @classmethod
    def of_service(cls, listen: str, certificate: Path | None) -> Access:
        """Return the access according to the options of `rid-daq serve`, with an empty token.

        The service has a table of tokens instead.

        Raises:
            ConfigError: The address is invalid, or other computers can reach it and it has no TLS.
        """
        address, port = _parse_listen(listen)
        if not ipaddress.ip_address(address).is_loopback and certificate is None:
            raise ConfigError(
                f"--listen {listen}: other computers can reach this address, so it needs"
                " --certificate FILE (TLS); without it pages are served on 127.0.0.1 only",
                code="RID-LISTEN-UNPROTECTED",
            )
        if certificate is not None and not certificate.is_file():
            raise ConfigError(
                f"--certificate {certificate}: the file does not exist", code="RID-FILE-UNKNOWN"
            )
        return cls(address, port, "", certificate)

    @property
    def scheme(self) -> str:
        """`https` with a certificate, else `http`."""
        return "http" if self.certificate is None else "https"

    @property
    def url(self) -> str:
        """Address to open in a browser."""
        host = self.address
        if ipaddress.ip_address(host).is_unspecified:
            host = socket.gethostname()
        elif ":" in host:
            host = f"[{host}]"
        return f"{self.scheme}://{host}:{self.port}/?t={self.token}"

    def tls(self) -> ssl.SSLContext | None:
        """Return the TLS settings of connections, None without TLS.

        Raises:
            ConfigError: The file does not contain a certificate and its key.
        """
        if self.certificate is None:
            return None
        context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
        context.minimum_version = ssl.TLSVersion.TLSv1_2
        try:
            # the empty password prevents a prompt for the passphrase of an encrypted key
            context.load_cert_chain(self.certificate, password="")
        except OSError as error:  # ssl.SSLError is an OSError
            raise ConfigError(
                f"--certificate {self.certificate}: does not contain a certificate and its key"
                f" (PEM, without a passphrase): {error.strerror or error}",
                code="RID-LISTEN-CREDENTIALS",
            ) from None
        return context

    def is_own_name(self, host: str) -> bool:
        """Return True if a Host header names this server by a name that no other site can have.

        These names are its IP addresses, localhost, and its host name if other computers can reach
        it.
        """
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
            requested = ipaddress.ip_address(name)
        except ValueError:
            served = not ipaddress.ip_address(self.address).is_loopback
            return served and name == socket.gethostname().lower()
        if requested.is_loopback:
            return True
        own = ipaddress.ip_address(self.address)
        return own.is_unspecified or requested == own

    def is_own_page(self, headers: Mapping[str, str]) -> bool:
        """Return True if a request comes from our own page, the address bar, or a program.

        Args:
            headers: Headers by lower-case name; `host` was found to be a name of this server.
        """
        origin = headers.get("origin")
        if origin is not None and origin != f"{self.scheme}://{headers.get('host', '')}":
            return False
        return headers.get("sec-fetch-site", "none") in _FETCH_SITES

    def is_token(self, token: str) -> bool:
        """Return True if the text is the token; the comparison takes the same time for any text."""
        return hmac.compare_digest(token.encode(), self.token.encode())

    def admits(self, headers: Mapping[str, str], session: str | None) -> bool:
        """Return True if a request contains the bearer token, or the session secret in its URL."""
        bearer = bearer_of(headers)
        if bearer and self.is_token(bearer):
            return True
        return session is not None and hmac.compare_digest(session.encode(), self.session.encode())


def is_loopback(address: str) -> bool:
    """Return True if an IP address is a loopback address."""
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
            f"--listen {listen}: give an IP address and a port, for example {DEFAULT_LISTEN} or"
            " [::1]:8642; port 0 selects a free port",
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
            f"--token {path}: must contain at least {LEAST_TOKEN_CHARACTERS} letters, digits, -"
            " or _; `openssl rand -hex 32` creates one",
            code="RID-LISTEN-CREDENTIALS",
        )
    return token
