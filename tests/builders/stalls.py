"""Detection of stalls of the computer; a test is repeated only if it failed during a stall.

A virtual machine sometimes stands still for up to a second. A real-time test that fails during such
a stall proves nothing. A witness process wakes up periodically; it measures its longest delay.
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
    """Measurement of the computer's longest stall while its `with` block is active [s]."""

    longest_s = 0.0


@contextlib.contextmanager
def witness() -> Iterator[Witness]:
    """Run the witness in its own process."""
    stall = Witness()
    with subprocess.Popen(
        [sys.executable, "-c", WITNESS], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "awake\n"
        try:
            yield stall
        finally:
            output, _ = process.communicate("\n")
            stall.longest_s = float(output)


def where_time_runs(attempt: Callable[[], T], stall_s: float) -> T:
    """Return the result of a real-time attempt; repeat it only after a stall of `stall_s` or more.

    Args:
        attempt: Function with assertions that can be repeated.
        stall_s: Shorter stalls must not affect the attempt [s].
    """
    for _ in range(ATTEMPTS):
        try:
            with witness() as stall:
                return attempt()
        except Exception:
            if stall.longest_s < stall_s:
                raise
    pytest.fail(f"in {ATTEMPTS} attempts the computer stalled for {stall_s} s each time")
