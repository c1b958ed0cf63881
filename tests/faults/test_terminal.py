"""Ctrl-Z, a closed terminal and signals while a program in a terminal moves a robot."""

from __future__ import annotations

import contextlib
import json
import os
import pty
import signal
import subprocess
import sys
import tempfile
import termios
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from acquisition.journal.cycles import read_journal
from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.runs.folder import RunFolder
from config.load import to_yaml

pytestmark = pytest.mark.slow

PATIENCE_S = 120.0
SUSPEND = b"\x1a"
LEADER = """
import fcntl, os, signal, subprocess, sys, termios
fcntl.ioctl(0, termios.TIOCSCTTY, 0)
program = subprocess.Popen(sys.argv[1:], process_group=0)
signal.signal(signal.SIGHUP, lambda *_: os.killpg(program.pid, signal.SIGHUP))  # as shells do
signal.signal(signal.SIGTTOU, signal.SIG_IGN)
os.tcsetpgrp(0, program.pid)
print("program", program.pid, flush=True)
while True:
    _, status = os.waitpid(program.pid, os.WUNTRACED)
    if not os.WIFSTOPPED(status):
        break
    print("suspended", flush=True)
print("ended", os.waitstatus_to_exitcode(status), flush=True)
"""
"""Program of a session leader that runs another program in the foreground, like a shell."""


class Shell:
    """A terminal with `rid-daq` in the foreground.

    Attributes:
        terminal: The master side of the terminal, for input and output.
        program: Process id of the program, which is also the id of its process group.
    """

    def __init__(self, words: list[str], environment: dict[str, str]) -> None:
        self.terminal, inside = pty.openpty()
        modes = termios.tcgetattr(inside)
        modes[3] |= termios.TOSTOP  # a background process that writes is suspended
        termios.tcsetattr(inside, termios.TCSANOW, modes)
        self._leader = subprocess.Popen(
            [sys.executable, "-c", LEADER, sys.executable, "-m", "rid_daq", *words],
            stdin=inside, stdout=subprocess.PIPE, stderr=inside, text=True,
            start_new_session=True, env={**os.environ, **environment},
        )  # fmt: skip
        os.close(inside)
        self.program = int(self.wait_for_line("program").split()[1])

    def wait_for_line(self, beginning: str) -> str:
        """Wait for a line from the program or from the shell that begins with a text; return it."""
        assert self._leader.stdout is not None
        output = []
        while line := self._leader.stdout.readline():
            output.append(line)
            if line.startswith(beginning):
                return line
        raise AssertionError(f"the output ended without {beginning!r}: {''.join(output)}")

    def wait_for_text(self, text: bytes) -> None:
        """Wait until a text appears on the terminal."""
        shown = b""
        while text not in shown:
            shown += os.read(self.terminal, 4096)

    def processes(self) -> list[int]:
        """Return the ids of the running processes of the session, except that of the shell."""
        found = []
        for pid in filter(str.isdigit, os.listdir("/proc")):
            try:
                stat = Path("/proc", pid, "stat").read_text()
            except OSError:
                continue  # the process has ended meanwhile
            state, _, _, session = stat.rpartition(")")[2].split()[:4]
            if int(session) == self._leader.pid and state != "Z" and int(pid) != self._leader.pid:
                found.append(int(pid))
        return found

    def wait_for_all_ends(self) -> None:
        """Wait until no process of the session is left."""
        tick, until_s = threading.Event(), time.monotonic() + PATIENCE_S
        while left := self.processes():
            assert time.monotonic() < until_s, left
            tick.wait(0.02)

    def close_terminal(self) -> None:
        os.close(self.terminal)
        self.terminal = -1

    def close(self) -> None:
        for pid in [*self.processes(), self._leader.pid]:
            with contextlib.suppress(ProcessLookupError):  # the process has just ended
                os.kill(pid, signal.SIGKILL)
        self._leader.communicate()
        if self.terminal >= 0:
            self.close_terminal()


@pytest.fixture
def environment() -> Iterator[dict[str, str]]:
    """Environment with separate locks, so that no test stops other programs of this computer."""
    with tempfile.TemporaryDirectory(prefix="rid-") as folder:
        yield {"RID_DAQ_LOCKS": folder, "XDG_RUNTIME_DIR": folder}


