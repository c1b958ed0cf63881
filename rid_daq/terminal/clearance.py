"""Asking whether a real cell is clear before its robot moves."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from config.errors import PreflightError
from config.formats.approved_files import SHORT, sha256_of
from rid_daq.terminal.context import Context

if TYPE_CHECKING:
    from config.cell.cell import CellConfig


def require_cleared(
    cell: CellConfig,
    cleared: bool,
    context: Context,
    *,
    practise: bool = False,
    files: Mapping[str, bytes] | None = None,
) -> None:
    """Ask whether a real cell is clear; of a simulated one only where that is practised.

    Args:
        cleared: Whether that was said already.
        context: Where a person is asked.
        practise: Whether a simulated cell is asked about like a real one.
        files: What the motion is made from, as its run keeps it; shown by hashes beside the
            question.

    Raises:
        PreflightError: Nobody can be asked, or the cell is not clear.
    """
    if practise or not cell.simulated:
        if files:
            context.say(hashes_shown(files))
        clear(cell.name, cleared, context)


def hashes_shown(files: Mapping[str, bytes]) -> str:
    """Return the first digits of the SHA-256 of files that a motion is made from, in a sentence."""
    shown = (f"{name} {sha256_of(content)[:SHORT]}" for name, content in sorted(files.items()))
    return f"To be driven, as read (SHA-256): {', '.join(shown)}."


def clear(cell: str, cleared: bool, context: Context, danger: str = "The robot will move.") -> bool:
    """Ask whether a cell is clear, question by question, unless that was said; return True.

    Raises:
        PreflightError: Nobody can be asked, or the cell is not clear.
    """
    if cleared:
        return True
    advice = "clear the cell, then type its name, or give --i-have-cleared-the-cell"
    if not context.can_ask:
        raise PreflightError(
            f"nobody can be asked whether cell {cell} is clear: {advice}", code="RID-ANSWER-NOBODY"
        )
    context.say(danger)
    answer = context.ask(f"Is nobody in cell {cell}? Type the cell's name", str)
    if answer != cell:
        raise PreflightError(
            f"nothing was moved: {answer!r} is not {cell!r}; {advice}", code="RID-ANSWER-NO"
        )
    if not context.confirm("Is the emergency stop at hand?"):
        raise PreflightError(
            "nothing was moved: have the emergency stop at hand, then start again",
            code="RID-ANSWER-NO",
        )
    return True


def require_yes(context: Context, question: str, answered: bool) -> None:
    """Ask a person, unless a flag answers.

    Raises:
        PreflightError: Nobody can be asked, or the answer is no.
    """
    if answered:
        context.say(f"{question} Answered by --yes.")
        return
    if not context.can_ask:
        raise PreflightError(
            f"{question} Nobody can be asked here: answer by the flags (--yes)",
            code="RID-ANSWER-NOBODY",
        )
    if not context.confirm(question):
        raise PreflightError("nothing was moved further: the answer was no", code="RID-ANSWER-NO")
