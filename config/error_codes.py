"""`declared_codes`: cause and remedy of every error code.

The codes are declared in `config/bundled/error_codes`, one file for a few areas. An error names its
code as a literal, `ConfigError(text, code="RID-FILE-READ")`; two errors that a user mends in the
same way share a code.
"""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from importlib import resources


@dataclass(frozen=True)
class ErrorCode:
    """A code, with what is common to all its errors.

    Attributes:
        name: `RID-AREA-NAME`.
        cause, remedy: What is wrong, and what the user does about it; one sentence each.
    """

    name: str
    cause: str
    remedy: str


def declared_codes() -> tuple[ErrorCode, ...]:
    """Return every declared code, sorted by its name."""
    folder = resources.files("config") / "bundled" / "error_codes"
    codes = [
        ErrorCode(name, **sentences)
        for file in folder.iterdir()
        for name, sentences in tomllib.loads(file.read_text("utf-8")).items()
    ]
    return tuple(sorted(codes, key=lambda code: code.name))
