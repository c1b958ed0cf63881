"""`Root`: the program's command line; a command is imported only when it is called."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

import click
from click.shell_completion import CompletionItem

from config.process.termination import signals_deferred
from rid_daq.command_line.completion import PROGRAM, completion_options
from rid_daq.operations.catalogue import CATALOGUE, GROUPS, SECTIONS, operation

WIDEST_HELP: Final = 120
"""Largest width of a help page, in columns; a narrower terminal limits it further."""

_HELP: Final = (
    "Measure a robot's dynamics: drives, recordings, identification, validation, reports."
    " CELL is a bundled name, such as ir361 or kr15, or a path to a cell file. This program is not"
    " a safety function: the cell's own emergency stop is required."
)


def _commands_by_section() -> dict[str, dict[str, str]]:
    """Return the commands of every section with their summaries, in the order of the help."""
    found: dict[str, dict[str, str]] = {section: {} for section in SECTIONS}
    for words, entry in CATALOGUE.items():
        first, *inner = words.split()
        shown = GROUPS[first] if inner else entry
        found[shown.section][first] = shown.summary
    return found


COMMAND_GROUPS: Final = _commands_by_section()
"""Commands and their summaries, by section of the help."""

COMMANDS: Final = {name: line for each in COMMAND_GROUPS.values() for name, line in each.items()}


class LazyGroup(click.Group):
    """Commands in sections; a command is imported only when it is called.

    Args:
        sections: Commands and their summaries, by title of the section.
        params: Options of the group itself.
        help_text: Help of the group.
    """

    def __init__(
        self,
        name: str,
        sections: Mapping[str, Mapping[str, str]],
        help_text: str,
        params: list[click.Parameter] | None = None,
    ) -> None:
        listed = {
            each: click.Command(each, short_help=line)
            for lines in sections.values()
            for each, line in lines.items()
        }
        super().__init__(name, commands=listed, help=help_text, params=params)
        self._sections = sections

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the sections."""
        width = max(map(len, self.commands))
        for title, lines in self._sections.items():
            with formatter.section(title):
                formatter.write_dl([(name.ljust(width), line) for name, line in lines.items()])

    def shell_complete(self, ctx: click.Context, incomplete: str) -> list[CompletionItem]:
        """Return the commands and options that complete a word."""
        found = [
            CompletionItem(name, help=each.short_help)
            for name, each in self.commands.items()
            if name.startswith(incomplete)
        ]
        return found + click.Command.shell_complete(self, ctx, incomplete)


class Root(LazyGroup):
    """The program's top-level command."""

    def __init__(self) -> None:
        super().__init__(PROGRAM, COMMAND_GROUPS, _HELP, [_version_option(), *completion_options()])
        self.context_settings["max_content_width"] = WIDEST_HELP

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return a command; None if there is no command of this name."""
        if cmd_name in GROUPS:
            return InnerGroup(cmd_name)
        return _import_command(cmd_name) if cmd_name in self.commands else None


class InnerGroup(LazyGroup):
    """Commands with the same first word.

    Args:
        name: The first word.
    """

    def __init__(self, name: str) -> None:
        lines = {
            each.removeprefix(f"{name} "): entry.summary
            for each, entry in CATALOGUE.items()
            if each.startswith(f"{name} ")
        }
        group = GROUPS[name]
        super().__init__(name, {"Commands": lines}, group.help)
        self._default = group.default
        if group.default:
            self.subcommand_metavar = f"{group.metavar} | {self.subcommand_metavar}"

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        """Import and return a command; None if there is no command of this name."""
        return _import_command(f"{self.name} {cmd_name}") if cmd_name in self.commands else None

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        """Return the command that the first of `args` names, or else the default command."""
        if self._default and args and args[0] not in self.commands:
            args = [self._default, *args]
        return super().resolve_command(ctx, args)


def command_words() -> list[tuple[str, ...]]:
    """Return the words of every command, in the order of the help."""
    every = sorted(CATALOGUE, key=lambda words: [*COMMANDS].index(words.split()[0]))
    return [tuple(words.split()) for words in every]


def _import_command(words: str) -> click.Command:
    # pydantic would raise another exception instead of the exception of a signal handler
    with signals_deferred():
        from rid_daq.command_line.operation_command import OperationCommand

        return OperationCommand(operation(words))


def _version_option() -> click.Option:
    def show(ctx: click.Context, _param: click.Parameter, is_asked: bool) -> None:
        if is_asked:
            from rid_daq.session.versions import program_version

            click.echo(program_version())
            ctx.exit()

    return click.Option(
        ["--version"],
        is_flag=True,
        is_eager=True,
        expose_value=False,
        callback=show,
        help="Print the version and exit.",
    )
