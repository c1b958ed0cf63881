"""`open_file`, `read_file`: a file's bytes, with its size checked before reading."""

from __future__ import annotations

import contextlib
import errno
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from config.formats.approved_files import require_approved


@contextlib.contextmanager
def open_file(path: Path, most_bytes: int, *, follow_link: bool = True) -> Iterator[BinaryIO]:
    """Open a file for reading after checking its type and size.

    The check applies to the opened file: replacing the path meanwhile has no effect. A pipe, a
    device or a folder is refused without blocking.

    Args:
        path: The file.
        most_bytes: The largest allowed size.
        follow_link: Whether the last part of the path may be a symbolic link.

    Raises:
        OSError: The path cannot be read, is not a file, or is larger than `most_bytes`; `strerror`
            states the reason.
    """
    flags = os.O_RDONLY | os.O_CLOEXEC | os.O_NONBLOCK | (0 if follow_link else os.O_NOFOLLOW)
    try:
        descriptor = os.open(path, flags)
    except ValueError as error:  # a zero byte in its name
        raise OSError(errno.EINVAL, str(error), str(path)) from None
    try:
        about = os.fstat(descriptor)
        if not stat.S_ISREG(about.st_mode):
            raise OSError(errno.EINVAL, "is not a file; name a file", str(path))
        if about.st_size > most_bytes:
            larger = f"is larger than the largest size of such a file, {_size(most_bytes)}"
            raise OSError(errno.EFBIG, larger, str(path))
        with open(descriptor, "rb", closefd=False) as file:
            yield file
    finally:
        os.close(descriptor)


def read_file(path: Path, most_bytes: int, *, follow_link: bool = True) -> bytes:
    """Return a file's bytes up to its size at opening, even if it grows meanwhile.

    Arguments and errors are those of `open_file`, and of `require_approved`.
    """
    with open_file(path, most_bytes, follow_link=follow_link) as file:
        size = os.fstat(file.fileno()).st_size
        # read one byte more than the file's size: this reveals a bad disk
        content = file.read(size + 1)[:size]
    require_approved(path, content)
    return content


def _size(count: int) -> str:
    """Return a number of bytes in GB, MB or kB."""
    for unit, factor in (("GB", 10**9), ("MB", 10**6)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count / 1e3:.3g} kB"
