"""Strict reading of JSON text and files, without features that JSON readers treat differently.

Refused are non-finite numbers (`NaN`, `Infinity`, `1e999`), integers beyond 64 bits, duplicate
keys, lone surrogates, and excessive nesting.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, NoReturn, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from config.errors import ConfigError, system_errors
from config.formats.bounded_file import encoding_hint, read_file
from config.formats.file_kinds import document_kind, kind_of_text
from config.wrong_value import explain_error

if TYPE_CHECKING:
    from pydantic_core import ErrorDetails

M = TypeVar("M", bound=BaseModel)

MAX_DEPTH = 64
OTHER_FORMAT: Final = "RID-FILE-FORMAT"
_LONGEST_INTEGER = 20
_LARGEST_INTEGER = 1 << 63


def parse_json(data: bytes | str) -> Any:
    """Parse one JSON document.

    Raises:
        ConfigError: The text is not JSON, or uses a refused feature. The message names the key, or
            line and column, but not the file.
    """
    try:
        text = data.decode("utf-8-sig") if isinstance(data, bytes) else data
        tree = json.loads(
            text, parse_int=_integer, parse_constant=float, object_pairs_hook=_refuse_duplicates
        )
    except UnicodeDecodeError as error:
        raise ConfigError(
            f"not UTF-8 text (byte {error.start}){encoding_hint(error.object)}",
            code="RID-FILE-TYPE",
        ) from None
    except json.JSONDecodeError as error:
        raise ConfigError(
            f"line {error.lineno}, column {error.colno}: not valid JSON: {error.msg}",
            code="RID-FILE-SYNTAX",
        ) from None
    except RecursionError:
        raise ConfigError(
            f"not valid JSON: nested more than {MAX_DEPTH} deep",
            code="RID-FILE-SIZE",
        ) from None
    _refuse_invalid_values(tree)
    return tree


def read_json_file(path: Path, model: type[M], most_bytes: int, what: str) -> M:
    """Read a JSON file that this program wrote.

    Args:
        path: The file.
        model: Model of the content.
        most_bytes: The largest allowed size.
        what: Description of the file for the message: "a payload of `rid-daq payload identify`".

    Raises:
        ConfigError: The file cannot be read or is not valid; the message has the file and, if
            known, the key or the line.
    """
    return json_content(read_content(path, most_bytes), path, model, what)


def read_content(path: Path, most_bytes: int) -> bytes:
    """Return a file's bytes, for callers that read a file once and keep its bytes.

    Raises:
        ConfigError: The file cannot be read, or is larger than `most_bytes`.
    """
    with system_errors(ConfigError, f"{path}: cannot be read", code="RID-FILE-READ"):
        return read_file(path, most_bytes)


def json_content(data: bytes, path: Path, model: type[M], what: str) -> M:
    """Return the content of a JSON file's bytes; arguments and errors as `read_json_file`."""
    try:
        parse_json(data)
        return model.model_validate_json(data)
    except ConfigError as error:
        _refuse_kind(path, data, model, what)
        raise ConfigError(f"{path}: not {what}: {error}", code=error.refusal) from None
    except ValidationError as error:
        _refuse_kind(path, data, model, what)
        first = error.errors()[0]
        _refuse_format(path, first, what)
        where = ".".join(str(part) for part in first["loc"]) or "the whole document"
        raise ConfigError(
            f"{path}: not {what}: {where}: {explain_error(first)}", code="RID-FILE-VALUE"
        ) from error


def _refuse_format(path: Path, error: ErrorDetails, what: str) -> None:
    """Refuse a file whose first error is another version of the expected format."""
    if error["loc"] == ("format",) and error["type"] == "literal_error":
        expected, found = str(error.get("ctx", {}).get("expected")), error["input"]
        if _format_name(expected) == _format_name(repr(found)):
            raise other_format(f"{path}: {what}", found, expected)


def _format_name(shown: str) -> str:
    """Return the name of a format such as 'rid-daq feedforward 1'; empty for a bare number."""
    return shown.strip("'").rpartition(" ")[0]


def other_format(where: str, found: object, expected: object) -> ConfigError:
    """Return the error for a file in a format version that this program does not read.

    Args:
        where: Path and description of the file.
        found, expected: The format versions.
    """
    return ConfigError(
        f"{where}: format {str(found)[:80]}, but this program reads only format {expected}; write"
        " the file again with this version",
        code=OTHER_FORMAT,
    )


def _refuse_kind(path: Path, data: bytes, model: type[BaseModel], what: str) -> None:
    """Refuse a file of another type, with the type in the message."""
    kind = kind_of_text(data)
    literals = [get_args(field.annotation) for field in model.model_fields.values()]
    accepted = {document_kind(each) for literal in literals for each in literal}
    if kind is not None and kind not in accepted:
        raise ConfigError(f"{path}: this is {kind}; give {what}", code="RID-FILE-TYPE") from None


def _integer(digits: str) -> int | float:
    """Return an integer, or infinity if it exceeds 64 bits; infinity is refused later."""
    number = int(digits) if len(digits) <= _LONGEST_INTEGER else math.inf
    return number if abs(number) < _LARGEST_INTEGER else math.inf


def _refuse_duplicates(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) < len(pairs):
        double = Counter(key for key, _ in pairs).most_common(1)[0][0]
        raise ConfigError(
            f"the key {double[:80]!r} occurs twice at the same level; remove one",
            code="RID-FILE-DUPLICATE",
        )
    return members


def _refuse_invalid_values(tree: Any) -> None:
    """Refuse invalid values anywhere in a tree, with their keys."""
    waiting: list[tuple[tuple[str, ...], Any]] = [((), tree)]
    while waiting:
        path, value = waiting.pop()
        if len(path) > MAX_DEPTH:
            raise ConfigError(f"nested more than {MAX_DEPTH} deep", code="RID-FILE-SIZE")
        if isinstance(value, dict):
            for key, child in value.items():
                _refuse_half_characters(path, key)
                waiting.append(((*path, key), child))
        elif isinstance(value, list):
            waiting.extend(((*path, str(i)), child) for i, child in enumerate(value))
        elif isinstance(value, str):
            _refuse_half_characters(path, value)
        elif isinstance(value, float) and not math.isfinite(value):
            _refuse(path, "is not a finite number; give a finite one")


def _refuse_half_characters(path: tuple[str, ...], text: str) -> None:
    if not text.isascii() and any("\ud800" <= character <= "\udfff" for character in text):
        _refuse(path, "contains half a character (a lone surrogate); correct the text")


def _refuse(path: tuple[str, ...], problem: str) -> NoReturn:
    raise ConfigError(f"{'.'.join(path) or 'the whole document'}: {problem}", code="RID-FILE-VALUE")
