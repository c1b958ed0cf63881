"""The options of a command: their help, by what they are for, and what is said of wrong values."""

from __future__ import annotations

from typing import Any

import typer
from typer.core import TyperCommand

MANY = 12  # options that one list holds

VALUES = {
    "<float>": "NUMBER",
    "<float range>": "NUMBER",
    "<int>": "N",
    "<int range>": "N",
    "<path>": "PATH",
    "<str>": "TEXT",
}
"""What stands for a value in a help, by the kind of the option."""

_PLAINLY = {
    "Value error, ": "",
    "valid number, unable to parse string as a number": "number",
    "valid integer, unable to parse string as an integer": "whole number",
    "Input should be greater than or equal to": "it should be at least",
    "Input should be less than or equal to": "it should be at most",
    "Input should be": "it should be",
}
"""Words of pydantic, by which Typer checks values, and what is said in their place."""

SHARED: dict[str, tuple[str, ...]] = {
    "Limits of the verdict": (
        "--mass-limit",
        "--centre-limit",
        "--inertia-limit",
        "--residual-limit",
    ),
    "Simulated cells": ("--pace", "--seed", "--payload"),
    "Before it moves": (
        "--rehearsal",
        "--warm-up",
        "--warm-up-periods",
        "--without-axis-test",
        "--practise",
        "--yes",
    ),
    "Live page": ("--live", "--listen", "--token", "--certificate"),
    "Files and services": ("--label", "--runs", "--service", "--json", "--help"),
}
"""The sections after the command's own options, and what belongs there wherever it is taken."""


class SectionedCommand(TyperCommand):
    """A command whose help says what is given to an option, in sections where they are many."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        """Read the options; what is refused is told without the words of a library.

        Raises
        ------
        typer.BadParameter
            An option has no value of its kind.
        """
        try:
            return super().parse_args(ctx, args)
        except typer.BadParameter as refused:
            for word, plain in _PLAINLY.items():
                refused.message = refused.message.replace(word, plain)
            raise

    def format_options(self, ctx: Any, formatter: Any) -> None:
        """Write arguments and options."""
        options: list[Any] = [
            each for each in self.get_params(ctx) if each.param_type_name == "option"
        ]
        for option in options:
            option.metavar = option.metavar or VALUES.get(option.display_type(ctx))
        shown = [(each, each.get_help_record(ctx)) for each in options]
        arguments = [each for each in self.get_params(ctx) if each not in options]
        records = [record for each in arguments if (record := each.get_help_record(ctx))]
        if records:
            with formatter.section("Arguments"):
                formatter.write_dl([(name.partition(" <")[0], text) for name, text in records])
        section_of = sections() if len(shown) > MANY else {}
        lists: dict[str, list[tuple[str, str]]] = {"Options": []}
        lists.update((title, []) for title in section_of.values())
        for each, record in shown:
            if record is not None:
                title = next((section_of[o] for o in each.opts if o in section_of), "Options")
                lists[title].append(record)
        for title, records in lists.items():
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)


def sections() -> dict[str, str]:
    """Return the section of every option that stands in one, in the order of the sections."""
    return {name: title for title, names in SHARED.items() for name in names}
