"""`show`: blocks on a console."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING

from rid_daq.blocks.block import AnyBlock, Heading, Next, Table, Text, Verdict
from rid_daq.blocks.plot import Plot

if TYPE_CHECKING:
    from rid_daq.terminal.console import Console


def show(blocks: Iterable[AnyBlock], console: Console) -> None:
    """Write blocks for people.

    Parameters
    ----------
    blocks : iterable of block
        The blocks, in their order.
    console : Console
        Where they are written; a worker's console writes events.
    """
    for block in blocks:
        match block:
            case Heading() | Text():
                console.say(block.text)
            case Verdict():
                console.verdict(block.passed, block.text)
            case Table():
                heads = [column.head for column in block.columns]
                console.table(heads, list(block.cells()), block.failed, block.key)
            case Next():
                console.next_step(*block.words)
            case Plot():
                pass  # a report has it
