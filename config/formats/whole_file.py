"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from pathlib import Path

from config.errors import ConfigError, RecordingError, system_errors


def write_whole(path: Path, data: bytes) -> None:
    """Write a file so that a reader, even after a power cut, finds all of it or what was before.

    The bytes go into a `.tmp` file beside it, reach the disk, are read back and compared, and take
    the file's place. Where the path is a link, they take the place of what it points at.

    Raises:
        RecordingError: The file cannot be written, or reads back otherwise; what was there before
            is untouched.
    """
    _write(path, data, replace=True)


def write_new(path: Path, data: bytes) -> None:
    """Write a file as `write_whole`, but only if there is none of this name at the end either.

    Raises:
        ConfigError: There is one (`RID-FILE-EXISTS`); it is untouched.
        RecordingError: The file cannot be written.
    """
    try:
        _write(path, data, replace=False)
    except FileExistsError:
        raise ConfigError(
            f"{path.name}: is there already; choose another name", code="RID-FILE-EXISTS"
        ) from None


def _write(path: Path, data: bytes, *, replace: bool) -> None:
    with _write_errors(path):
        target = path.resolve() if path.is_symlink() else path
        if not target.name or (target.exists() and not target.is_file()):
            raise RecordingError(
                f"{path}: cannot be written: is no file; choose another name", code="RID-FILE-WRITE"
            )
        temporary = target.with_name(f"{target.name}.{os.getpid()}.tmp")
        try:
            temporary.unlink(missing_ok=True)
            flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW
            with open(os.open(temporary, flags, 0o644), "wb") as file:
                file.write(data)
                file.flush()
                os.fsync(file.fileno())
            if temporary.read_bytes() != data:
                raise OSError(errno.EIO, "what was written reads back otherwise; check the disk")
            if replace:
                temporary.replace(target)
            else:
                os.link(temporary, target, follow_symlinks=False)
                temporary.unlink()
        except OSError:
            with contextlib.suppress(OSError):
                temporary.unlink(missing_ok=True)
            raise
        folder = os.open(target.parent, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)


@contextlib.contextmanager
def _write_errors(path: Path) -> Iterator[None]:
    try:
        with system_errors(RecordingError, f"{path}: cannot be written", code="RID-FILE-WRITE"):
            yield
    except RecordingError as error:
        if isinstance(error.__cause__, FileExistsError):
            raise error.__cause__ from None
        raise
