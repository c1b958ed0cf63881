"""`print_blocks`: prints blocks on a console."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Final

from rid_daq.blocks.block import AnyBlock, Heading, Next, Table, Text, Verdict
from rid_daq.blocks.picture import Picture
from rid_daq.blocks.plot import Plot

if TYPE_CHECKING:
    from rid_daq.terminal.console import Console

ROOMY: Final = 120
"""Minimum width of a terminal that shows the optional columns of a table [columns]."""


def print_blocks(blocks: Iterable[AnyBlock], console: Console) -> None:
    """Print blocks for people, without plots.

    Args:
        blocks: The blocks in their order.
        console: Console of a terminal, or of a worker, which writes events.
    """
    for block in blocks:
        match block:
            case Heading() | Text():
                console.say(block.text)
            case Verdict():
                console.verdict(block.passed, block.text)
            case Table():
                _print_table(block, console)
            case Next():
                console.next_step(*block.words, lead=block.lead)
            case Picture():
                console.say(block.line)
            case Plot():
                pass  # only reports show plots


def _print_table(table: Table, console: Console) -> None:
    roomy = console.columns is None or console.columns >= ROOMY
    kept = [n for n, column in enumerate(table.columns) if roomy or not column.is_optional]
    heads = [table.columns[n].head for n in kept]
    rows = [[cells[n] for n in kept] for cells in table.cells()]
    console.table(heads, rows, table.failed, table.key)
