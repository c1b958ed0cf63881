"""`raises_code`: an error of ours is raised, with its code."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import TypeVar

import pytest

from config.errors import RidDaqError

E = TypeVar("E", bound=RidDaqError)


@contextmanager
def raises_code(kind: type[E], code: str, *details: str) -> Iterator[pytest.ExceptionInfo[E]]:
    """Expect an error.

    Parameters
    ----------
    kind : type
        Its class.
    code : str
        Its code.
    *details : str
        Positions, names and numbers that its text has to state.
    """
    with pytest.raises(kind) as caught:
        yield caught
    assert caught.value.refusal == code, str(caught.value)
    for detail in details:
        assert detail in str(caught.value)
