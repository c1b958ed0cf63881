"""`describe_keys`: meaning, kind and default of the keys of a YAML file, from its model."""

from __future__ import annotations

import inspect
import json
import re
import typing
from dataclasses import dataclass
from enum import Enum
from typing import Any, Final

from pydantic import BaseModel
from pydantic.fields import FieldInfo

from config.formats.yaml_tree import Path, YamlTree
from config.plausible import Plausible
from config.refusals import models_at


@dataclass(frozen=True)
class KeyHelp:
    """Description of a key.

    Attributes:
        name: The key.
        kind: Type and range of its values.
        default: Default value as JSON in backticks, or `required`, `left out`, `empty` or `its own
            defaults`.
        meaning: Description from the docstring of the model.
        models: Models of the values below the key.
    """

    name: str
    kind: str
    default: str
    meaning: str
    models: tuple[type[BaseModel], ...]


@dataclass(frozen=True)
class PlaceHelp:
    """Description of the key at a place in a file.

    Attributes:
        path: Keys and indices from the root to the key.
        key: The key; None at the root of the file.
        allowed: All keys that are allowed next to the key.
    """

    path: Path
    key: KeyHelp | None
    allowed: tuple[KeyHelp, ...]


def describe_model(model: type[BaseModel]) -> str:
    """Return the docstring of a model without its attributes."""
    return _split_docstring(model)[0]


def describe_keys(model: type[BaseModel]) -> tuple[KeyHelp, ...]:
    """Return the keys of a model in their order."""
    _, meanings = _split_docstring(model)
    found = []
    for name, field in model.model_fields.items():
        kind, models = _kind(field.annotation)
        found.append(
            KeyHelp(
                field.alias or name,
                kind + _bounds(field.metadata),
                _default(field),
                meanings.get(name, ""),
                tuple(models),
            )
        )
    return tuple(found)


def describe_place(tree: YamlTree, model: Any, line: int, column: int) -> PlaceHelp:
    """Return the help for a place in a file.

    Args:
        tree: The file.
        model: Model of the file.
        line, column: The place, from 1. The last key that begins at or before it in its line is
            described; without such a key, the first key of the line. In a line without a key, the
            last key above it is described.
    """
    places = [(place, len(path), path) for path, place in tree.positions.items()]
    in_line = [each for each in places if each[0][0] == line]
    before = [each for each in in_line or places if each[0] <= (line, column)]
    _, _, path = max(before) if before else min(in_line or places, key=lambda each: each[:2])
    while path and isinstance(path[-1], int):
        path = path[:-1]
    allowed: dict[str, KeyHelp] = {}
    for each in models_at(model, path[:-1], _kinds_above(tree.data, path[:-1])):
        for key in describe_keys(each):
            allowed.setdefault(key.name, key)
    return PlaceHelp(path, allowed.get(str(path[-1])) if path else None, tuple(allowed.values()))


def _kinds_above(data: Any, path: Path) -> set[int | str]:
    """Return the values of the keys `kind` along a path, with both ends."""
    found: set[int | str] = set()
    for part in (None, *path):
        data = data if part is None else data[part]
        if isinstance(data, dict) and isinstance(data.get("kind"), str):
            found.add(data["kind"])
    return found


def _split_docstring(model: type[BaseModel]) -> tuple[str, dict[str, str]]:
    """Return a model's docstring without its attributes, and the attributes' meanings by name."""
    text, notes = "", ""
    meanings: dict[str, str] = {}
    for base in reversed(model.__mro__):
        text, _, rest = inspect.cleandoc(base.__doc__ or "").partition("\nAttributes:\n")
        attributes, _, notes = rest.partition("\n\n")
        for entry in re.split(r"\n(?= {4}\S)", attributes) if attributes else []:
            names, _, meaning = " ".join(entry.split()).partition(": ")
            meanings.update(dict.fromkeys(names.split(", "), meaning))
    return "\n\n".join(each.strip() for each in (text, notes) if each.strip()), meanings


def _default(field: FieldInfo) -> str:
    if field.is_required():
        return "required"
    if field.default is None:
        return "left out"
    if field.default_factory is not None:
        return "empty"
    if isinstance(field.default, BaseModel):
        return "its own defaults"
    return f"`{json.dumps(field.default, ensure_ascii=False)}`"


def _bounds(metadata: list[Any]) -> str:
    signs = {
        "ge": "≥ {}",
        "gt": "> {}",
        "le": "≤ {}",
        "lt": "< {}",
        "min_length": "at least {}",
        "max_length": "at most {}",
        "pattern": "like `{}`",
    }
    words = [
        sign.format(getattr(m, key))
        for m in metadata
        for key, sign in signs.items()
        if getattr(m, key, None) is not None
    ]
    words += [str(m) for m in metadata if isinstance(m, Plausible)]
    return f" ({', '.join(words)})" if words else ""


_WORDS: Final = {
    float: "number",
    int: "whole number",
    str: "text",
    bool: "true or false",
    type(None): "none",
}


def _kind(annotation: Any) -> tuple[str, list[type[BaseModel]]]:
    """Return a description of a type annotation in words, and the models in the annotation."""
    if inspect.isclass(annotation) and issubclass(annotation, BaseModel):
        return annotation.__name__, [annotation]
    origin = typing.get_origin(annotation)
    arguments = typing.get_args(annotation)
    if origin is typing.Literal:
        words = (str(a) if str(a).isprintable() else json.dumps(a) for a in arguments)
        return " or ".join(f"`{word}`" for word in words), []
    if origin is typing.Annotated:
        word, models = _kind(arguments[0])
        metadata = [m for a in arguments[1:] for m in getattr(a, "metadata", [a])]
        return word + _bounds(metadata), models
    if not arguments:
        if inspect.isclass(annotation) and issubclass(annotation, Enum):
            return " or ".join(f"`{member.value}`" for member in annotation), []
        return _WORDS[annotation], []
    parts = [_kind(a) for a in arguments if a is not Ellipsis]
    models = [model for _, found in parts for model in found]
    if origin is dict:
        return f"{parts[1][0]} by name", models
    if origin is tuple:
        if Ellipsis in arguments:
            return f"list of {parts[0][0]}", models
        return f"{len(parts)} of {parts[0][0]}", models
    return " or ".join(word for word, _ in parts), models
