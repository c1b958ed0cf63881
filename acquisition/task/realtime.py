"""Operating system settings for a process with a fixed cycle time."""

from __future__ import annotations

import ctypes
import gc
import os
from pathlib import Path

SCHEDULER_PRIORITY = 20

PROCESSOR_LATENCY = Path("/dev/cpu_dma_latency")
"""File that limits the wake-up time of the processors [us, int32] while a process holds it open."""

_MCL_CURRENT, _MCL_FUTURE, _MCL_ONFAULT = 1, 2, 4
_PR_SET_TIMERSLACK = 29


def disable_garbage_collection() -> None:
    """Disable this process's garbage collector: a full collection takes up to 90 ms."""
    gc.collect()
    gc.freeze()
    gc.disable()


def request_realtime() -> tuple[str, ...]:
    """Request locked memory, exact timers, real-time scheduling and no deep CPU idle states.

    Returns:
        One sentence for each refused request; the timing is then best effort.
    """
    refused = []
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE | _MCL_ONFAULT) != 0:
        refused.append(
            "memory is not locked (mlockall: "
            f"{os.strerror(ctypes.get_errno())}); raise the limit memlock for this user"
        )
    if libc.prctl(_PR_SET_TIMERSLACK, 1, 0, 0, 0) != 0:
        refused.append("timers are not exact (prctl PR_SET_TIMERSLACK refused)")
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(SCHEDULER_PRIORITY))
    except OSError as error:
        refused.append(
            f"no real-time scheduling (SCHED_FIFO: {error.strerror}); raise the limit rtprio for"
            " this user"
        )
    if (idle := keep_processors_awake(PROCESSOR_LATENCY)) is not None:
        refused.append(idle)
    return tuple(refused)


def keep_processors_awake(latency: Path) -> str | None:
    """Disable deep CPU idle states until this process ends: leaving such a state takes time.

    Source: Linux kernel, Documentation/power/pm_qos_interface.rst.

    Args:
        latency: File for the request, `PROCESSOR_LATENCY`. It stays open, because closing the file
            ends the request.

    Returns:
        A sentence if the request was refused; None on success or if the kernel has no such file.
    """
    try:
        os.write(os.open(latency, os.O_WRONLY | os.O_CLOEXEC), bytes(4))
    except FileNotFoundError:
        return None
    except OSError as error:
        return (
            f"processors may enter deep idle states between cycles ({latency}: {error.strerror});"
            " give this user write access to the file"
        )
    return None
