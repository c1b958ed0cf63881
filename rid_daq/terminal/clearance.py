"""Asking whether a real cell is clear before its robot moves."""

from __future__ import annotations

from typing import TYPE_CHECKING

from config.errors import PreflightError
from rid_daq.terminal.console import Console

if TYPE_CHECKING:
    from config.cell.cell import CellConfig


def require_cleared(cell: CellConfig, cleared: bool, console: Console) -> None:
    """Ask whether a real cell is clear; nobody is asked about a simulated one.

    Parameters
    ----------
    cell
        The cell.
    cleared
        Whether that was said already.
    console
        Where a person is asked.

    Raises
    ------
    PreflightError
        Nobody can be asked, or the answer is not the cell's name.
    """
    if not cell.simulated:
        clear(cell.name, cleared, console)


def clear(cell: str, cleared: bool, console: Console) -> bool:
    """Ask whether a real cell is clear, unless that was said already; return True.

    Raises
    ------
    PreflightError
        Nobody can be asked, or the answer is not the cell's name.
    """
    if cleared:
        return True
    advice = "clear the cell, then type its name, or give --i-have-cleared-the-cell"
    if not console.can_ask:
        raise PreflightError(f"cell {cell} is real and nobody can be asked: {advice}")
    answer = console.ask(
        f"Robot will move. Nobody in cell {cell}, emergency stop at hand? Type the cell's name",
        str,
    )
    if answer != cell:
        raise PreflightError(f"nothing was moved: {answer!r} is not {cell!r}; {advice}")
    return True


def require_yes(console: Console, question: str, answered: bool) -> None:
    """Ask a person, unless a flag answers.

    Raises
    ------
    PreflightError
        Nobody can be asked, or the answer is no.
    """
    if answered:
        console.say(question)
        console.say("  answered by flag")
        return
    if not console.can_ask:
        raise PreflightError(f"{question} Nobody can be asked here: answer by the flags (--yes)")
    if not console.confirm(f"{question} Done?"):
        raise PreflightError("nothing was moved further: the answer was no")
