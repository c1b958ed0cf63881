"""A session can acquire its locks although another program reads the locks at any time.

A recording is detected while it is written.
"""

from __future__ import annotations

import fcntl
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from acquisition.journal.mcap_writer import JournalFile, is_being_written
from config.cell.cell import CanBusConfig, CellConfig
from config.errors import RecordingError
from config.load import load_cell
from mock_hw.bus.served_bus import hold_served_bus, is_bus_served
from rid_daq.session.running_sessions import running_sessions
from rid_daq.session.session import hold_cell
from tests.builders.raised_codes import raises_code


@pytest.fixture
def locks(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("RID_DAQ_LOCKS", str(tmp_path))
    return tmp_path


@pytest.fixture
def cell() -> CellConfig:
    cell = load_cell("ir361").config
    bus = cell.can.model_copy(update={"interface": "socketcan", "channel": "can0"})
    return cell.model_copy(update={"can": bus})


@pytest.mark.fault(50)
def test_reading_locks_never_prevents_a_session_from_starting(
    locks: Path,
    cell: CellConfig,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    measured: Callable[[str], None],
) -> None:
    with hold_cell(cell):
        names = [path.name for path in locks.iterdir()]
    for name in names:  # as left by a killed session
        (locks / name).touch()
    bus = CanBusConfig(interface="udp_multicast", channel="239.74.163.2")
    journal = tmp_path / "recording.mcap"
    journal.touch()
    starts: list[str] = []

    def start_a_session() -> None:
        with hold_cell(cell):
            starts.append("session")
        for name in names:
            (locks / name).touch()

    def serve_a_bus() -> None:
        with hold_served_bus(bus):
            starts.append("bus")

    def record() -> None:
        with journal.open("rb") as file:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            starts.append("journal")

    for look, start in (
        (running_sessions, start_a_session),
        (lambda: is_bus_served(bus), serve_a_bus),
        (lambda: is_being_written(journal), record),
    ):
        with monkeypatch.context() as patch:
            call_at_every_step(patch, start)
            assert not look()
    assert set(starts) == {"session", "bus", "journal"}
    measured(
        f"{len(starts)} sessions start while the locks are inspected, one at each step: none fails"
    )


def call_at_every_step(patch: pytest.MonkeyPatch, start: Callable[[], None]) -> None:
    """Call `start` before and after each open, fstat and pread of `os`, and before each close."""
    busy = False

    def at_this_moment(call: Callable[..., Any]) -> Callable[..., Any]:
        def called(*words: Any, **named: Any) -> Any:
            nonlocal busy
            if busy:
                return call(*words, **named)
            busy = True
            try:
                start()
                result = call(*words, **named)
                if call is not os.close:
                    start()
                return result
            finally:
                busy = False

        return called

    for name in ("open", "close", "fstat", "pread"):
        patch.setattr(os, name, at_this_moment(getattr(os, name)))


def test_a_recording_is_detected_while_it_is_written(tmp_path: Path) -> None:
    with JournalFile(tmp_path / "recording.mcap", {}):
        assert is_being_written(tmp_path / "recording.mcap")
    assert not is_being_written(tmp_path / "recording.mcap")
    with raises_code(RecordingError, "RID-FILE-READ"):
        is_being_written(tmp_path / "missing.mcap")
