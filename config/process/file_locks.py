"""Lock files: held by one process of this computer, and looked at without being touched.

The lock is flock's: it belongs to an open file, and the kernel ends it with the process. Who holds
one stands in the kernel's own list, so nobody needs to try the lock in order to look.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
from collections.abc import Iterator
from pathlib import Path

from config.errors import RecordingError

LOCKS = Path("/proc/locks")
_OPEN = os.O_RDONLY | os.O_CLOEXEC | os.O_NOFOLLOW | os.O_NONBLOCK
_TRIES = 100
_LOOKS = 3  # the list is read a page at a time, between which locks move up


@contextlib.contextmanager
def held_file(path: Path) -> Iterator[None]:
    """Hold a lock file alone for as long as the `with` lasts; it is removed at the end.

    Another user's file is held as well as an own one; it stays. Processes that are started
    meanwhile do not inherit the lock.

    Args:
        path: The file; made where there is none, readable by every user.

    Raises:
        BlockingIOError: Another process, or another `with` of this one, holds it.
        OSError: The file cannot be opened: it is closed to this user, or a symbolic link.
    """
    descriptor = _locked(path)
    try:
        yield
    finally:
        with contextlib.suppress(OSError):  # another user's, in a folder for all
            if _leads_to(path, descriptor):
                path.unlink()
        os.close(descriptor)


def file_holder(path: Path) -> int | None:
    """Return the process that holds a lock file, as `lock_holder`; None where there is no file."""
    try:
        descriptor = os.open(path, os.O_PATH | os.O_CLOEXEC | os.O_NOFOLLOW)
    except OSError:
        return None
    try:
        return lock_holder(descriptor)
    finally:
        os.close(descriptor)


def lock_holder(descriptor: int) -> int | None:
    """Return the process that holds an exclusive flock on an open file, None where none does.

    The lock is not touched, so nobody who takes it at this moment fails.

    Args:
        descriptor: Of the file, opened in any way; with O_PATH that needs no permission and never
            blocks.

    Returns:
        The process id. The kernel names the process that took the lock and lists it only where that
        process is visible here: not one in another container.

    Raises:
        RecordingError: The kernel's list cannot be read.

    Note:
        proc(5): ``1: FLOCK ADVISORY WRITE 4711 fe:00:2146400 0 EOF``; one that waits has an arrow.
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
            f"{error.filename}: cannot be read ({error.strerror}), so nobody can say who holds a"
            " lock; is /proc mounted?",
            code="RID-FILE-ACCESS",
        ) from None
    return None


def _locked(path: Path) -> int:
    """Return a descriptor that holds the lock, on the file that the path leads to."""
    for _ in range(_TRIES):
        try:
            descriptor = _opened(path)
        except (FileExistsError, FileNotFoundError):
            if not path.parent.is_dir():
                raise
            continue  # made or removed by another at this moment
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            if _leads_to(path, descriptor):
                return descriptor
        except BaseException:
            os.close(descriptor)
            raise
        os.close(descriptor)  # its holder has removed it meanwhile
    raise OSError(errno.ESTALE, "is replaced again and again", str(path))


def _opened(path: Path) -> int:
    # Without O_CREAT first: in a folder for all, a kernel may refuse that on another user's file.
    with contextlib.suppress(FileNotFoundError):
        return os.open(path, _OPEN)
    descriptor = os.open(path, _OPEN | os.O_CREAT | os.O_EXCL, 0o644)
    os.fchmod(descriptor, 0o644)  # whatever the umask
    return descriptor


def _leads_to(path: Path, descriptor: int) -> bool:
    try:
        return os.path.samestat(path.lstat(), os.fstat(descriptor))
    except FileNotFoundError:
        return False


def _inode(descriptor: int) -> str:
    """Return a file as /proc/locks names it: by its file system's device, not by stat's.

    The two differ on btrfs and overlayfs; the mount that the file was opened on has the former.
    """
    info = Path(f"/proc/self/fdinfo/{descriptor}").read_text(encoding="utf-8")
    told = dict(line.split(":\t", 1) for line in info.splitlines() if ":\t" in line)
    status = os.fstat(descriptor)
    device = f"{os.major(status.st_dev)}:{os.minor(status.st_dev)}"
    for line in Path("/proc/self/mountinfo").read_text(errors="replace").splitlines():
        mount, _, of_mount, _ = line.split(maxsplit=3)
        if mount == told.get("mnt_id"):
            device = of_mount
    major, minor = map(int, device.split(":"))
    return f"{major:02x}:{minor:02x}:{told.get('ino', status.st_ino)}"
