"""Distribution of samples over the cores of the computer."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Final

RANGE_SAMPLES: Final = 1024  # samples per range; smaller ranges cost more time than they save


def run_in_ranges(samples: int, fill: Callable[[int, int], object]) -> None:
    """Call fill(first, last) for ranges that cover all samples; use several cores for many samples.

    As soon as a thread is free, it takes the next range, so a core that is busy with other programs
    does not delay the other cores. Threads save time only if `fill` releases Python's global
    interpreter lock. The result of a call of `fill` must not depend on the other calls.
    """
    ranges = iter(range(0, samples, RANGE_SAMPLES))

    def work() -> None:
        for first in ranges:
            fill(first, min(first + RANGE_SAMPLES, samples))

    helpers = min(_cores(), samples // RANGE_SAMPLES) - 1
    others = [_pool().submit(work) for _ in range(helpers)]
    try:
        work()
    finally:
        for other in others:
            if not other.cancel():
                other.result()


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, _cores() - 1), thread_name_prefix="dynamics")


if hasattr(os, "register_at_fork"):  # a forked child needs its own threads
    os.register_at_fork(after_in_child=_pool.cache_clear)
