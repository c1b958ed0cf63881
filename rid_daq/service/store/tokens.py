"""`TokenStore`: who is let in; only the hash of what they show is kept."""

from __future__ import annotations

import hashlib
import secrets
import sqlite3
import time
from collections.abc import Sequence

from rid_daq.service.records import Role, Token


def hashed(secret: str) -> str:
    """Return the SHA-256 of a secret; enough for what is 256 random bits."""
    return hashlib.sha256(secret.encode()).hexdigest()


class TokenStore:
    """The table of tokens.

    Parameters
    ----------
    connection : sqlite3.Connection
        Of the service's file.
    """

    def __init__(self, connection: sqlite3.Connection) -> None:
        self._connection = connection

    def add(self, name: str, role: Role, *, person: bool) -> tuple[Token, str]:
        """Make a token; its secret is returned here and nowhere else."""
        secret = secrets.token_urlsafe(32)
        token = Token(
            id=secrets.token_hex(8), name=name, role=role, person=person, created_s=time.time()
        )
        self._connection.execute(
            "INSERT INTO tokens VALUES (?, ?, ?)",
            (token.id, hashed(secret), token.model_dump_json()),
        )
        return token, secret

    def known(self, secret: str) -> Token | None:
        """Return the token of a secret, None where it is nobody's."""
        row = self._connection.execute(
            "SELECT token FROM tokens WHERE hash = ?", (hashed(secret),)
        ).fetchone()
        return None if row is None else Token.model_validate_json(row[0])

    def note_use(self, token: Token) -> None:
        """Write that a token was used now."""
        used = token.model_copy(update={"used_s": time.time()})
        self._connection.execute(
            "UPDATE tokens SET token = ? WHERE id = ?", (used.model_dump_json(), token.id)
        )

    def all(self) -> Sequence[Token]:
        """Return the tokens, without their secrets."""
        rows = self._connection.execute("SELECT token FROM tokens")
        return sorted(
            (Token.model_validate_json(row[0]) for row in rows), key=lambda each: each.created_s
        )

    def revoke(self, token_id: str) -> bool:
        """Forget a token; return whether there was one."""
        done = self._connection.execute("DELETE FROM tokens WHERE id = ?", (token_id,))
        return done.rowcount > 0
