"""`EndResult`: the result of an operation that has announced all else while it ran."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rid_daq.blocks.block import Text


@dataclass(frozen=True)
class EndResult:
    """Result of an operation that has shown all else before its end.

    Attributes:
        text: A last sentence for people.
    """

    text: str = ""
    exit_code: int = 0

    def document(self) -> dict[str, object]:
        """Return nothing: programs have the document already."""
        return {}

    def blocks(self) -> Iterator[Text]:
        """Yield the last sentence."""
        if self.text:
            yield Text(text=self.text)
