"""`raises_code`: expects an error with a code; `raises_invalid`: expects an invalid value."""

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
        kind: Class of the error.
        code: Code of the error.
        *details: Positions, names and numbers that the text must contain.
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
        key: Key of the value, such as ``pdos.1``; empty for the whole model.
        *details: Names and numbers that the error text must contain.
    """
    with pytest.raises(ValidationError) as caught:
        yield caught
    (error,) = caught.value.errors(include_url=False)
    assert ".".join(map(str, error["loc"])) == key
    for detail in details:
        assert detail in error["msg"]


def line_of(path: Path, key: str) -> int:
    """Return the number of the first line with a key in a YAML file, from 1."""
    lines = path.read_text().splitlines()
    return next(n for n, line in enumerate(lines, 1) if line.lstrip(" -").startswith(f"{key}:"))
