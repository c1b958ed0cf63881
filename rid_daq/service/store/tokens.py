"""`TokenStore`: table of access tokens; it contains only the hashes of their secrets."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable, Sequence
from typing import Final

from rid_daq.service.records import Role, Token, TokenEnd
from rid_daq.service.store.database import Database
from rid_daq.web.request_secrets import hash_secret

MOST_ISSUED: Final = 100_000
"""Maximum number of stored hashes of secrets; the oldest hash is deleted first. The sender of a
secret with a stored hash may stop motions.
"""

UNUSED_S: Final = 30 * 86400.0
"""Time without use after which the token of a paired device expires [s]."""


class TokenStore:
    """Table of tokens, with a copy in memory.

    Args:
        database: The service's database.

    Attributes:
        issued_to: Function that is called with the hash of every new secret.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self.issued_to: Callable[[str], None] = lambda _hash: None
        self._tokens = {
            str(key): Token.model_validate_json(token)
            for key, token in database.read("SELECT hash, token FROM tokens")
        }
        issued = database.read("SELECT hash FROM issued ORDER BY number DESC LIMIT ?", MOST_ISSUED)
        self._issued = dict.fromkeys(str(key) for (key,) in reversed(issued))
        for key in self._tokens:  # tokens that are older than the table of issued secrets
            self._note_issued(key)

    def add(
        self, name: str, role: Role, *, person: bool, ends: TokenEnd = TokenEnd.NEVER
    ) -> tuple[Token, str]:
        """Create a token; return it with its secret, which is stored nowhere."""
        secret = secrets.token_urlsafe(32)
        token = Token(
            id=secrets.token_hex(8),
            name=name,
            role=role,
            person=person,
            created_s=time.time(),
            ends=ends,
        )
        self._tokens[hash_secret(secret)] = token
        self._database.write(
            "INSERT INTO tokens VALUES (?, ?, ?)",
            token.id,
            hash_secret(secret),
            token.model_dump_json(),
        )
        self.note_issued(secret)
        return token, secret

    def note_issued(self, secret: str) -> None:
        """Save the hash of a secret: its sender may stop motions even after the token has ended."""
        self._note_issued(hash_secret(secret))

    def issued(self) -> Sequence[str]:
        """Return the hashes of the issued secrets, at most the newest `MOST_ISSUED`."""
        return list(self._issued)

    def token_of_hash(self, key: str) -> Token | None:
        """Return the token whose secret has this hash, None if it was revoked."""
        return self._tokens.get(key)

    def was_issued(self, secret: str) -> bool:
        """Return True if `issued` contains a secret, even if its token was revoked."""
        return hash_secret(secret) in self._issued

    def find_token(self, secret: str) -> Token | None:
        """Return the token of a secret, None if it is unknown, or expired for lack of use."""
        token = self._tokens.get(hash_secret(secret))
        if token is None or token.ends is not TokenEnd.UNUSED:
            return token
        used_s = token.created_s if token.used_s is None else token.used_s
        return token if time.time() - used_s < UNUSED_S else None

    def end_sessions(self) -> None:
        """Revoke the tokens that are valid only until the service ends."""
        for token in self.all():
            if token.ends is TokenEnd.SERVICE:
                self.revoke(token.id)

    def note_use(self, token: Token) -> None:
        """Save the present time as the last use of a token."""
        used = token.model_copy(update={"used_s": time.time()})
        key = next((key for key, each in self._tokens.items() if each.id == token.id), None)
        if key is not None:
            self._tokens[key] = used
            self._database.note(
                "UPDATE tokens SET token = ? WHERE id = ?", used.model_dump_json(), token.id
            )

    def all(self) -> Sequence[Token]:
        """Return the tokens, without their secrets."""
        return sorted(self._tokens.values(), key=lambda each: each.created_s)

    def revoke(self, token_id: str) -> bool:
        """Delete a token; return True if it existed."""
        key = next((key for key, each in self._tokens.items() if each.id == token_id), None)
        if key is None:
            return False
        del self._tokens[key]
        self._database.write("DELETE FROM tokens WHERE id = ?", token_id)
        return True

    def _note_issued(self, key: str) -> None:
        if key in self._issued:
            return
        self._issued[key] = None
        self.issued_to(key)
        self._database.write("INSERT OR IGNORE INTO issued (hash) VALUES (?)", key)
        if len(self._issued) > MOST_ISSUED:
            oldest = next(iter(self._issued))
            del self._issued[oldest]
            self._database.write("DELETE FROM issued WHERE hash = ?", oldest)
