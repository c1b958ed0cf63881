"""`safety_now_s`: the clock for functions that protect people: leases, readiness, held keys."""

from __future__ import annotations

import time
from pathlib import Path


def safety_now_s() -> float:
    """Return the time since the computer started [s], including suspension.

    A change of the date does not move this clock, and all processes of the computer share it.

    Note:
        `CLOCK_BOOTTIME` of clock_gettime(2).
    """
    return time.clock_gettime(time.CLOCK_BOOTTIME)


def boot_id() -> str:
    """Return the kernel's identifier of the current boot.

    A time of `safety_now_s` is not valid after a reboot. Therefore store this identifier with a
    time.
    """
    return Path("/proc/sys/kernel/random/boot_id").read_text(encoding="ascii").strip()
