"""What a client may ask for: the frozen schemas of requests, and paths that stay in the folder.

The schemas lie in `requests.json`, written from the requests of the commands, so that the service
need not import what does the jobs. The worker reads a request again with all its rules.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Iterator
from importlib.resources import files
from pathlib import Path
from typing import Any

from jsonschema import Draft202012Validator
from jsonschema.exceptions import best_match

from config.errors import ConfigError
from rid_daq.service.job_kinds import JobKind


@functools.cache
def request_schemas() -> dict[str, Any]:
    """Return the JSON schema of the request of every kind of job."""
    text = files("rid_daq.service").joinpath("requests.json").read_text(encoding="utf-8")
    found: dict[str, Any] = json.loads(text)
    return found


def check_request(kind: JobKind, request: dict[str, Any], folder: Path) -> None:
    """Refuse what is no request of its kind, and files outside the service's folder.

    Raises
    ------
    ConfigError
        It says what, and where.
    """
    error = best_match(_validator(kind).iter_errors(request))
    if error is not None:
        where = ".".join(map(str, error.absolute_path)) or "request"
        raise ConfigError(f"{kind.value}: {where}: {error.message}")
    for text in _texts(request):
        if "/" in text or text.startswith(("~", "..")):
            require_inside(text, folder)


def require_inside(path: str, folder: Path) -> Path:
    """Return a path that a client has named, resolved inside the service's folder.

    Raises
    ------
    ConfigError
        It leads out of it.
    """
    root = folder.resolve()
    try:
        found = (root / path).resolve()
    except (OSError, ValueError):  # a loop of links; what no file can be called
        found = root.parent
    if not found.is_relative_to(root):
        raise ConfigError(f"{path!r}: is not inside the service's folder; name a file in there")
    return found


@functools.cache
def _validator(kind: JobKind) -> Draft202012Validator:
    return Draft202012Validator(request_schemas()[kind.value])


def _texts(value: Any) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, dict):
        for each in value.values():
            yield from _texts(each)
    elif isinstance(value, list):
        for each in value:
            yield from _texts(each)
