"""`raises_code`: an error of ours is raised, with its code; `raises_invalid`: a model refuses."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TypeVar

import pytest
from pydantic import ValidationError

from config.errors import RidDaqError

E = TypeVar("E", bound=RidDaqError)


@contextmanager
def raises_code(kind: type[E], code: str, *details: str) -> Iterator[pytest.ExceptionInfo[E]]:
    """Expect an error.

    Args:
        kind: Its class.
        *details: Positions, names and numbers that its text has to state.
    """
    with pytest.raises(kind) as caught:
        yield caught
    assert caught.value.refusal == code, str(caught.value)
    for detail in details:
        assert detail in str(caught.value)


@contextmanager
def raises_invalid(key: str, *details: str) -> Iterator[pytest.ExceptionInfo[ValidationError]]:
    """Expect that a model refuses one value.

    Args:
        key: The value's key, such as ``pdos.1``; empty for the model as a whole.
        *details: Names and numbers that the text of the error has to state.
    """
    with pytest.raises(ValidationError) as caught:
        yield caught
    (error,) = caught.value.errors(include_url=False)
    assert ".".join(map(str, error["loc"])) == key
    for detail in details:
        assert detail in error["msg"]


def line_of(path: Path, key: str) -> int:
    """Return the line of a YAML file on which a key stands first."""
    lines = path.read_text().splitlines()
    return next(n for n, line in enumerate(lines, 1) if line.lstrip(" -").startswith(f"{key}:"))
