"""`EndResult`: result of an operation that has shown everything before it ended."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from rid_daq.blocks.block import Text


@dataclass(frozen=True)
class EndResult:
    """Result of an operation that has shown everything before it ended.

    Attributes:
        text: Last sentence for people.
    """

    text: str = ""

    def document(self) -> dict[str, object]:
        """Return an empty document: programs have already received everything."""
        return {}

    def blocks(self) -> Iterator[Text]:
        """Yield `text`, if there is one."""
        if self.text:
            yield Text(text=self.text)
