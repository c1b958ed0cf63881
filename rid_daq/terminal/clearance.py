"""Asking whether a real cell is clear before its robot moves."""

from __future__ import annotations

import sys
from collections.abc import Callable
from typing import Annotated, TypeVar

import typer

from config.cell.cell import CellConfig
from config.errors import PreflightError
from rid_daq.terminal.console import Console

T = TypeVar("T")

Cleared = Annotated[
    bool,
    typer.Option(
        "--i-have-cleared-the-cell",
        help="Nobody is in the cell and the emergency stop is at hand; needed for real robots"
        " where nobody can be asked.",
    ),
]
"""The option that every command has that moves a real robot."""

WithoutAxisTest = Annotated[
    bool,
    typer.Option(
        "--without-axis-test",
        help="Move a real robot though `rid-daq axes` has not passed since its cell or robot file"
        " changed; the run says so.",
    ),
]
"""The option that every command has that moves a real robot by itself."""


def asked(ask: Callable[..., T], question: str) -> T:
    """Ask a person by `typer.prompt` or `typer.confirm`, beside what programs read.

    Raises
    ------
    PreflightError
        There is no answer: the input has ended.
    """
    try:
        return ask(question, err=True)
    except typer.Abort:
        typer.echo(err=True)  # the question's line has no end
        raise PreflightError("nobody answered: nothing more is moved") from None


def require_cleared(cell: CellConfig, cleared: bool) -> None:
    """Ask whether a real cell is clear; nobody is asked about a simulated one.

    Parameters
    ----------
    cell
        The cell.
    cleared
        Whether that was said already.

    Raises
    ------
    PreflightError
        Nobody can be asked, or the answer is not the cell's name.
    """
    if cell.simulated or cleared:
        return
    advice = "clear the cell, then type its name, or give --i-have-cleared-the-cell"
    if not sys.stdin.isatty():
        raise PreflightError(f"cell {cell.name} is real and nobody can be asked: {advice}")
    answer = asked(
        typer.prompt,
        f"Robot will move. Nobody in cell {cell.name}, emergency stop at hand? Type the cell's"
        " name",
    )
    if answer != cell.name:
        raise PreflightError(f"nothing was moved: {answer!r} is not {cell.name!r}; {advice}")


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
    if not sys.stdin.isatty():
        raise PreflightError(f"{question} Nobody can be asked here: answer by the flags (--yes)")
    if not asked(typer.confirm, f"{question} Done?"):
        raise PreflightError("nothing was moved further: the answer was no")
