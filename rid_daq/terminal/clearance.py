"""Questions to the user about a real cell before its robot moves."""

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
    """Ask the user whether a real cell is clear, or with `practise` a simulated one.

    Args:
        cleared: True if the user confirmed this in advance; then nothing is asked.
        context: Context that asks the question.
        practise: True if a simulated cell is treated like a real one.
        files: Files that define the motion, as its run stores them; their hashes are shown before
            the question.

    Raises:
        PreflightError: No user can be asked, or the cell is not clear.
    """
    if practise or not cell.simulated:
        if files:
            context.say(hash_sentence(files))
        ask_clearance(cell.name, cleared, context)


def hash_sentence(files: Mapping[str, bytes]) -> str:
    """Return a sentence with the first digits of the SHA-256 of the files that define a motion."""
    shown = (f"{name} {sha256_of(content)[:SHORT]}" for name, content in sorted(files.items()))
    return f"The motion uses these files (SHA-256): {', '.join(shown)}."


def ask_clearance(
    cell: str, cleared: bool, context: Context, danger: str = "The robot will move."
) -> bool:
    """Ask the questions about a cell, unless they were answered in advance; return True.

    Args:
        danger: Sentence that is shown before the questions.

    Raises:
        PreflightError: No user can be asked, or the cell is not clear.
    """
    if cleared:
        return True
    advice = "clear the cell, then type its name, or give --i-have-cleared-the-cell"
    if not context.can_ask:
        raise PreflightError(
            f"cannot ask whether cell {cell} is clear, because there is no terminal: {advice}",
            code="RID-ANSWER-NOBODY",
        )
    context.say(danger)
    answer = context.ask(
        f"Is cell {cell} free of people?",
        str,
        ((f"Cell {cell} is free of people", cell), ("No", "no")),
    )
    if answer != cell:
        raise PreflightError(
            f"no motion was started: {answer!r} is not the cell's name {cell!r}; {advice}",
            code="RID-ANSWER-NO",
        )
    if not context.confirm("Is the emergency stop within reach?"):
        raise PreflightError(
            "no motion was started: keep the emergency stop within reach, then start again",
            code="RID-ANSWER-NO",
        )
    return True


def require_yes(context: Context, question: str, answered: bool) -> None:
    """Ask the user a question, unless a flag answers it with yes.

    Raises:
        PreflightError: No user can be asked, or the answer is no.
    """
    if answered:
        context.say(f"{question} Answered by --yes.")
        return
    if not context.can_ask:
        raise PreflightError(
            f"{question} The question cannot be asked, because there is no terminal: answer it"
            " with the option --yes",
            code="RID-ANSWER-NOBODY",
        )
    if not context.confirm(question):
        raise PreflightError(
            "no further motion was started, because the answer was no", code="RID-ANSWER-NO"
        )
