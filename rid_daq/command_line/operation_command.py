"""`OperationCommand`: command of an operation, built from its request."""

from __future__ import annotations

import re
import textwrap
import typing
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

import click
from click.shell_completion import CompletionItem

from config.errors import ConfigError
from config.process.shortage import require_memory
from rid_daq.operations.catalogue import CATALOGUE
from rid_daq.operations.operation import NUMERICS_BYTES, Operation
from rid_daq.operations.perform import perform
from rid_daq.requests.option import FILES, OPTIONS
from rid_daq.requests.request import (
    INVALID,
    ShownField,
    choices_of,
    plain_type,
    shown_fields,
)
from rid_daq.service.remote_jobs import send
from rid_daq.terminal.console import JSON_HELP, SERVICE_HELP, Console

PLACEHOLDERS: Final = {float: "NUMBER", int: "N", Path: "PATH"}
_PARTS: Final = "__"
_GOES_ON: Final = " \\"


class OperationCommand(click.Command):
    """Command of an operation: options from its fields, help in sections, examples."""

    def __init__(self, operation: Operation) -> None:
        self._operation = operation
        fields: dict[str, list[ShownField]] = {}
        for each in shown_fields(operation.request):  # fields with the same flag share an option
            if not each.option.hidden:
                fields.setdefault(each.flag, []).append(each)
        self._fields = {_PARTS.join(each[0].path): each for each in fields.values()}
        service = click.Option(["--service"], metavar="ADDRESS", help=SERVICE_HELP)
        common: list[click.Parameter] = [
            *([service] if CATALOGUE[operation.name].is_job else []),
            click.Option(["--json", "as_json"], is_flag=True, help=JSON_HELP),
        ]
        own: list[click.Parameter] = []
        self._groups: dict[str, str] = {}
        for key, (first, *_) in self._fields.items():
            parameters = [_click_parameter(key, first), *_further_options(key, first)]
            own += parameters
            self._groups |= {str(one.name): first.option.group for one in parameters}
        super().__init__(
            operation.name.split()[-1],
            params=own + common,
            callback=self._call,
            help=operation.request.__doc__,
        )

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse the arguments; refuse a second input file for an option that takes one file.

        Raises:
            ConfigError: Such an option is given more than once.
        """
        if not ctx.resilient_parsing:
            _, _, order = self.make_parser(ctx).parse_args(list(args))
            for each in order:
                shown = next(iter(self._fields.get(each.name or "", ())), None)
                takes_file = shown is not None and shown.option.file == "input"
                if takes_file and each.nargs == 1 and not each.multiple and order.count(each) > 1:
                    raise ConfigError(
                        f"{each.opts[0]} is given {order.count(each)} times, but takes one file:"
                        " leave the others out",
                        code="RID-OPTION-EXCLUSIVE",
                    )
        return super().parse_args(ctx, args)

    def format_options(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write arguments and options in the sections of their fields."""
        arguments: list[tuple[str, str]] = []
        sections: dict[str, list[tuple[str, str]]] = {OPTIONS: []}
        last: list[tuple[str, str]] = []
        for each in self.get_params(ctx):
            shown = next(iter(self._fields.get(each.name or "", ())), None)
            if shown is not None and shown.option.positional:
                arguments.append((shown.flag, shown.help))
            elif record := each.get_help_record(ctx):
                group = self._groups.get(each.name or "", FILES)
                (last if group == FILES else sections.setdefault(group, [])).append(record)
        for title, records in (("Arguments", arguments), *sections.items(), (FILES, last)):
            if records:
                with formatter.section(title):
                    formatter.write_dl(records)

    def format_epilog(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        """Write the examples."""
        with formatter.section("Examples"):
            columns = formatter.width - formatter.current_indent - len(_GOES_ON)
            for example in self._operation.examples:
                *lines, last = _wrap_command(f"rid-daq {example}", columns)
                for line in lines:
                    formatter.write(f"{'':{formatter.current_indent}}{line}{_GOES_ON}\n")
                formatter.write(f"{'':{formatter.current_indent}}{last}\n")

    def _call(self, *, as_json: bool, service: str | None = None, **given: Any) -> None:
        operation = self._operation
        if operation.module:
            require_memory(NUMERICS_BYTES)
        values: dict[str, object] = {}
        for key, fields in self._fields.items():
            value = _value_with_further(key, fields[0], given)
            if value is None or value == ():
                continue
            if fields[0].option.value is not None:
                value = fields[0].option.value
            elif typing.get_origin(fields[0].type) is dict:
                value = dict(_split_pair(fields[0], text) for text in value)
            elif fields[0].option.separator:
                value = _split_value(fields[0], value)
            for each in fields:
                inner: Any = values
                for part in each.path[:-1]:
                    inner = inner.setdefault(part, {})
                inner[each.path[-1]] = value
        request, console = operation.request.of(values, flags=True), Console(as_json)
        if service is None:
            perform(operation, request, console)
        else:
            send(service, operation, request, console)


class Value(click.ParamType[str]):
    """Value of an option as text; the request converts and validates it.

    Args:
        type_: Type of the field.
    """

    name = "text"

    def __init__(self, type_: Any) -> None:
        self.choices = choices_of(type_)

    def shell_complete(
        self, ctx: click.Context, param: click.Parameter, incomplete: str
    ) -> list[CompletionItem]:
        """Complete a choice; complete any other value as the path of a file."""
        if not self.choices:
            return [CompletionItem(incomplete, type="file")]
        return [CompletionItem(each) for each in self.choices if each.startswith(incomplete)]


def _click_parameter(key: str, shown: ShownField) -> click.Parameter:
    option, origin, repeated = shown.option, typing.get_origin(shown.type), shown.is_repeated
    arguments = typing.get_args(shown.type)
    element = plain_type(arguments[0]) if origin in (list, tuple) else shown.type
    value, required = Value(element), shown.info.is_required()
    if option.positional:
        return click.Argument(
            [key],
            required=required,
            metavar=shown.flag,
            nargs=-1 if repeated else 1,
            type=value,
        )
    names = [f"-{option.short}"] if option.short else []
    if shown.type is bool or option.value is not None:
        no = f"/--no-{shown.flag[2:]}" if option.negatable else ""
        flag = f"{shown.flag}{no}"
        return click.Option([*names, flag, key], is_flag=True, default=None, help=shown.help)
    is_one = repeated or origin is not tuple or option.separator or option.further
    words = 1 if is_one else len(arguments)
    return click.Option(
        [*names, shown.flag, key],
        multiple=repeated and not option.separator,
        nargs=words,
        metavar=option.metavar or "|".join(value.choices) or PLACEHOLDERS.get(element, "TEXT"),
        help=shown.help,
        required=required,
        type=value,
    )


def _further_options(key: str, shown: ShownField) -> list[click.Option]:
    """Return one option for each number of a tuple, except for the first number."""
    return [
        click.Option(
            [f"--{each.flag}", f"{key}{_PARTS}{place}"],
            metavar=PLACEHOLDERS[float],
            help=f"{each.description} [{shown.option.unit}]. Default: {each.default}.",
        )
        for place, each in enumerate(shown.option.further)
    ]


def _value_with_further(key: str, shown: ShownField, given: Mapping[str, Any]) -> Any:
    """Return the value of a field; the further options give the other numbers of a tuple."""
    value, further = given[key], shown.option.further
    numbers = [given[f"{key}{_PARTS}{place}"] for place in range(len(further))]
    if value is None and any(each is not None for each in numbers):
        raise ConfigError(
            f"--{further[0].flag}: has no effect without {shown.flag}; leave it out", code=INVALID
        )
    if value is None or not further:
        return value
    pairs = zip(numbers, further, strict=True)
    return (value, *(each.default if number is None else number for number, each in pairs))


def _wrap_command(command: str, columns: int) -> list[str]:
    """Wrap a command into lines; an option and its value stay in one line."""
    joined = re.sub(r" (?!-)", "\0", command)
    lines = textwrap.wrap(joined, columns, subsequent_indent="    ", break_on_hyphens=False)
    return [line.replace("\0", " ") for line in lines]


def _split_value(shown: ShownField, text: str) -> tuple[str, ...]:
    words = tuple(text.split(shown.option.separator))
    if not shown.is_repeated and len(words) != len(typing.get_args(shown.type)):
        form = f"must have the form {shown.option.metavar}"
        raise ConfigError(f"{shown.flag}: {text!r} {form}", code=INVALID)
    values = tuple(map(str.strip, words))
    if not all(values):
        raise ConfigError(
            f"{shown.flag}: {text!r} has an empty value: give values, or leave the option out",
            code=INVALID,
        )
    return values


def _split_pair(shown: ShownField, text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise ConfigError(f"{shown.flag}: {text!r} must have the form NAME=VALUE", code=INVALID)
    return name, value
