"""`SealedModel`: base class of the models of computed files, which are not edited by hand."""

from __future__ import annotations

import hashlib
from typing import TYPE_CHECKING, Self

from config.errors import ConfigError
from config.model import ConfigModel


class SealedModel(ConfigModel):
    """Content of a computed file, with a checksum that shows if a value was changed later.

    A changed number can be as plausible as the computed one, so only the checksum reveals it. It
    does not protect against forgery, because anyone can compute it.

    Each subclass declares the field `sha256` last, so that errors in other fields are reported
    first.

    Attributes:
        sha256: SHA-256 of the other fields; layout and order of keys in the file do not matter.
    """

    if TYPE_CHECKING:
        sha256: str

    @property
    def digest(self) -> str:
        """SHA-256 of the other fields."""
        return hashlib.sha256(self.model_dump_json(exclude={"sha256"}).encode()).hexdigest()

    def with_digest(self) -> Self:
        """Return the content with its checksum."""
        return self.model_copy(update={"sha256": self.digest})

    def refuse_edited(self, code: str, remedy: str) -> None:
        """Refuse a content that was changed after it was computed.

        Args:
            code: Code of the error.
            remedy: What the user can do; the end of the message.

        Raises:
            ConfigError: The checksum is that of another content.
        """
        if self.sha256 != self.digest:
            raise ConfigError(
                f"sha256: {self.sha256[:8]}… is not the checksum of the content, which is"
                f" {self.digest[:8]}…; a value was edited, or the file was damaged: {remedy}",
                code=code,
            )
