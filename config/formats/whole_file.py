"""Atomic writing of files: completely or not at all."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
from collections.abc import Iterable, Iterator
from pathlib import Path

from config.errors import ConfigError, RecordingError, system_errors


def write_whole(path: Path, data: bytes | Iterable[bytes]) -> tuple[str, int]:
    """Write a file atomically: a reader finds the old or the new bytes, even after a power failure.

    The bytes are written to a `.tmp` file in the same folder, flushed to disk, read back and
    compared; then the file is renamed. If the path is a link, its target is replaced.

    Args:
        path: The file.
        data: Its bytes, or pieces of them.

    Returns:
        SHA-256 and number of the bytes.

    Raises:
        RecordingError: The file cannot be written, or reads back differently. The old file is
            unchanged, unless only the last step failed, the flush of the folder.
    """
    return _write(path, (data,) if isinstance(data, bytes) else data, replace=True)


def write_new(path: Path, data: bytes) -> None:
    """Write a file as `write_whole`, but never replace a file that already exists.

    Raises:
        ConfigError: The file exists (`RID-FILE-EXISTS`); it is unchanged.
        RecordingError: The file cannot be written.
    """
    try:
        _write(path, (data,), replace=False)
    except FileExistsError:
        raise ConfigError(
            f"{path.name}: already exists; choose another name", code="RID-FILE-EXISTS"
        ) from None


def _write(path: Path, pieces: Iterable[bytes], *, replace: bool) -> tuple[str, int]:
    written, size = hashlib.sha256(), 0
    with _write_errors(path):
        target = path.resolve() if path.is_symlink() else path
        if not target.name or (target.exists() and not target.is_file()):
            raise RecordingError(
                f"{path}: cannot be written, because it is not a file; choose another name",
                code="RID-FILE-WRITE",
            )
        temporary = target.with_name(f"{target.name}.{os.getpid()}.tmp")
        try:
            temporary.unlink(missing_ok=True)
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
            with open(os.open(temporary, flags, 0o644), "wb") as file:
                for piece in pieces:
                    size += file.write(piece)
                    written.update(piece)
                file.flush()
                os.fsync(file.fileno())
            with temporary.open("rb") as stored:
                read_back = hashlib.file_digest(stored, "sha256")
            if read_back.digest() != written.digest():
                raise OSError(errno.EIO, "the file reads back differently; check the disk")
            if replace:
                temporary.replace(target)
            else:
                os.link(temporary, target, follow_symlinks=False)
                temporary.unlink()
        except BaseException:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise
        folder = os.open(target.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    return written.hexdigest(), size


@contextlib.contextmanager
def _write_errors(path: Path) -> Iterator[None]:
    try:
        with system_errors(RecordingError, f"{path}: cannot be written", code="RID-FILE-WRITE"):
            yield
    except RecordingError as error:
        if isinstance(error.__cause__, FileExistsError):
            raise error.__cause__ from None
        raise
