"""A bare cyclic loop in C, the limit of what a loop in Python is held to."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from pathlib import Path

BARE_LOOP = """
#define _GNU_SOURCE
#include <sched.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>
int main(int n, char **a) {
    long period = atol(a[1]), cycles = atol(a[2]), next = atol(a[3]), *late;
    struct sched_param p = {.sched_priority = atoi(a[4])};
    struct timespec t;
    late = calloc(cycles, sizeof *late);
    mlockall(MCL_CURRENT | MCL_FUTURE);
    sched_setscheduler(0, SCHED_FIFO, &p);
    for (long i = 0; i < cycles; i++, next += period) {
        t.tv_sec = next / 1000000000; t.tv_nsec = next % 1000000000;
        clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, 0);
        clock_gettime(CLOCK_MONOTONIC, &t);
        late[i] = t.tv_sec * 1000000000 + t.tv_nsec - next;
        if (late[i] > period) next += late[i] / period * period;
    }
    for (long i = 0; i < cycles; i++) printf("%ld\\n", late[i]);
    return 0;
}
"""


def compiled() -> Path | None:
    """Return the bare loop, compiled; None where there is no C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        return None
    folder = Path(tempfile.mkdtemp(prefix="bare-loop-"))
    source = folder / "loop.c"
    source.write_text(BARE_LOOP)
    subprocess.run([compiler, "-O2", "-o", str(folder / "loop"), str(source)], check=True)
    return folder / "loop"
