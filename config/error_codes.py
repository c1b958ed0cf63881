"""`declared_codes`: cause and remedy of every error code.

The codes are declared in `config/bundled/error_codes`, one file for a few areas. An error gives its
code as a literal, `ConfigError(text, code="RID-FILE-READ")`. Errors that need the same remedy
usually share a code.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib import resources


@dataclass(frozen=True)
class ErrorCode:
    """Error code with the cause and remedy that all its errors share.

    Attributes:
        name: `RID-AREA-NAME`.
        cause, remedy: What is wrong, and what the user does about it.
    """

    name: str
    cause: str
    remedy: str


def declared_codes() -> tuple[ErrorCode, ...]:
    """Return all declared codes, sorted by name."""
    folder = resources.files("config") / "bundled" / "error_codes"
    codes = [
        ErrorCode(name, **sentences)
        for file in folder.iterdir()
        for name, sentences in tomllib.loads(file.read_text("utf-8")).items()
    ]
    return tuple(sorted(codes, key=lambda code: code.name))
