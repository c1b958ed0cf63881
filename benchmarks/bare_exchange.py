"""Cyclic exchange with drives in C over the simulated bus: a lower limit for that in Python."""

from __future__ import annotations

import shutil
import subprocess
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

BARE_EXCHANGE = """
#define _GNU_SOURCE
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <time.h>
#include <unistd.h>
struct frame { int64_t time_ns; uint32_t id; uint8_t length, port, pad[2]; uint8_t data[8]; };
struct packet { uint8_t kind, flag, pad[2]; uint32_t number; int64_t time_ns;
                struct frame frames[1024]; } __attribute__((packed));
enum { HELLO = 1, SEND = 3, OBSERVER = 3, HEADER = 16 };
static struct packet out, in;
static int hub;
static int64_t now(clockid_t clock) {
    struct timespec t;
    clock_gettime(clock, &t);
    return t.tv_sec * 1000000000LL + t.tv_nsec;
}
static void sleep_until(int64_t ns) {
    struct timespec t = {ns / 1000000000, ns % 1000000000};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &t, 0);
}
static void put(int count) {
    out.kind = SEND;
    if (send(hub, &out, HEADER + count * sizeof(struct frame), 0) < 0) exit(2);
}
static int answers(long size, int axes) {
    int count = 0;
    for (int k = 0; k < (size - HEADER) / (long)sizeof(struct frame); k++)
        count += in.frames[k].id > 0x180 && in.frames[k].id <= 0x180 + axes;
    return count;
}
static int waiting(int axes) {
    int count = 0;
    for (long size; (size = recv(hub, &in, sizeof in, MSG_DONTWAIT)) > 0;)
        count += answers(size, axes);
    return count;
}
int main(int n, char **a) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    strncpy(address.sun_path, a[1], sizeof address.sun_path - 1);
    int64_t period = atoll(a[2]), cycles = atoll(a[3]), start = atoll(a[4]);
    struct sched_param p = {.sched_priority = atoi(a[5])};
    int axes = atoi(a[6]), bytes = atoi(a[7]), beats = atoi(a[8]);
    int64_t burst = atoll(a[9]), reading = atoll(a[10]), expected = burst, next = start;
    int64_t *late = calloc(cycles, sizeof *late), *took = calloc(cycles, sizeof *took);
    long received = 0;
    hub = socket(AF_UNIX, SOCK_SEQPACKET, 0);
    if (connect(hub, (struct sockaddr *)&address, sizeof address)) return 2;
    out.kind = HELLO, out.flag = OBSERVER;
    send(hub, &out, HEADER, 0);
    recv(hub, &in, sizeof in, 0);
    out.flag = 0;
    mlockall(MCL_CURRENT | MCL_FUTURE);
    prctl(PR_SET_TIMERSLACK, 1, 0, 0, 0);
    sched_setscheduler(0, SCHED_FIFO, &p);
    int32_t allowed_us = 0, latency = open("/dev/cpu_dma_latency", O_WRONLY);
    if (latency >= 0 && write(latency, &allowed_us, sizeof allowed_us) < 0) return 3;
    int64_t cpu = 0;
    for (int64_t i = -1; i < cycles; i++) { /* one exchange first, as the others do */
        if (i >= 0) sleep_until(next);
        if (i == 0) cpu = now(CLOCK_PROCESS_CPUTIME_ID);
        int64_t woken = now(CLOCK_MONOTONIC), deadline = woken + period * 9 / 10, last = 0;
        if (i >= 0) late[i] = woken - next;
        received += waiting(axes); /* late ones */
        out.frames[0] = (struct frame){.id = 0x80};
        put(1);
        int64_t there = woken + expected + reading;
        sleep_until(there < deadline ? there : deadline);
        for (int missing = axes; missing > 0;) {
            long size = recv(hub, &in, sizeof in, MSG_DONTWAIT);
            if (size > 0) {
                int count = answers(size, axes);
                missing -= count, received += count;
                if (count) last = in.frames[0].time_ns - woken;
                continue;
            }
            int64_t left = deadline - now(CLOCK_MONOTONIC);
            struct timespec t = {0, left};
            struct pollfd f = {hub, POLLIN, 0};
            if (left <= 0 || ppoll(&f, 1, &t, 0) <= 0) { last = 0; break; }
        }
        if (last) {
            expected += (last - expected) / (last > expected ? 10 : 50);
            if (expected < burst) expected = burst;
            if (expected > burst * 3 / 2) expected = burst * 3 / 2;
        }
        int64_t done = now(CLOCK_MONOTONIC);
        for (int k = 0; k < axes; k++)
            out.frames[k] = (struct frame){.id = 0x201 + k, .length = bytes, .data = {0x0f}};
        int count = axes;
        if ((i + 1) % beats == 0)
            out.frames[count++] = (struct frame){.id = 0x77f, .length = 1, .data = {5}};
        put(count);
        if (i < 0) {
            received = 0;
            continue;
        }
        took[i] = done - woken;
        next += period * (1 + late[i] / period);
    }
    cpu = now(CLOCK_PROCESS_CPUTIME_ID) - cpu;
    usleep(50000);
    received += waiting(axes);
    printf("%lld %ld\\n", (long long)cpu, received);
    for (int64_t i = 0; i < cycles; i++)
        printf("%lld %lld\\n", (long long)late[i], (long long)took[i]);
    return 0;
}
"""


@contextmanager
def compile_exchange() -> Iterator[Path | None]:
    """Compile the exchange and yield the program; None without a C compiler."""
    compiler = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
    if compiler is None:
        yield None
        return
    with tempfile.TemporaryDirectory(prefix="bare-exchange-") as folder:
        source = Path(folder) / "exchange.c"
        source.write_text(BARE_EXCHANGE)
        program = source.with_suffix("")
        subprocess.run([compiler, "-O2", "-o", str(program), str(source)], check=True)
        yield program
