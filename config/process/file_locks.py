"""Lock files: each is held by at most one process of this computer; queries do not touch the lock.

The lock is an flock: it belongs to an open file, and the kernel releases it with the process. The
holder is read from the kernel's list of locks, so a query never tries to take the lock.
"""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from config.errors import RecordingError

LOCKS = Path("/proc/locks")
_OPEN = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
_TRIES = 100
_LOOKS = 3  # attempts: locks may move between the pages of the list while it is read


@contextlib.contextmanager
def held_file(path: Path) -> Iterator[None]:
    """Hold a lock file exclusively during the `with` block; remove it at the end.

    Another user's lock file can be held too; it is not removed. Processes that are started
    meanwhile do not inherit the lock.

    Args:
        path: The file; created if missing, readable by every user.

    Raises:
        BlockingIOError: Another process, or another `with` block of this process, holds the lock.
        OSError: The file cannot be opened: no permission, or a symbolic link.
    """
    descriptor = _lock(path)
    try:
        yield
    finally:
        # the file can belong to another user, because the folder is shared
        with contextlib.suppress(OSError):
            if _is_same_file(path, descriptor):
                path.unlink()
        os.close(descriptor)


def file_holder(path: Path) -> int | None:
    """Return the process that holds a lock file, as `lock_holder`; None if the file is missing."""
    try:
        descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        return lock_holder(descriptor)
    finally:
        os.close(descriptor)


def lock_holder(descriptor: int) -> int | None:
    """Return the process that holds an exclusive flock on an open file; None if none is listed.

    The lock is not touched, so a process that takes it at the same time does not fail.

    Args:
        descriptor: The file, opened in any mode; O_PATH needs no permission and never blocks.

    Returns:
        The process id. The kernel names the process that took the lock, and lists it only if that
        process is visible here: not a process in another container.

    Raises:
        RecordingError: The kernel's list cannot be read.

    Note:
        proc(5): ``1: FLOCK ADVISORY WRITE 4711 fe:00:2146400 0 EOF``; an arrow marks a process that
        waits for the lock.
    """
    try:
        inode = _inode(descriptor)
        for _ in range(_LOOKS):
            for line in LOCKS.read_text(encoding="utf-8").splitlines():
                words = line.split()
                if words[1:4] == ["FLOCK", "ADVISORY", "WRITE"] and words[5] == inode:
                    return int(words[4])
    except OSError as error:
        raise RecordingError(
            f"{error.filename}: cannot be read ({error.strerror}), so the holder of a lock is"
            " unknown; mount /proc",
            code="RID-FILE-ACCESS",
        ) from None
    return None


def _lock(path: Path) -> int:
    """Return a descriptor that holds the lock, on the file to which the path points."""
    for _ in range(_TRIES):
        try:
            descriptor = _open(path)
        except (FileExistsError, FileNotFoundError):
            if not path.parent.is_dir():
                raise
            continue  # another process has just created or removed it
        try:
            import fcntl

            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _is_same_file(path, descriptor):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)  # its holder has removed it in the meantime
    raise OSError(errno.ESTALE, "is replaced repeatedly", str(path))


def _open(path: Path) -> int:
    # First without O_CREAT: in a shared folder a kernel may refuse O_CREAT on another user's file.
    with contextlib.suppress(FileNotFoundError):
        return os.open(path, _OPEN)
    descriptor = os.open(path, _OPEN | os.O_CREAT | os.O_EXCL, 0o644)
    os.fchmod(descriptor, 0o644)  # set the mode independently of the umask
    return descriptor


def _is_same_file(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(path.lstat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _inode(descriptor: int) -> str:
    """Return a file's name in /proc/locks: the device of its file system, and its inode.

    The device comes from mountinfo, because that of `stat` differs on btrfs and overlayfs.
    """
    info = Path(f"/proc/self/fdinfo/{descriptor}").read_text(encoding="utf-8")
    info_lines = dict(line.split(":\t", 1) for line in info.splitlines() if ":\t" in line)
    status = os.fstat(descriptor)
    device = f"{os.major(status.st_dev)}:{os.minor(status.st_dev)}"
    for line in Path("/proc/self/mountinfo").read_text(errors="replace").splitlines():
        mount, _, of_mount, _ = line.split(maxsplit=3)
        if mount == info_lines.get("mnt_id"):
            device = of_mount
    major, minor = map(int, device.split(":"))
    return f"{major:02x}:{minor:02x}:{info_lines.get('ino', status.st_ino)}"
