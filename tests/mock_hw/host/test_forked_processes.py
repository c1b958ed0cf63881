"""Forked processes of the tests behave as the new Python processes of the program."""

from __future__ import annotations

import multiprocessing
import os
import sys
from multiprocessing.connection import Connection
from pathlib import Path

import pytest

from config.process.own_process import new_process
from config.process.termination import signals_blocked


def send_state(pipe: Connection) -> None:
    """Send state of this process (Pinocchio loaded, a variable, folder, parent), then fail."""
    pipe.send(("pinocchio" in sys.modules, os.environ["RID_STATE"], os.getcwd(), os.getppid()))
    raise ValueError("x")


def test_a_fork_has_modules_and_kernels_and_the_state_of_a_new_process(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("RID_STATE", "now")
    monkeypatch.chdir(tmp_path)
    ours, theirs = multiprocessing.Pipe()
    process = new_process(send_state, (theirs,), daemon=True)
    with signals_blocked(suspension=True):
        process.start()
    theirs.close()
    with ours:
        assert ours.recv() == (True, "now", str(tmp_path), os.getpid())
    process.join()
    assert process.exitcode == 1
    assert "ValueError:" in capfd.readouterr().err
    process.close()
