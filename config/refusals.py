"""`describe_error`: a validator's error in a YAML file as text, with line and expectation."""

from __future__ import annotations

import difflib
import inspect
import re
import typing
from collections.abc import Sequence
from typing import Annotated, Any, Final

from pydantic import BaseModel, RootModel
from pydantic_core import ErrorDetails

from config.formats.number import number_hint
from config.formats.yaml_tree import YamlTree
from config.plausible import key_name
from config.wrong_value import explain_error

PLACEHOLDER: Final = "?"
"""Placeholder in a generated file for a value that the user must fill in."""

_KEYS_EXPECTED: Final = {"model_type": "Allowed", "dict_type": "Keys of each value"}

WRITTEN: Final = {
    r"^[A-Za-z0-9][\w.-]{0,63}$": "a name begins with a letter or digit and contains only letters,"
    " digits, '_', '.' and '-', at most 64",
    r"^[A-Za-z][\w-]{0,31}$": "a joint's name begins with a letter and contains only letters,"
    " digits, '_' and '-', at most 32",
    r"^[0-9A-F]{4}h:[0-9A-F]{2}$": "an object is written as 6091h:01",
    r"^[0-9A-F]{4}h(:[0-9A-F]{2})?$": "an object is written as 6091h or 6091h:01",
    r"^[A-Za-z0-9][\w-]{0,55}\.meshes$": "the name of the file, which is in the folder of the robot"
    " file, ends in .meshes",
    r"^[0-9a-f]{64}$": "a SHA-256 has 64 digits 0 to 9 and a to f",
    r"^[rt]pdo[1-4]$": "a PDO is written as rpdo1 to rpdo4 or tpdo1 to tpdo4",
    r"^[!-~]{1,8}$": "one to eight ASCII characters without space are expected",
    r"^[!-/:-@]$": "one ASCII punctuation mark is expected",
}
"""Explanation of each text pattern that the models use."""


def without_other_kinds(tree: YamlTree, details: Sequence[ErrorDetails]) -> list[ErrorDetails]:
    """Return the errors without those of kinds that a value is clearly not meant to be.

    A value of several kinds, such as a name or keys, causes an error for each kind. If keys are
    given, only errors of these keys help.
    """
    paths = [_known_path(tree, detail["loc"]) for detail in details]

    def has_inner(path: tuple[int | str, ...]) -> bool:
        return any(len(each) > len(path) and each[: len(path)] == path for each in paths)

    return [
        detail
        for detail, path in zip(details, paths, strict=True)
        if not (
            detail["type"].endswith("_type")
            and isinstance(detail["input"], dict | list)
            and has_inner(path)
        )
    ]


def describe_error(tree: YamlTree, detail: ErrorDetails, model: Any) -> str:
    """Return one validation error as a line of text.

    Args:
        tree: The file.
        detail: The error.
        model: The model that the file was validated against.
    """
    path = _known_path(tree, detail["loc"])
    where = tree.where(path)
    key = key_name(path)
    prefix = f"{where}: {key}: " if key else f"{where}: "
    if detail["type"] == "extra_forbidden":
        kinds = {part for part in detail["loc"] if part not in path}
        allowed = _keys_of(models_at(model, path[:-1], kinds))
        close = difflib.get_close_matches(str(path[-1]), allowed, n=1)
        meant = f"; did you mean {close[0]}?" if close else "."
        return f"{prefix}unknown key{meant} Allowed: {', '.join(allowed)}"
    if detail["type"] in ("union_tag_not_found", "union_tag_invalid"):
        found = models_at(model, path, set())
        return _explain_wrong_kind(
            tree, path, detail.get("input"), sorted(set().union(*map(_kinds_of, found)))
        )
    given = detail.get("input")
    if given == PLACEHOLDER:
        return f"{prefix}'?' is a placeholder: replace it by a value"
    if detail["type"] == "string_pattern_mismatch":
        return f"{prefix}{_explain_pattern(str(given), detail.get('ctx', {}).get('pattern', ''))}"
    if detail["type"] == "missing":
        return f"{prefix}{explain_error(detail)}; add it"
    hint = number_hint(given) if isinstance(given, str) else ""
    text = f"{prefix}{explain_error(detail, hint)}"
    title = _KEYS_EXPECTED.get(detail["type"])
    keys = [] if title is None else _keys_of(models_at(model, path, set()))
    return f"{text}. {title}: {', '.join(keys)}" if keys else text


def _keys_of(models: Sequence[type[BaseModel]]) -> list[str]:
    return sorted({name for model in models for name in model.model_fields})


def _explain_pattern(given: str, pattern: str) -> str:
    """Explain how a text must be written, and suggest a similar one that is valid."""
    problem = f"{given!r}: {WRITTEN.get(pattern, f'it does not match {pattern}')}"
    near = re.sub(r"[^\w.-]+", "_", given.strip())
    return (
        f"{problem}; {near!r} is valid" if near != given and re.search(pattern, near) else problem
    )


def _explain_wrong_kind(
    tree: YamlTree, path: tuple[int | str, ...], given: Any, kinds: list[str]
) -> str:
    """Explain that `kind` is missing or unknown, with the allowed kinds."""
    kind = given.get("kind") if isinstance(given, dict) else None
    if kind is None:
        return f"{tree.where(path)}: the key 'kind' is missing. Allowed: {', '.join(kinds)}"
    close = difflib.get_close_matches(str(kind), kinds, n=1)
    meant = f"; did you mean {close[0]}?" if close else "."
    path = (*path, "kind")
    where = f"{tree.where(path)}: {key_name(path)}"
    return f"{where}: unknown kind {kind!r}{meant} Allowed: {', '.join(kinds)}"


def _known_path(tree: YamlTree, location: tuple[int | str, ...]) -> tuple[int | str, ...]:
    path: tuple[int | str, ...] = ()
    for part in location:
        if (*path, part) in tree.positions:
            path = (*path, part)
    return path


def models_at(
    annotation: Any, path: tuple[int | str, ...], kinds: set[int | str]
) -> list[type[BaseModel]]:
    """Return the models at `path` below a model or annotation.

    If some of these models have a key `kind` with a value in `kinds`, only they are returned.
    """
    models = _models_in(annotation)
    models = [model for model in models if kinds & _kinds_of(model)] or models
    if not path:
        return models
    if isinstance(path[0], int) or typing.get_origin(annotation) is dict:
        return models_at(annotation, path[1:], kinds)
    fields = [model.model_fields.get(path[0]) for model in models]
    return [
        model
        for field in fields
        if field is not None
        for model in models_at(field.annotation, path[1:], kinds)
    ]


def _kinds_of(model: type[BaseModel]) -> set[str]:
    """Return the allowed values of a model's key `kind`."""
    field = model.model_fields.get("kind")
    return set() if field is None else set(typing.get_args(field.annotation))


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if inspect.isclass(annotation):
        if issubclass(annotation, RootModel):
            return _models_in(annotation.model_fields["root"].annotation)
        return [annotation] if issubclass(annotation, BaseModel) else []
    arguments = typing.get_args(annotation)
    if typing.get_origin(annotation) is Annotated:
        arguments = arguments[:1]
    return [model for argument in arguments for model in _models_in(argument)]
