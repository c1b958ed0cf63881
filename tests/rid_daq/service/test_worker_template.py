"""Workers are forked from a template, which reports their ends; they can outlive it."""

from __future__ import annotations

import asyncio
import errno
import os
import resource
import signal
from collections.abc import Callable, Coroutine, Iterator
from pathlib import Path
from typing import Any

import pytest

from rid_daq.service.workers.worker_process import EXIT_CODE_UNKNOWN, WorkerProcess
from rid_daq.service.workers.worker_template import WorkerTemplate
from tests.rid_daq.service.conftest import PATIENCE_S, has_handler

Scenario = Callable[[], Coroutine[Any, Any, None]]
Perform = Callable[[Scenario], None]


@pytest.fixture(scope="module")
def perform() -> Iterator[Perform]:
    """Return a function that runs a scenario; all tests of this file use one event loop."""
    with asyncio.Runner() as runner:
        yield lambda scenario: runner.run(asyncio.wait_for(scenario(), PATIENCE_S))


@pytest.fixture(scope="module")
def template(
    tmp_path_factory: pytest.TempPathFactory, perform: Perform
) -> Iterator[WorkerTemplate]:
    """Run one template for all tests."""
    template = WorkerTemplate(tmp_path_factory.mktemp("template") / "workers.log")
    perform(template.prepare)
    yield template
    perform(template.end)


def template_pid(template: WorkerTemplate) -> int:
    assert template._process is not None
    return template._process.pid


def open_files(pid: int) -> dict[int, str]:
    """Return the open files of a process by their descriptors."""
    folder = Path(f"/proc/{pid}/fd")
    return {int(each.name): os.readlink(each) for each in folder.iterdir()}


async def started(template: WorkerTemplate) -> WorkerProcess:
    """Return a worker that waits for its job."""
    worker = await template.start_worker()
    while not has_handler(worker.pid, signal.SIGTERM):
        await asyncio.sleep(0.001)
    return worker


async def end(worker: WorkerProcess) -> int | None:
    """Close a worker's input, which ends the worker, and return its exit code."""
    worker.stdin.close()
    await worker.wait()
    return worker.returncode


def test_a_worker_without_a_job_ends_with_its_orders(
    template: WorkerTemplate, perform: Perform
) -> None:
    async def scenario() -> None:
        worker = await started(template)
        assert worker.returncode is None
        assert await end(worker) == 0
        worker.terminate()  # nothing is sent: the process id may belong to another process

    perform(scenario)
    assert template._log.read_bytes() == b""


def test_a_killed_worker_is_reported_with_the_signal(
    template: WorkerTemplate, perform: Perform
) -> None:
    async def scenario() -> None:
        worker = await started(template)
        worker.kill()
        await worker.wait()
        assert worker.returncode == -signal.SIGKILL

    perform(scenario)


def test_a_worker_has_its_own_session_and_no_files_of_others(
    template: WorkerTemplate, perform: Perform
) -> None:
    async def scenario() -> None:
        first, second = await started(template), await started(template)
        assert os.getsid(second.pid) == second.pid != os.getsid(template_pid(template))
        files = open_files(second.pid)

        def inode(descriptor: int) -> int:
            return os.stat(f"/proc/{second.pid}/fd/{descriptor}").st_ino

        assert files.pop(1) == files.pop(2) == str(template._log)
        assert files.pop(0).startswith("socket:")
        assert set(map(inode, files)) == {os.fstat(second.beat.descriptor).st_ino}
        assert await end(first) == await end(second) == 0

    perform(scenario)


def test_a_start_that_is_cancelled_leaves_no_worker(
    template: WorkerTemplate, perform: Perform
) -> None:
    async def scenario() -> None:
        starting = asyncio.create_task(template.start_worker())
        while not template._starting:
            await asyncio.sleep(0)
        starting.cancel()
        worker = await started(template)
        pid = template_pid(template)
        children = Path(f"/proc/{pid}/task/{pid}/children")
        while children.read_text().split() != [str(worker.pid)]:
            await asyncio.sleep(0.001)
        assert await end(worker) == 0

    perform(scenario)


def test_a_worker_that_cannot_be_started_is_an_error(
    template: WorkerTemplate, perform: Perform
) -> None:
    async def scenario() -> None:
        pid = template_pid(template)
        before = resource.prlimit(pid, resource.RLIMIT_NOFILE)
        resource.prlimit(pid, resource.RLIMIT_NOFILE, (len(open_files(pid)) + 1, before[1]))
        (refused,) = await asyncio.gather(template.start_worker(), return_exceptions=True)
        assert isinstance(refused, OSError)
        assert refused.errno == errno.EMFILE
        resource.prlimit(pid, resource.RLIMIT_NOFILE, before)
        assert await end(await started(template)) == 0

    perform(scenario)


def test_workers_outlive_the_template_and_the_next_worker_has_a_new_one(
    template: WorkerTemplate, perform: Perform
) -> None:
    async def scenario() -> None:
        first, killed = await started(template), template_pid(template)
        os.kill(killed, signal.SIGKILL)
        while template._line is not None:
            await asyncio.sleep(0.001)
        second = await started(template)
        assert template_pid(template) != killed
        assert first.returncode is None
        assert await end(first) == EXIT_CODE_UNKNOWN
        assert await end(second) == 0

    perform(scenario)


def test_an_order_that_is_no_job_is_in_the_log(template: WorkerTemplate, perform: Perform) -> None:
    async def scenario() -> None:
        worker = await started(template)
        worker.stdin.write(b"{}\n")
        await worker.wait()
        assert worker.returncode == 1

    perform(scenario)
    assert template._log.stat().st_size > 0


def test_a_template_that_dies_before_it_forks_fails_the_job(
    template: WorkerTemplate, perform: Perform
) -> None:
    async def scenario() -> None:
        os.kill(template_pid(template), signal.SIGSTOP)
        starting = asyncio.create_task(template.start_worker())
        while not template._starting:
            await asyncio.sleep(0)
        os.kill(template_pid(template), signal.SIGKILL)
        with pytest.raises(ChildProcessError):
            await starting

    perform(scenario)
