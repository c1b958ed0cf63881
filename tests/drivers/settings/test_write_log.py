"""Write log: with real drives, each line is on the disk before its write is sent."""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from drivers.settings.saved_drive import DriveIdentity
from drivers.settings.write_log import WriteLog, read_write_log

CYCLE = (0x60C2, 1)


@pytest.mark.parametrize("durable", [True, False])
def test_lines_and_file_name_are_synced_to_the_disk_for_real_drives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, durable: bool
) -> None:
    opened: list[tuple[Path, int]] = []
    synced: list[str] = []
    real_open, real_fsync = os.open, os.fsync

    def spy(path: Path, flags: int, mode: int = 0o777) -> int:
        opened.append((path, flags))
        return real_open(path, flags, mode)

    def note(descriptor: int) -> None:
        synced.append(os.readlink(f"/proc/self/fd/{descriptor}"))
        real_fsync(descriptor)

    monkeypatch.setattr(os, "open", spy)
    monkeypatch.setattr(os, "fsync", note)
    log = WriteLog(tmp_path / "drive_writes.jsonl", durable=durable)
    log.add_drive(3, DriveIdentity())
    log.add_change(3, CYCLE, b"\x02", b"\x08")
    lines = [bool(flags & os.O_DSYNC) for path, flags in opened if path == log.path]
    assert lines == [durable, durable]
    assert synced == ([str(tmp_path)] if durable else [])
    (drive,) = read_write_log(log.path)
    assert drive.values == {CYCLE: b"\x02"}
