"""Run ids (ULID): unique, sorted by time, with letters and digits that all file systems accept."""

from __future__ import annotations

import os
import re
import secrets
from pathlib import Path

_ALPHABET = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
_LENGTH = 26
_RANDOM_BITS = 80
# Largest step back of the clock after which new ids still sort behind the existing ones. After a
# larger step, the times of the existing runs are considered wrong.
_CLOCK_STEP_NS = 24 * 3600 * 10**9
RUN_ID = re.compile(rf"[0-7][{_ALPHABET}]{{{_LENGTH - 1}}}")


def new_run_id(now_ns: int) -> str:
    """Return a new id: 48 bits of milliseconds since 1970, then 80 random bits, in base 32.

    Args:
        now_ns: Time since 1970 [ns].
    """
    number = (now_ns // 1_000_000 % (1 << 48)) << _RANDOM_BITS | secrets.randbits(_RANDOM_BITS)
    digits = []
    for _ in range(_LENGTH):
        number, digit = divmod(number, 32)
        digits.append(_ALPHABET[digit])
    return "".join(reversed(digits))


def time_of_run_id(run_id: str) -> int:
    """Return the time since 1970 for which an id was made [ns]."""
    number = 0
    for letter in run_id:
        number = 32 * number + _ALPHABET.index(letter)
    return (number >> _RANDOM_BITS) * 1_000_000


def time_after_existing_runs(root: Path, now_ns: int) -> int:
    """Return a time whose id sorts after those below `root`.

    The result is the present time, or later if the clock was set back by at most a day. After a
    larger step, the id sorts before those with the wrong, later times.
    """
    ids = [name for name in os.listdir(root) if RUN_ID.fullmatch(name)]
    newest_ns = time_of_run_id(max(ids)) if ids else 0
    behind_ns = newest_ns - now_ns
    return newest_ns + 1_000_000 if 0 <= behind_ns + 1_000_000 <= _CLOCK_STEP_NS else now_ns
