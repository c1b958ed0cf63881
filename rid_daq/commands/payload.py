"""`rid-daq payload`: identify what a robot carries; load data for its controller."""

from __future__ import annotations

from typing import Any, Final

import typer
from typer.core import TyperGroup

from rid_daq.commands.payload_certificate import certificate
from rid_daq.commands.payload_export import export
from rid_daq.commands.payload_identify import identify
from rid_daq.commands.payload_read_back import read_back
from rid_daq.commands.payload_session import session
from rid_daq.terminal.option_sections import SectionedCommand

SESSION: Final = "session"


class PayloadCommands(TyperGroup):
    """The group: a word that is no command of it is the cell of a guided session."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command that some words mean."""
        if SESSION in self.commands and args and args[0] not in self.commands:
            args = [SESSION, *args]
        return super().resolve_command(ctx, args)


group = typer.Typer(
    name="payload",
    cls=PayloadCommands,
    add_completion=False,
    rich_markup_mode=None,
    no_args_is_help=True,
    subcommand_metavar="CELL | COMMAND [ARGS]...",
    help="Identify what a robot carries: mass, centre of gravity and inertia, from recordings with"
    " and without it; and write them as its controller wants them. `rid-daq payload CELL` leads"
    " through all of it: it is `rid-daq payload session CELL`.",
)
for _name, _command, _line in (
    (SESSION, session, "lead through a session: check, warm up, record, identify, judge"),
    ("identify", identify, "mass, centre of gravity and inertia, from recorded runs"),
    ("export", export, "load data as a maker's controller wants them"),
    ("read-back", read_back, "what was typed into a controller, compared with a payload"),
    ("certificate", certificate, "a payload as a PDF to sign"),
):
    group.command(_name, cls=SectionedCommand, short_help=_line)(_command)
