"""What a client may ask for, and files that it may name; the worker checks a request again."""

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
"""Characters of a field's texts, if not `MOST_CHARACTERS`: a pasted file, and paths."""

MOST_HASHED: Final = 500_000_000
"""The largest file that a job may be made from: a feedforward."""


@functools.cache
def request_schemas() -> dict[str, Any]:
    """Return the JSON schema of the request of every kind of job."""
    return {kind.value: kind.operation.schema() for kind in JobKind}


def check_request(
    kind: JobKind, request: dict[str, Any], folder: Path, of_cells: Collection[Path] = ()
) -> None:
    """Refuse what is no request of its kind, and files that a client may not name.

    Args:
        kind: The kind of the job.
        request: What is asked for.
        folder: The service's folder: files outside of it, and hidden ones, are not named.
        of_cells: The files of cells: no job writes over them.

    Raises:
        ConfigError: It says what, and where.
    """
    _refuse_unreadable(kind, request, ())
    request_of(kind, request, cell="")
    for text in _texts({name: told for name, told in request.items() if name != _NO_PATH}):
        require_inside(text, folder)
    for name in kind.operation.outputs:
        output = request.get(name)
        if output is not None and require_inside(output, folder) in map(Path.resolve, of_cells):
            raise ConfigError(
                f"{output}: belongs to a cell that is served: choose another name",
                code="RID-OUTPUT-CELL",
            )
    require_ending(kind, request)


def request_of(kind: JobKind, told: object, **owned: object) -> Request:
    """Return the request of a job; the service checks it by this, and its worker again.

    Args:
        told: What the client says of it.
        owned: Values of fields that the service sets, as far as the request has them.

    Raises:
        ConfigError: It is not a request of this kind, or a number in it is outside of its range.
    """
    if not isinstance(told, dict):
        raise ConfigError(f"{kind.value}: the request must be a JSON object", code=INVALID)
    _require_bounded(kind, told)
    declared = kind.operation
    declared.refuse_owned(told)
    own = {name: owned[name] for name in declared.owned & owned.keys()}
    return declared.request.of_json({**told, **own}, shown=kind.value)


def _require_bounded(kind: JobKind, request: Mapping[str, Any]) -> None:
    """Refuse texts that are too long, and a request that is (`RID-REQUEST-LENGTH`).

    Raises:
        ConfigError: One of them is.
    """
    for name, told in request.items():
        most = _MOST_OF.get(name, MOST_CHARACTERS)
        for text in _texts(told):
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
    """Refuse an output whose name does not end as files of its kind do (`RID-OUTPUT-ENDING`).

    Raises:
        ConfigError: It ends otherwise.
    """
    for name, allowed in kind.operation.outputs.items():
        output = request.get(name)
        if output is not None and allowed and Path(str(output)).suffix not in allowed:
            raise ConfigError(
                f"{output}: the {name} of {kind.value} ends in {', '.join(allowed)}: give such a"
                " name",
                code="RID-OUTPUT-ENDING",
            )


def require_inside(path: str, folder: Path, beside: Path | None = None) -> Path:
    """Return a path that a client has named, resolved inside the service's folder.

    Args:
        folder: The service's folder.
        beside: Where the path begins; the service's folder where nothing is said.

    Raises:
        ConfigError: It leads out of it, or to what is hidden.
    """
    root = folder.resolve()
    shown = f"{path[:MOST_SHOWN]!r}"
    if not is_file_name(path):
        raise ConfigError(
            f"{shown}: is no name of a file here: at most {MOST_OF_PART} bytes between two"
            " slashes, without control characters",
            code="RID-PATH-NAME",
        )
    try:
        found = (root / (beside or root) / path).resolve()
    except (OSError, ValueError, RuntimeError):  # a loop of links; what no file can be called
        found = root.parent
    if not found.is_relative_to(root) or Path(path).as_posix().startswith("~"):
        raise ConfigError(
            f"{shown}: is not inside the service's folder; name a file in there",
            code="RID-PATH-OUTSIDE",
        )
    if is_hidden(found.relative_to(root)):
        raise ConfigError(f"{shown}: is hidden: name another file", code="RID-PATH-HIDDEN")
    return found


def is_file_name(path: str) -> bool:
    """Return whether a path can be of a file that every client can name."""
    try:
        encoded = path.encode()
    except UnicodeEncodeError:
        return False
    if len(encoded) > MOST_OF_PATH or not path.isprintable():
        return False
    return all(len(part) <= MOST_OF_PART for part in encoded.split(b"/"))


def is_hidden(inside: Path) -> bool:
    """Return whether a path is the service's own, or hidden otherwise; a number never is."""
    return any(part.startswith(".") and not part[1:2].isdigit() for part in inside.parts)


def refuse_bad_file(file: Path, content: bytes, folder: Path) -> None:
    """Refuse JSON that no reader takes, and a motion whose table is outside the service's folder.

    Args:
        file: Where it is to lie.
        content: The file.
        folder: The service's folder.

    Raises:
        ConfigError: `RID-FILE-JSON`: it is no JSON, or nested too deeply; or as
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
    """Refuse a motion whose positions stand in a file outside the service's folder.

    Args:
        motion: Where its file is to lie; its table is looked for from there.
        content: The file; what is no motion has no table.
        folder: The service's folder.

    Raises:
        ConfigError: The table leads out of it, or to what is hidden.
    """
    table = _table_of(content, motion.name)
    if table is not None:
        require_inside(table, folder, motion.parent)


def hashes_of_named(request: dict[str, Any], folder: Path) -> dict[str, str]:
    """Return the SHA-256 of the files that a request names, and of their tables, by their paths.

    Args:
        request: What is asked for, checked.
        folder: The service's folder.
    """
    found: dict[str, str] = {}
    waiting = [folder / text for text in _texts(request)]
    while waiting:
        path = waiting.pop()
        try:
            content = read_file(path, MOST_HASHED)
        except OSError:  # it names no file, or one that the job itself refuses
            continue
        found[os.path.abspath(path)] = sha256_of(content)
        table = _table_of(content, path.name)
        if table is not None:
            waiting.append(path.parent / table)
    return found


def _table_of(content: bytes, name: str) -> str | None:
    """Return the file in which a motion's positions stand, None where there is none."""
    if len(content) > MAX_BYTES:  # no motion file
        return None
    if _TABLE.encode() not in content and b"\\" not in content:  # escapes may spell it too
        return None
    try:
        told = parse_yaml(content, name).data
    except ConfigError:
        return None
    if isinstance(told, dict) and told.get("kind") == _TABLE and isinstance(told.get("file"), str):
        return str(told["file"])
    return None


def _refuse_unreadable(kind: JobKind, value: Any, path: tuple[str, ...]) -> None:
    """Refuse what no schema refuses for certain: NaN, infinities, and texts of half characters."""
    if isinstance(value, str) and not value.isascii():
        try:
            value.encode()
        except UnicodeEncodeError:
            where = ".".join(path).encode("ascii", "backslashreplace").decode()
            raise ConfigError(
                f"{kind.value}: {where}: {value!a} has half a character", code=TEXT_CODE
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
