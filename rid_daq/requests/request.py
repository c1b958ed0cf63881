"""`Request`: typed input of an operation, validated in one place for all callers."""

from __future__ import annotations

import json
import math
import types
import typing
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any, Final, Self

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails, PydanticCustomError

from config.errors import ConfigError
from config.ranges import CODE as OUT_OF_RANGE
from config.ranges import numbers_of, refusal
from config.wrong_value import BOUNDS, explain_error
from rid_daq.requests.option import Option

INVALID: Final = "RID-REQUEST-INVALID"
_NOT_FINITE: Final = "finite_number"
_NO_EFFECT: Final = "has no effect {how} {other}; leave it out"
_PROBLEMS: Final = {"missing": "is missing", "extra_forbidden": "is not a field of this request"}


class Request(BaseModel):
    """Input of an operation. Unknown fields, numbers out of range and NaN are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    @classmethod
    def of(cls, values: Mapping[str, object], *, shown: str = "", flags: bool = False) -> Self:
        """Return a request made from values by field name.

        Args:
            values: Values by field name; text is converted to numbers and paths.
            shown: Prefix of messages, such as the name of the operation.
            flags: True to name fields in messages by their command line options.

        Raises:
            ConfigError: A value is missing, unknown or of the wrong type (RID-REQUEST-INVALID), or
                out of range (RID-OPTION-RANGE).
        """
        for each in shown_fields(cls):
            given: object = values
            for name in each.path:
                given = given.get(name) if isinstance(given, Mapping) else None
            for text in _texts_with_separators(given) if _is_numeric(each.type) else ():
                name = each.flag if flags else ".".join(each.path)
                words = f"{text!r} must be a number in plain digits"
                raise ConfigError(": ".join(filter(None, (shown, name, words))), code=INVALID)
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            raise _first_problem(cls, error, shown, flags=flags) from None

    @classmethod
    def of_json(cls, values: Mapping[str, object], *, shown: str = "") -> Self:
        """Return a request made from a JSON document; text is not converted to numbers.

        Args:
            values: The document.
            shown: Prefix of messages.

        Raises:
            ConfigError: The same errors as in `of`.
        """
        try:
            return cls.model_validate_json(json.dumps(values), strict=True)
        except ValidationError as error:
            raise _first_problem(cls, error, shown, flags=False) from None

    @model_validator(mode="after")
    def _require_ranges(self) -> Self:
        for path, value, limits in numbers_of(self, type(self).model_fields, type(self)):
            text = refusal(value, limits)
            if text is not None:
                where = ".".join(map(str, path))
                raise PydanticCustomError("range", "{text}", {"text": text, "where": where})
        return self

    @model_validator(mode="after")
    def _refuse_without_effect(self) -> Self:
        for name in self.model_fields_set:
            if getattr(self, name) is False:
                continue  # a switch that is off is as good as left out
            option = option_of(type(self).model_fields[name])
            without = [each for each in (option.needs,) if each and not getattr(self, each)]
            for other in [*without, *filter(self.__getattribute__, option.unused_with)]:
                how = "without" if other == option.needs else "with"
                context = {"how": how, "other": other, "where": name}
                raise PydanticCustomError("no_effect", _NO_EFFECT, context)
        return self


@dataclass(frozen=True)
class ShownField:
    """A field of a request as the command line and forms show it.

    Attributes:
        path: Names that lead to the field; several names if the field is in a group of options.
        info: Declaration of the field.
        type: Type of the field, without its annotations and without `None`.
    """

    path: tuple[str, ...]
    info: FieldInfo
    type: Any

    @property
    def option(self) -> Option:
        """Presentation of the field."""
        return option_of(self.info)

    @property
    def is_repeated(self) -> bool:
        """True if the field takes any number of values."""
        origin, arguments = typing.get_origin(self.type), typing.get_args(self.type)
        return origin in (list, dict) or (origin is tuple and arguments[-1] is Ellipsis)

    @property
    def flag(self) -> str:
        """Name of the field on the command line."""
        if self.option.positional:
            return self.option.metavar or self.path[-1].upper()
        return f"--{self.option.flag or self.path[-1].replace('_', '-')}"

    @property
    def help(self) -> str:
        """Help text: description, unit and default."""
        unit, default = self.option.unit, self.info.default
        text = str(self.info.description)
        if unit:
            text = f"{text.rstrip('.')} [{unit}]."
        if self.is_repeated and not self.option.positional and not self.option.separator:
            text += " Repeatable."
        known = isinstance(default, (int, float, str, Path)) and not isinstance(default, bool)
        known = known and self.option.value is None
        return f"{text} Default: {default}." if known and str(default) not in ("", ".") else text


def option_of(info: FieldInfo) -> Option:
    """Return the presentation of a field; its own replaces that of a shared type."""
    own_last = reversed(info.metadata)
    return next((each for each in own_last if isinstance(each, Option)), Option())


def shown_fields(request: type[BaseModel], path: tuple[str, ...] = ()) -> Iterator[ShownField]:
    """Yield the fields of a request; a nested model is replaced by its fields."""
    for name, info in request.model_fields.items():
        found = plain_type(info.annotation)
        if isinstance(found, type) and issubclass(found, BaseModel):
            yield from shown_fields(found, (*path, name))
        else:
            yield ShownField((*path, name), info, found)


def plain_type(annotation: Any) -> Any:
    """Return a type without its annotations and without `None`."""
    origin, arguments = typing.get_origin(annotation), typing.get_args(annotation)
    if origin is Annotated:
        return plain_type(arguments[0])
    if origin in (typing.Union, types.UnionType):
        return plain_type(next(each for each in arguments if each is not type(None)))
    return annotation


def _is_numeric(type_: Any) -> bool:
    """Return True for a number, and for a tuple or list of numbers."""
    if typing.get_origin(type_) in (tuple, list):
        elements = [each for each in typing.get_args(type_) if each is not Ellipsis]
        return all(_is_numeric(plain_type(each)) for each in elements)
    return type_ in (int, float)


def _texts_with_separators(given: object) -> Iterator[str]:
    """Yield the texts with `_`, which pydantic ignores between digits as Python does."""
    if isinstance(given, str) and "_" in given:
        yield given
    elif isinstance(given, (tuple, list)):
        for each in given:
            yield from _texts_with_separators(each)


def refuse_unused(request: Request, names: Iterable[str], because: str) -> None:
    """Refuse fields that were set but have no effect.

    Args:
        names: Fields without effect.
        because: Reason for the message: `with SOMETHING` or `without SOMETHING`.

    Raises:
        ConfigError: Such a field was set (RID-OPTION-NO-EFFECT).
    """
    given = request.model_fields_set & set(names)
    for each in shown_fields(type(request)):
        if each.path[0] in given:
            raise ConfigError(
                f"{each.flag}: has no effect {because}; leave it out", code="RID-OPTION-NO-EFFECT"
            )


def choices_of(type_: Any) -> tuple[str, ...]:
    """Return the texts that a type allows; an empty tuple if the type is not a choice of texts."""
    if isinstance(type_, type) and issubclass(type_, StrEnum):
        return tuple(map(str, type_))
    is_literal = typing.get_origin(type_) is typing.Literal
    return tuple(map(str, typing.get_args(type_))) if is_literal else ()


def _first_problem(
    request: type[Request], error: ValidationError, shown: str, *, flags: bool
) -> ConfigError:
    """Return one of the problems as an error: a number out of its range, or else the first one."""
    found = error.errors(include_url=False)
    first = next(filter(_is_out_of_range, found), found[0])
    context = first.get("ctx", {})
    path = tuple(map(str, first["loc"])) + tuple(filter(None, [context.get("where")]))
    names = {each.path: each.flag for each in shown_fields(request)} if flags else {}
    name = _field_name(path, names)
    other = names.get((*path[:-1], str(context.get("other"))), context.get("other"))
    text = _problem_text(first, other)
    code = OUT_OF_RANGE if _is_out_of_range(first) else INVALID
    return ConfigError(": ".join(filter(None, (shown, name, text))), code=code)


def _is_out_of_range(error: ErrorDetails) -> bool:
    """Return True if a number is outside its range, or not finite."""
    value = error["input"]
    return error["type"] in (*BOUNDS, _NOT_FINITE, "range") or (
        isinstance(value, float) and not math.isfinite(value)
    )


def _field_name(path: tuple[str, ...], names: Mapping[tuple[str, ...], str]) -> str:
    """Return a field's name; a number in its path is the index in a list."""
    path = tuple(part for each in path for part in each.split("."))
    for length in range(len(path), 0, -1):
        if path[:length] in names:
            return names[path[:length]]
    return ".".join(path)


def _problem_text(error: ErrorDetails, other: str | None) -> str:
    kind, value = error["type"], error["input"]
    if kind == _NOT_FINITE or (isinstance(value, float) and not math.isfinite(value)):
        return f"{value} is not a finite number: give a number"
    if kind == "no_effect":
        return _NO_EFFECT.format(how=error["ctx"]["how"], other=other)
    if kind in _PROBLEMS:
        return _PROBLEMS[kind]
    if kind == "range":
        return error["msg"]
    words = explain_error(error)
    return f"{value!r:.60} {words}" if kind == "value_error" else words
