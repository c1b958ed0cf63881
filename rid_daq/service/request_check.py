"""Checks of a client's request and of the files in it; the worker repeats the checks."""

from __future__ import annotations

import functools
import json
import math
import os
from collections.abc import Collection, Iterable, Iterator, Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from config.errors import ConfigError
from config.formats.approved_files import sha256_of
from config.formats.bounded_file import read_file
from config.formats.json_file import parse_json
from config.formats.yaml_tree import MAX_BYTES, parse_yaml
from config.ranges import CODE
from rid_daq.requests.request import INVALID, Request
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import MOST_CHARACTERS

_NO_PATH: Final = "text"
_TABLE: Final = "joint_table"
TEXT_CODE: Final = "RID-REQ-TEXT"
MOST_OF_PATH: Final = 1000
MOST_OF_PART: Final = 200
MOST_BYTES: Final = 32 << 10
MOST_SHOWN: Final = 300
_MOST_OF: Final = MappingProxyType(
    {"text": 16_000, **dict.fromkeys(("output", "report", "motion", "model", "what"), 1000)}
)
"""Maximum length of a text in fields with pasted files or paths [characters]; in any other field it
is `MOST_CHARACTERS`.
"""

MOST_HASHED: Final = 500_000_000
"""Largest input file of a job that is hashed; feedforward files are the largest [bytes]."""


@functools.cache
def request_schemas() -> dict[str, Any]:
    """Return the JSON schema of the request of every kind of job."""
    return {kind.value: kind.operation.schema() for kind in JobKind}


def check_request(
    kind: JobKind, request: dict[str, Any], folder: Path, of_cells: Collection[Path] = ()
) -> None:
    """Raise an error for an invalid request, and for files that clients must not name.

    Args:
        kind: The kind of the job.
        request: The request.
        folder: The service's folder; a request can name only visible files inside this folder.
        of_cells: Files of the served cells; no job may overwrite them.

    Raises:
        ConfigError: The request is invalid; the message says what and where.
    """
    _refuse_unreadable(kind, request, ())
    parse_request(kind, request, cell="")
    for text in _texts({name: value for name, value in request.items() if name != _NO_PATH}):
        require_inside(text, folder)
    for name in kind.operation.outputs:
        output = request.get(name)
        if output is not None and require_inside(output, folder) in map(Path.resolve, of_cells):
            raise ConfigError(
                f"{output}: is a file of a served cell: choose another name",
                code="RID-OUTPUT-CELL",
            )
    require_ending(kind, request)


def parse_request(kind: JobKind, document: object, **owned: object) -> Request:
    """Return the validated request of a job; both the service and its worker call this function.

    Args:
        document: The request as the client sent it.
        owned: Values of the fields that the service sets, used if the request has these fields.

    Raises:
        ConfigError: The request is invalid for this kind, or a number is out of its range.
    """
    if not isinstance(document, dict):
        raise ConfigError(f"{kind.value}: the request must be a JSON object", code=INVALID)
    _require_bounded(kind, document)
    declared = kind.operation
    declared.refuse_owned(document)
    own = {name: owned[name] for name in declared.owned & owned.keys()}
    return declared.request.of_json({**document, **own}, shown=kind.value)


def _require_bounded(kind: JobKind, request: Mapping[str, Any]) -> None:
    """Raise an error if a text or the whole request is too long (`RID-REQUEST-LENGTH`).

    Raises:
        ConfigError: A text or the request is too long.
    """
    for name, value in request.items():
        most = _MOST_OF.get(name, MOST_CHARACTERS)
        for text in _texts(value):
            if len(text) > most:
                raise ConfigError(
                    f"{kind.value}: {name}: has {len(text)} characters, at most {most} are allowed",
                    code="RID-REQUEST-LENGTH",
                )
    size = len(json.dumps(request, default=str))
    if size > MOST_BYTES:
        raise ConfigError(
            f"{kind.value}: the request has {size} bytes, at most {MOST_BYTES} are allowed",
            code="RID-REQUEST-LENGTH",
        )


def require_ending(kind: JobKind, request: Mapping[str, Any]) -> None:
    """Raise an error if an output file has the wrong file ending (`RID-OUTPUT-ENDING`).

    Raises:
        ConfigError: The ending is not one that the field allows.
    """
    for name, allowed in kind.operation.outputs.items():
        output = request.get(name)
        if output is not None and allowed and Path(str(output)).suffix not in allowed:
            raise ConfigError(
                f"{output}: the {name} of {kind.value} must end in {', '.join(allowed)}",
                code="RID-OUTPUT-ENDING",
            )


