"""`FormField`: form field for a field of an operation's request."""

from __future__ import annotations

import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from pydantic import BaseModel

from rid_daq.operations.operation import Operation
from rid_daq.requests.option import FILES
from rid_daq.requests.request import ShownField, choices_of, plain_type, shown_fields

FieldKind = Literal["flag", "number", "whole", "text", "choice"]

_KINDS: Final[dict[object, FieldKind]] = {
    bool: "flag",
    float: "number",
    int: "whole",
    str: "text",
    Path: "text",
}


@dataclass(frozen=True)
class FormField:
    """A field of a form.

    Attributes:
        path: Place of its value in the request, parts separated by dots.
        label, hint: Name with unit; description.
        kind: Type of one value.
        many: Form of several values: "" for one value, "list" for one per line, "numbers" for a
            fixed number of values in one line, "pairs" for NAME=VALUE, one per line.
        default: Value if nothing is given, as text.
        is_required: True if a value must be given.
        choices: Allowed values of a choice.
        offers: Suggestions while the user types: "files", "runs" or nothing.
        parts: Name and kind of each part of a value that has several parts, written in one line;
            empty for a plain value.
    """

    path: str
    label: str
    hint: str
    kind: FieldKind
    many: Literal["", "list", "numbers", "pairs"]
    default: str
    is_required: bool
    choices: tuple[str, ...]
    offers: Literal["", "files", "runs"]
    parts: tuple[tuple[str, FieldKind], ...] = ()

    @classmethod
    def of(cls, shown: ShownField) -> FormField:
        """Return the form field for a request's field."""
        option, default = shown.option, shown.info.default
        many, element = _many(shown)
        choices = choices_of(element)
        model = isinstance(element, type) and issubclass(element, BaseModel)
        name = option.flag or shown.path[-1]
        unit = f" [{option.unit}]" if option.unit else ""
        is_run = (option.metavar or "").startswith("RUN")
        known = isinstance(default, (int, float, str, Path))
        return cls(
            path=".".join(shown.path),
            label=f"{name.replace('_', ' ').replace('-', ' ')}{unit}",
            hint=str(shown.info.description),
            kind="choice" if choices else _KINDS.get(element, "text"),
            many=many,
            default=str(default) if known else "",
            is_required=shown.info.is_required(),
            choices=choices,
            offers="runs" if is_run else "files" if option.file == "input" else "",
            parts=tuple((each.path[-1], _KINDS[each.type]) for each in shown_fields(element))
            if model
            else (),
        )


def form_sections(operation: Operation) -> dict[str, tuple[FormField, ...]]:
    """Return the fields that a client can set, by section; files come last."""
    found: dict[str, list[FormField]] = {}
    for shown in shown_fields(operation.request):
        if shown.path[0] not in operation.owned:
            found.setdefault(shown.option.group, []).append(FormField.of(shown))
    last = {FILES: found.pop(FILES)} if FILES in found else {}
    return {title: tuple(fields) for title, fields in (found | last).items()}


def _many(shown: ShownField) -> tuple[Literal["", "list", "numbers", "pairs"], typing.Any]:
    """Return the form of several values in a field, and the type of one value."""
    origin, arguments = typing.get_origin(shown.type), typing.get_args(shown.type)
    if origin is dict:
        return "pairs", plain_type(arguments[1])
    if shown.is_repeated:
        return "list", plain_type(arguments[0])
    if origin is tuple:
        return "numbers", plain_type(arguments[0])
    return "", shown.type
