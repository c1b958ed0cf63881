"""Samples shared out between the machine's cores."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Final

SMALLEST_SHARE: Final = 1024  # samples; handing over fewer costs more than it saves


def share_out(samples: int, fill: Callable[[int, int], object]) -> None:
    """Call fill(first, last) for shares that cover all samples, on all cores where it pays.

    `fill` must release the interpreter's lock to gain, and what it writes must not depend on how
    the samples are shared out.
    """
    shares = max(1, min(_cores(), samples // SMALLEST_SHARE))
    bounds = [samples * share // shares for share in range(shares + 1)]
    others = [_pool().submit(fill, *bounds[share : share + 2]) for share in range(1, shares)]
    try:
        fill(*bounds[:2])
    finally:
        for other in others:
            other.result()


def _cores() -> int:
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(max(1, _cores() - 1), thread_name_prefix="dynamics")


if hasattr(os, "register_at_fork"):  # threads do not live on in a fork: it gets a pool of its own
    os.register_at_fork(after_in_child=_pool.cache_clear)