def require_inside(path: str, folder: Path, beside: Path | None = None) -> Path:
    """Return the absolute path of a file that a client has named, inside the service's folder.

    Args:
        folder: The service's folder.
        beside: Folder to which the path is relative (default: the service's folder).

    Raises:
        ConfigError: The path is outside the folder, or hidden.
    """
    root = folder.resolve()
    shown = f"{path[:MOST_SHOWN]!r}"
    if not is_file_name(path):
        raise ConfigError(
            f"{shown}: is not a valid file name: use at most {MOST_OF_PART} bytes between two"
            " slashes, and no control characters",
            code="RID-PATH-NAME",
        )
    try:
        found = (root / (beside or root) / path).resolve()
    except (OSError, ValueError, RuntimeError):  # a loop of links, or an impossible file name
        found = root.parent
    if not found.is_relative_to(root) or Path(path).as_posix().startswith("~"):
        raise ConfigError(
            f"{shown}: is outside the service's folder: name a file inside it",
            code="RID-PATH-OUTSIDE",
        )
    if is_hidden(found.relative_to(root)):
        raise ConfigError(f"{shown}: is hidden: name another file", code="RID-PATH-HIDDEN")
    return found


def is_file_name(path: str) -> bool:
    """Return True if a path is short and contains only printable characters."""
    try:
        encoded = path.encode()
    except UnicodeEncodeError:
        return False
    if len(encoded) > MOST_OF_PATH or not path.isprintable():
        return False
    return all(len(part) <= MOST_OF_PART for part in encoded.split(b"/"))


def is_hidden(inside: Path) -> bool:
    """Return True if a part of a path is hidden: it begins with a dot that no digit follows."""
    return any(part.startswith(".") and not part[1:2].isdigit() for part in inside.parts)


def refuse_bad_file(file: Path, content: bytes, folder: Path) -> None:
    """Raise an error for unreadable JSON, and for a motion whose table is outside the folder.

    Args:
        file: Path at which the file will be saved.
        content: Content of the file.
        folder: The service's folder.

    Raises:
        ConfigError: The file is not JSON, or nested too deeply (`RID-FILE-JSON`); or an error of
            `refuse_table_outside`.
    """
    if file.suffix != ".json":
        refuse_table_outside(file, content, folder)
        return
    try:
        parse_json(content)
    except ConfigError as error:
        raise ConfigError(f"{file.name}: {error}", code="RID-FILE-JSON") from None


def refuse_table_outside(motion: Path, content: bytes, folder: Path) -> None:
    """Raise an error for a motion whose table of positions is outside the service's folder.

    Args:
        motion: Path at which the motion file will be saved; the table's path is relative to it.
        content: Content of the file; a file that is not a motion has no table.
        folder: The service's folder.

    Raises:
        ConfigError: The table's path is outside the folder, or hidden.
    """
    table = _table_of(content, motion.name)
    if table is not None:
        require_inside(table, folder, motion.parent)


def hash_named_files(request: dict[str, Any], folder: Path) -> dict[str, str]:
    """Return the SHA-256 of the files that a request names, and of their tables, by their paths.

    Args:
        request: The validated request.
        folder: The service's folder.
    """
    found: dict[str, str] = {}
    waiting = [folder / text for text in _texts(request)]
    while waiting:
        path = waiting.pop()
        try:
            content = read_file(path, MOST_HASHED)
        except OSError:  # most texts name no file; the job itself refuses a file that is unreadable
            continue
        found[os.path.abspath(path)] = sha256_of(content)
        table = _table_of(content, path.name)
        if table is not None:
            waiting.append(path.parent / table)
    return found


def _table_of(content: bytes, name: str) -> str | None:
    """Return the file with the positions of a motion, None if the file has no such table."""
    if len(content) > MAX_BYTES:  # too large for a motion file
        return None
    if (
        _TABLE.encode() not in content and b"\\" not in content
    ):  # escape sequences may encode the keyword
        return None
    try:
        document = parse_yaml(content, name).data
    except ConfigError:
        return None
    if (
        isinstance(document, dict)
        and document.get("kind") == _TABLE
        and isinstance(document.get("file"), str)
    ):
        return str(document["file"])
    return None


def _refuse_unreadable(kind: JobKind, value: Any, path: tuple[str, ...]) -> None:
    """Raise an error for NaN, infinity or lone surrogates, which a schema may accept."""
    if isinstance(value, str) and not value.isascii():
        try:
            value.encode()
        except UnicodeEncodeError:
            where = ".".join(path).encode("ascii", "backslashreplace").decode()
            raise ConfigError(
                f"{kind.value}: {where}: {value!a} contains an incomplete character (lone"
                " surrogate)",
                code=TEXT_CODE,
            ) from None
    if isinstance(value, float) and not math.isfinite(value):
        where = ".".join(path)
        raise ConfigError(f"{kind.value}: {where}: {value} is not a finite number", code=CODE)
    inner: Iterable[tuple[Any, Any]] = ()
    if isinstance(value, dict):
        inner = value.items()
    elif isinstance(value, list):
        inner = enumerate(value)
    for key, each in inner:
        _refuse_unreadable(kind, key, (*path, str(key)))
        _refuse_unreadable(kind, each, (*path, str(key)))


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for each in value.values():
            yield from _texts(each)
    elif isinstance(value, list):
        for each in value:
            yield from _texts(each)
