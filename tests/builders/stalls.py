"""A witness of the computer's stalls: what real time failed for them is tried again, nothing else.

A virtual machine stands still now and then, for up to a second, whatever runs on it. A test in real
time that fails meanwhile has shown nothing. The witness does nothing but wake up, as an ordinary
process, and knows for how long it could not.
"""

from __future__ import annotations

import contextlib
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import TypeVar

import pytest

WITNESS = """
import select, sys, time
print("awake", flush=True)
longest_s, last_s = 0.0, time.monotonic()
while not select.select([sys.stdin], [], [], 0.002)[0]:
    now_s = time.monotonic()
    longest_s, last_s = max(longest_s, now_s - last_s), now_s
print(longest_s, flush=True)
"""
ATTEMPTS = 8

T = TypeVar("T")


class Witness:
    """Knows, once its `with` has been left, for how long the computer stood still at most [s]."""

    longest_s = 0.0


@contextlib.contextmanager
def witness() -> Iterator[Witness]:
    """Watch the computer from a process of its own."""
    seen = Witness()
    with subprocess.Popen(
        [sys.executable, "-c", WITNESS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "awake\n"
        try:
            yield seen
        finally:
            said, _ = process.communicate("\n")
            seen.longest_s = float(said)


def where_time_runs(attempt: Callable[[], T], stall_s: float) -> T:
    """Return what an attempt in real time comes to; only stalls of the computer earn another one.

    Args:
        attempt: What asserts something, and can be done again.
        stall_s: A shorter stall than this must not matter to it [s].
    """
    for _ in range(ATTEMPTS):
        try:
            with witness() as seen:
                return attempt()
        except Exception:
            if seen.longest_s < stall_s:
                raise
    pytest.fail(f"in {ATTEMPTS} attempts the computer stood still for {stall_s} s each time")
