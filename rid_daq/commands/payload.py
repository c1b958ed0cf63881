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
    help="Identify what a robot carries: mass, centre of gravity and inertia, from recordings with"
    " and without it; and write them as its controller wants them.",
)
group.command("identify")(identify)
group.command("export")(export)
group.command("read-back")(read_back)
group.command("certificate")(certificate)
group.command(SESSION)(session)
