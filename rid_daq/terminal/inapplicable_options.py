"""Options that have no effect with what was chosen: refused, so that nobody relies on them."""

from __future__ import annotations

from collections.abc import Collection

import typer

from config.errors import ConfigError


def is_given(context: typer.Context, name: str) -> bool:
    """Return whether a parameter stands on the command line."""
    source = context.get_parameter_source(name)
    return source is not None and source.name == "COMMANDLINE"


def refuse_inapplicable(context: typer.Context, unread: Collection[str], because: str) -> None:
    """Refuse options that were given and have no effect.

    Parameters
    ----------
    context
        The command's.
    unread
        Names of the parameters that have none.
    because
        What was chosen, for the message: `with` something, or `without` it.

    Raises
    ------
    ConfigError
        One of them was given.
    """
    for parameter in context.command.params:
        if parameter.name in unread and is_given(context, parameter.name):
            option = "/".join((parameter.opts[0], *parameter.secondary_opts[:1]))
            raise ConfigError(
                f"{option}: has no effect {because}; leave it out", code="RID-OPTION-NO-EFFECT"
            )
