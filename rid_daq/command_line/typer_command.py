"""`TyperOperation`: an operation's command among the commands that Typer builds.

It goes when all commands are operations.
"""

from __future__ import annotations

from typing import Any

import click
import typer
from click.shell_completion import ShellComplete
from typer.core import TyperCommand

from rid_daq.command_line.operation_command import OperationCommand
from rid_daq.operations.catalogue import operation

_PROGRAM = "rid-daq"


class TyperOperation(TyperCommand):
    """Hands the words of its command line to the command of an operation.

    Parameters
    ----------
    name : str
        The operation's name.
    summary : str
        Its line in the program's help.
    widest_help : int
        Most columns of a help page.
    """

    def __init__(self, name: str, summary: str, widest_help: int) -> None:
        super().__init__(
            name,
            short_help=summary,
            add_help_option=False,
            context_settings={"allow_extra_args": True, "ignore_unknown_options": True},
        )
        self._widest_help = widest_help

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Keep the words as they are."""
        ctx.args = args
        return args

    def invoke(self, ctx: Any) -> None:
        """Run the operation's command.

        Raises
        ------
        typer.Exit
            The command ended early, for example after its help.
        SystemExit
            A mistyped command line (exit code 2).
        """
        root = self._root()
        try:
            with root.make_context(_PROGRAM, [str(self.name), *ctx.args]) as context:
                root.invoke(context)
        except click.UsageError as error:
            error.show()
            raise SystemExit(error.exit_code) from None
        except click.exceptions.Exit as end:
            raise typer.Exit(end.exit_code) from None

    def shell_complete(self, ctx: Any, incomplete: str) -> Any:
        """Return what the last word may become."""
        words = [str(self.name), *ctx.args]
        return ShellComplete(self._root(), {}, _PROGRAM, "").get_completions(words, incomplete)

    def _root(self) -> click.Group:
        """Return the program with this one command."""
        root = click.Group(_PROGRAM, context_settings={"max_content_width": self._widest_help})
        root.add_command(OperationCommand(operation(str(self.name))))
        return root
