"""File locks: each has one holder, which the kernel reports.

Checking a lock has no side effects.
"""

from __future__ import annotations

import errno
import fcntl
import os
import subprocess
import sys
from pathlib import Path

import pytest

from config.errors import RecordingError
from config.process import file_locks
from config.process.file_locks import file_holder, held_file
from tests.builders.raised_codes import raises_code

HOLDER = """
import sys
from pathlib import Path
from config.process.file_locks import held_file
with held_file(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_a_second_lock_is_refused_with_the_holder_and_released_with_the_file(
    tmp_path: Path,
) -> None:
    path = tmp_path / "lock"
    with subprocess.Popen(
        [sys.executable, "-c", HOLDER, str(path)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == "held\n"
        assert file_holder(path) == other.pid
        with pytest.raises(BlockingIOError), held_file(path):
            pass
        other.communicate("")
    assert file_holder(path) is None
    assert not path.exists()
    with held_file(path):
        assert file_holder(path) == os.getpid()


def test_processes_started_meanwhile_do_not_inherit_the_lock(tmp_path: Path) -> None:
    path = tmp_path / "lock"
    with held_file(path):
        child = subprocess.Popen(
            [sys.executable, "-c", "input()"], stdin=subprocess.PIPE, close_fds=False
        )
    with child, held_file(path):
        assert file_holder(path) == os.getpid(), "the running child process holds the lock"
        child.communicate(b"\n")


def test_a_file_removed_by_its_holder_at_the_last_moment_is_not_locked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path, real = tmp_path / "lock", fcntl.flock

    def removed_first(descriptor: int, mode: int) -> None:
        monkeypatch.setattr(fcntl, "flock", real)
        path.unlink()
        real(descriptor, mode)

    monkeypatch.setattr(fcntl, "flock", removed_first)
    with held_file(path):
        assert file_holder(path) == os.getpid(), "the locked file is not the file at the path"


def test_other_users_can_lock_the_file_with_any_umask(tmp_path: Path) -> None:
    before = os.umask(0o077)
    try:
        with held_file(tmp_path / "lock"):
            assert (tmp_path / "lock").stat().st_mode & 0o777 == 0o644
    finally:
        os.umask(before)


def test_a_symbolic_link_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "lock").symlink_to(tmp_path / "victim")
    with pytest.raises(OSError) as caught, held_file(tmp_path / "lock"):  # noqa: PT011
        pass
    assert caught.value.errno == errno.ELOOP
    assert not (tmp_path / "victim").exists()


@pytest.mark.parametrize("kind", ["fifo", "folder", "link", "nothing", "closed"])
def test_a_check_of_any_path_neither_waits_nor_fails(tmp_path: Path, kind: str) -> None:
    path = tmp_path / "lock"
    if kind == "fifo":
        os.mkfifo(path)
    elif kind == "folder":
        path.mkdir()
    elif kind == "link":
        path.symlink_to("nowhere")
    elif kind == "closed":
        path.touch(mode=0)
    assert file_holder(path) is None


def test_the_kernels_identity_of_the_file_is_compared(tmp_path: Path) -> None:
    with (tmp_path / "lock").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        info = Path(f"/proc/self/fdinfo/{file.fileno()}").read_text()
        assert f" {os.getpid()} {file_locks._inode(file.fileno())} 0 EOF" in info
        fcntl.flock(file, fcntl.LOCK_SH)
        assert file_holder(tmp_path / "lock") is None, "a shared lock was reported as a holder"


def test_a_lock_that_moved_during_the_reading_of_a_long_list_is_found(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    class Pages:
        """A list of locks that is empty at the first read."""

        read = 0

        def read_text(self, encoding: str) -> str:
            self.read += 1
            return "" if self.read == 1 else Path("/proc/locks").read_text(encoding)

    monkeypatch.setattr(file_locks, "LOCKS", Pages())
    with held_file(tmp_path / "lock"):
        assert file_holder(tmp_path / "lock") == os.getpid()


def test_an_unreadable_list_of_locks_is_an_error(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(file_locks, "LOCKS", tmp_path / "missing")
    (tmp_path / "lock").touch()
    with raises_code(RecordingError, "RID-FILE-ACCESS", "/proc"):
        file_holder(tmp_path / "lock")
