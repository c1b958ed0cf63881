"""Runs the two workflows of the demo in parallel, each in its own process."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Iterator
from functools import partial
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from typing import Any, NoReturn

from acquisition.runs.folder import RunFolder
from config import errors
from config.errors import DriverError, RidDaqError
from config.process.shortage import named_error
from config.process.termination import TERMINATION, signals_blocked
from rid_daq.demo.demo_story import Motions, Story, run_story
from rid_daq.terminal.context import Context
from rid_daq.terminal.exit_codes import ExitCode

_END_PATIENCE_S = 30.0
# One thread per process: two processes use two cores, and floating-point sums are reproducible.
_ONE_THREAD: dict[str, str] = {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}


def run_stories(
    folder: RunFolder, motions: Motions, total_s: float, seed: int, console: Context
) -> dict[bool, Story]:
    """Run the workflow with and without unmodelled effects.

    Args:
        folder: Run folder of the demo.
        motions: Motions of the demo.
        total_s: Duration of all motions of the robot with unmodelled effects [s]; the other robot
            executes fewer.
        seed: Random seed of both simulations.
        console: Shows the progress.

    Returns:
        Results of `rid_daq.demo.demo_story.run_story`; the key is True for the robot with
        unmodelled effects.

    Raises:
        RidDaqError: A step failed.
    """
    spawn = get_context("spawn")
    stories: dict[bool, Story] = {}
    with contextlib.ExitStack() as stack:
        lines: dict[Connection, bool] = {}
        for unmodelled in (True, False):
            ours, theirs = spawn.Pipe(duplex=False)
            process = spawn.Process(
                target=_serve, args=(folder, motions, seed, unmodelled, theirs), name="rid-daq demo"
            )
            lines[stack.enter_context(ours)] = unmodelled
            with _environment(_ONE_THREAD), signals_blocked():
                process.start()
                stack.push(partial(_end, process))
            theirs.close()
        done_s = dict.fromkeys(lines.values(), 0.0)
        with console.progress("recording", total_s, "s of motion of both robots") as display:
            while lines:
                for line in wait(list(lines)):
                    unmodelled = lines[line]  # type: ignore[index]
                    message = _receive(line)  # type: ignore[arg-type]
                    if isinstance(message, Story):
                        stories[unmodelled] = message
                        done_s[unmodelled] = total_s
                        del lines[line]  # type: ignore[arg-type]
                    else:
                        done_s[unmodelled], doing = message
                        display.update(min(done_s.values()), doing)
    return stories


def _receive(line: Connection) -> Any:
    """Return the next message of a workflow: its progress or its result.

    Raises:
        RidDaqError: The error that ended the workflow.
    """
    try:
        message = line.recv()
    except EOFError:
        raise DriverError(
            "a process of the demo ended unexpectedly; start the demo again",
            code="RID-SYSTEM-PROCESS-DIED",
        ) from None
    if isinstance(message, RidDaqError):
        raise message
    return message


def _serve(
    folder: RunFolder, motions: Motions, seed: int, unmodelled: bool, line: Connection
) -> None:
    """Run one workflow and send its messages; the main function of its process."""
    # Ctrl-C reaches the whole process group; the main program ends this process by SIGTERM.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGHUP, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, _leave)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, TERMINATION)

    def show(done_s: float, doing: str) -> None:
        line.send((done_s, doing))

    # If the main program is gone, the robot has already been stopped.
    with contextlib.suppress(BrokenPipeError):
        try:
            line.send(run_story(folder, motions, seed, unmodelled, show))
        except Exception as caught:
            error = named_error(caught)
            kind = getattr(errors, type(error).__name__, DriverError)
            line.send(kind(str(error), code=error.refusal))


def _leave(_signal: int, _frame: object) -> NoReturn:
    raise SystemExit(ExitCode.TERMINATED)


def _end(process: SpawnProcess, failed: object, *_: object) -> None:
    """End the process of a workflow; a process that still runs stops its robot first."""
    if failed is not None and process.is_alive():
        process.terminate()
    process.join(_END_PATIENCE_S)
    if process.is_alive():
        process.kill()
        process.join()
    process.close()


@contextlib.contextmanager
def _environment(values: dict[str, str]) -> Iterator[None]:
    """Set environment variables for processes that are started inside the `with` block."""
    before = {name: os.environ.get(name) for name in values}
    os.environ.update(values)
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
