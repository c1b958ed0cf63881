"""Run ids: sortable by time, unique, of letters and digits that no file system minds (ULID)."""

from __future__ import annotations

import re
import secrets

_ALPHABET = "0123456789ABCDEFGHJKMNPQRSTVWXYZ"
_LENGTH = 26
RUN_ID = re.compile(rf"[0-7][{_ALPHABET}]{{{_LENGTH - 1}}}")


def new_run_id(now_ns: int) -> str:
    """Return a new id: 48 bits of milliseconds since 1970, then 80 random bits, in base 32.

    Parameters
    ----------
    now_ns : int
        Time since 1970 [ns].
    """
    number = (now_ns // 1_000_000 % (1 << 48)) << 80 | secrets.randbits(80)
    digits = []
    for _ in range(_LENGTH):
        number, digit = divmod(number, 32)
        digits.append(_ALPHABET[digit])
    return "".join(reversed(digits))
