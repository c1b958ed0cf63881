"""An error names the resource that is short; a programming error is not reported as a shortage."""

from __future__ import annotations

import errno

import pytest

from config.errors import ConfigError, ShortageError
from config.process.shortage import as_shortage, named_error, require_memory
from tests.builders.raised_codes import raises_code


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (MemoryError(), "not enough memory"),
        (OSError(errno.ENOSPC, "x", "/runs/a"), "/runs/a: the disk is full"),
        (OSError(errno.EMFILE, "x"), "too many files are open"),
        (OSError(errno.EROFS, "x"), "the disk is read-only"),
        (OSError(errno.EFBIG, "x"), r"`ulimit -f`"),
        (ImportError("libx.so: failed to map segment from shared object"), "not enough memory"),
        (RuntimeError("can't start new thread"), "no more processes or threads"),
    ],
)
def test_the_missing_resource_is_named_with_a_remedy(error: Exception, words: str) -> None:
    found = as_shortage(error)
    assert isinstance(found, ShortageError)
    assert words in str(found)


def test_causes_of_an_error_are_searched() -> None:
    outer = ValueError("no array")
    outer.__cause__ = RuntimeError("inside")
    outer.__cause__.__context__ = MemoryError()
    found = as_shortage(outer)
    assert found is not None
    assert "memory" in str(found)


def test_circular_causes_end_the_search() -> None:
    first, second = ValueError("a"), ValueError("b")
    first.__context__, second.__context__ = second, first
    assert as_shortage(first) is None


def test_similar_words_in_other_errors_are_not_a_shortage() -> None:
    assert as_shortage(ValueError("too many open files were asked for")) is None
    assert as_shortage(OSError(errno.ENOENT, "no such file")) is None


def test_our_own_errors_are_unchanged_and_programming_errors_are_raised() -> None:
    ours = ConfigError("a key is wrong")
    assert named_error(ours) is ours
    assert isinstance(named_error(OSError(errno.EIO, "x")), ShortageError)
    mistake = KeyError("x")
    with pytest.raises(KeyError) as caught:
        named_error(mistake)
    assert caught.value is mistake


def test_more_memory_than_available_is_refused_at_the_start() -> None:
    require_memory(1 << 20)
    with raises_code(ShortageError, "RID-SYSTEM-SHORTAGE", f"{1 << 40} MB"):
        require_memory(1 << 60)
