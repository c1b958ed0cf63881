"""`TyperBridge`: a command that is written with Typer among those that are operations.

It goes when all commands are operations; each of them leaves `TYPER` when it becomes one.
"""

from __future__ import annotations

import importlib
from typing import Any

import click
import typer
from click.shell_completion import CompletionItem

from config.process.shortage import require_memory
from rid_daq.command_line.typer_commands import TYPER
from rid_daq.operations.operation import NUMERICS_BYTES
from rid_daq.terminal.option_sections import SectionedCommand


class TyperBridge(click.Command):
    """Hands the words of its command line to a command of `rid_daq.commands`.

    Parameters
    ----------
    words : str
        The words of the command, a key of `TYPER`.

    Attributes
    ----------
    command : TyperCommand
        The command.
    """

    def __init__(self, words: str) -> None:
        name = words.split()[-1]
        super().__init__(name, add_help_option=False)
        module = importlib.import_module(f"rid_daq.commands.{TYPER[words].room}")
        single = typer.Typer(add_completion=False, rich_markup_mode=None)
        function = getattr(module, name)
        single.command(name=name, cls=SectionedCommand)(function)
        self.command: Any = typer.main.get_command(single)

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Keep the words as they are."""
        ctx.args = args
        return args

    def invoke(self, ctx: click.Context) -> None:
        """Run the command; it ends by SystemExit.

        Raises
        ------
        SystemExit
            With its exit code.
        """
        require_memory(NUMERICS_BYTES)
        width = ctx.max_content_width
        self.command(args=ctx.args, prog_name=ctx.command_path, max_content_width=width)

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the options, or what the option before takes; all else may be a file."""
        chosen, words = self.command, list(ctx.args)
        for each in self.command.params:
            if words and words[-1] in each.opts and not getattr(each, "is_flag", False):
                chosen = each
        with self.command.make_context(self.name, words, resilient_parsing=True) as inner:
            found = chosen.shell_complete(inner, incomplete)
        if not found and not incomplete.startswith("-"):
            return [CompletionItem(incomplete, type="file")]
        return [CompletionItem(each.value, each.type, each.help) for each in found]
