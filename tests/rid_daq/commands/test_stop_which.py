"""`rid-daq stop` without a name: a single session is stopped; the user selects one of several."""

from __future__ import annotations

import os
import pty
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

HOLDER = """
import contextlib, signal, sys
from pathlib import Path
from config.process.file_locks import held_file
from rid_daq.app import _end_once
from rid_daq.session.running_sessions import registered_session
signal.signal(signal.SIGTERM, _end_once)
path = Path(sys.argv[1])
with held_file(path), registered_session(path, path.stem.removeprefix("rid-daq-")):
    print("held", flush=True)
    signal.pause()
"""
PATIENCE_S = 120.0
Held = Callable[[str], "subprocess.Popen[str]"]


@pytest.fixture
def start_session(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Held]:
    """Return a function that starts a session on a cell; only these sessions are visible."""
    monkeypatch.setenv("RID_DAQ_LOCKS", str(tmp_path))
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    with ExitStack() as stack:

        def begin(cell: str) -> subprocess.Popen[str]:
            words = [sys.executable, "-c", HOLDER, str(tmp_path / f"rid-daq-{cell}.lock")]
            holder = stack.enter_context(subprocess.Popen(words, stdout=subprocess.PIPE, text=True))
            stack.callback(holder.kill)
            assert holder.stdout is not None
            assert holder.stdout.readline() == "held\n"
            return holder

        yield begin


def run_stop(*words: str) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "rid_daq", "stop", *words]
    nobody = subprocess.DEVNULL
    return subprocess.run(
        command, stdin=nobody, capture_output=True, text=True, timeout=PATIENCE_S, check=False
    )


def stop_in_terminal(key: bytes) -> tuple[int, str]:
    """Press a key when `stop` asks for it; return the exit code and the terminal's text."""
    ours, its = pty.openpty()
    command = [sys.executable, "-m", "rid_daq", "stop"]
    process = subprocess.Popen(command, stdin=its, stdout=its, stderr=its)
    os.close(its)
    shown = b""
    try:
        while b"all sessions" not in shown:
            shown += os.read(ours, 4096)
        os.write(ours, key)
        while True:
            shown += os.read(ours, 4096)
    except OSError:  # the program has closed the terminal
        pass
    finally:
        os.close(ours)
    return process.wait(PATIENCE_S), shown.decode()


@pytest.mark.promise("stop-one-session")
def test_a_single_session_is_stopped_at_once(start_session: Held) -> None:
    only = start_session("left")
    assert run_stop().returncode == 0
    assert only.wait(PATIENCE_S) == 143


@pytest.mark.promise("stop-one-session")
def test_without_a_terminal_no_session_of_several_is_stopped(start_session: Held) -> None:
    left, right = start_session("left"), start_session("right")
    output = run_stop()
    assert output.returncode == 2
    assert "RID-STOP-WHICH" in output.stderr
    assert (left.poll(), right.poll()) == (None, None)
    assert run_stop("left").returncode == 0
    assert left.wait(PATIENCE_S) == 143
    assert right.poll() is None


@pytest.mark.promise("stop-one-session")
def test_all_sessions_are_stopped_with_all(start_session: Held) -> None:
    both = start_session("left"), start_session("right")
    refused = run_stop("left", "--all")
    assert refused.returncode == 2
    assert "RID-OPTION-EXCLUSIVE" in refused.stderr
    assert run_stop("--all").returncode == 0
    assert [each.wait(PATIENCE_S) for each in both] == [143, 143]


@pytest.mark.promise("stop-one-session")
def test_a_user_selects_a_session_by_one_digit(start_session: Held) -> None:
    left, right = start_session("left"), start_session("right")
    code, shown = stop_in_terminal(b"x")
    assert code == 2
    assert (left.poll(), right.poll()) == (None, None)
    code, shown = stop_in_terminal(b"2")
    assert code == 0, shown
    assert right.wait(PATIENCE_S) == 143
    assert left.poll() is None
    right = start_session("right")
    assert stop_in_terminal(b"0")[0] == 0
    assert [left.wait(PATIENCE_S), right.wait(PATIENCE_S)] == [143, 143]
