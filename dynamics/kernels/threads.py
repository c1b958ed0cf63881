"""Distribution of samples over the machine's cores."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import cache
from typing import Final

SHARE: Final = 1024  # samples per task; distributing smaller tasks costs more than it saves


def share_out(samples: int, fill: Callable[[int, int], object]) -> None:
    """Call fill(first, last) for ranges that cover all samples, on several cores if that pays.

    A thread takes the next range as soon as it is free. Therefore a core that is busy with other
    programs does not delay the others. `fill` must release the interpreter's lock to gain speed.
    Its results must not depend on the division of the samples.
    """
    shares = iter(range(0, samples, SHARE))

    def work() -> None:
        for first in shares:
            fill(first, min(first + SHARE, samples))

    helpers = min(_cores(), samples // SHARE) - 1
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


if hasattr(os, "register_at_fork"):  # threads do not survive a fork, so a child needs a new pool
    os.register_at_fork(after_in_child=_pool.cache_clear)