@pytest.fixture
def shell(
    tmp_path: Path, motion_of: Callable[[str, int], FourierMotion], environment: dict[str, str]
) -> Iterator[Shell]:
    """A terminal in which `rid-daq record` records a long motion in lock-step."""
    path = tmp_path / "motion.yaml"
    path.write_text(to_yaml(motion_of("ir361", 200)))
    words = ["record", "ir361", str(path), "--live", "--listen", "127.0.0.1:0"]
    shell = Shell([*words, "--runs", str(tmp_path / "runs")], environment)
    try:
        shell.wait_for_line("recording:")
        yield shell
    finally:
        shell.close()


def stop(environment: dict[str, str]) -> str:
    """Run `rid-daq stop` in another process, and return its text about the session."""
    output = subprocess.run(
        [sys.executable, "-m", "rid_daq", "stop", "--json"],
        stdout=subprocess.PIPE, text=True, env={**os.environ, **environment}, check=False,
    ).stdout  # fmt: skip
    (session,) = json.loads(output)["sessions"]
    text: str = session["text"]
    assert session["stopped"], text
    return text


def assert_readable(runs: Path) -> None:
    (folder,) = runs.iterdir()
    assert read_journal(RunFolder.open(folder).file("recording.mcap")).damage.finished


@pytest.mark.fault(43)
def test_ctrl_z_does_not_suspend_a_motion_and_stop_works(
    shell: Shell, environment: dict[str, str], tmp_path: Path, measured: Callable[[str], None]
) -> None:
    os.write(shell.terminal, SUSPEND)
    shell.wait_for_text(b"Ctrl-Z cannot suspend a motion")
    text = stop(environment)
    assert "all axes at rest" in text
    assert shell.wait_for_line("ended") == "ended 5\n"
    shell.wait_for_all_ends()
    assert_readable(tmp_path / "runs")
    measured(
        f"Ctrl-Z: the motion continues under supervision; `rid-daq stop`: {text.partition(',')[0]}"
    )


@pytest.mark.fault(43)
def test_a_program_suspended_by_sigstop_can_be_stopped(
    shell: Shell, environment: dict[str, str], tmp_path: Path, measured: Callable[[str], None]
) -> None:
    os.killpg(shell.program, signal.SIGSTOP)  # `kill -STOP %1`
    shell.wait_for_line("suspended")
    text = stop(environment)
    assert "all axes at rest" in text
    os.killpg(shell.program, signal.SIGCONT)
    assert shell.wait_for_line("ended") == "ended 5\n"
    shell.wait_for_all_ends()
    assert_readable(tmp_path / "runs")
    measured(f"SIGSTOP to the program's process group: `rid-daq stop`: {text.partition(',')[0]}")


@pytest.mark.fault(43)
@pytest.mark.fault(19)
@pytest.mark.parametrize("how", ["Ctrl-C", "closed terminal", "kill -9 %1"])
def test_after_any_end_no_process_remains_and_the_recording_is_complete(
    shell: Shell, how: str, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    before = len(shell.processes())
    assert before >= 5, "expected: program, task, recorder, live page and simulated cell"
    if how == "Ctrl-C":
        os.write(shell.terminal, b"\x03")
    elif how == "closed terminal":
        shell.close_terminal()
    else:
        os.killpg(shell.program, signal.SIGKILL)
    code = int(shell.wait_for_line("ended").split()[1])
    assert code == {"Ctrl-C": 130, "closed terminal": 143, "kill -9 %1": -signal.SIGKILL}[how]
    shell.wait_for_all_ends()
    assert_readable(tmp_path / "runs")
    measured(f"{how}: {before} processes ended, the recording is closed")


@pytest.mark.fault(19)
@pytest.mark.fault(43)
def test_a_motion_under_nohup_ignores_sighup(
    tmp_path: Path,
    motion_of: Callable[[str, int], FourierMotion],
    environment: dict[str, str],
    measured: Callable[[str], None],
) -> None:
    path = tmp_path / "motion.yaml"
    path.write_text(to_yaml(motion_of("ir361", 10)))
    words = [sys.executable, "-m", "rid_daq", "record", "ir361", str(path)]
    with subprocess.Popen(
        ["nohup", *words, "--runs", str(tmp_path / "runs")],
        stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        env={**os.environ, **environment},
    ) as program:  # fmt: skip
        assert program.stdout is not None
        line = ""
        while not line.startswith("recording:"):
            line = program.stdout.readline()
            assert line, "the program ended before it moved"
        program.send_signal(signal.SIGHUP)
        output = program.stdout.read()
    assert program.returncode == 0, output
    assert_readable(tmp_path / "runs")
    measured("nohup: SIGHUP in motion changes nothing, exit 0")
