"""`open_file`, `read_file`, `read_pieces`, `decode_text`: a file of limited size, bytes or text."""

from __future__ import annotations

import contextlib
import errno
import hashlib
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, Final

from config.errors import ConfigError, system_errors
from config.formats.approved_files import require_approved, require_approved_hash

PIECE_BYTES: Final = 1 << 20
BEGINNING_BYTES: Final = 4096
"""Number of bytes from which `encoding_of` recognises the encoding of a text."""


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


def read_pieces(path: Path, most_bytes: int) -> Iterator[bytes]:
    """Yield a file's bytes up to its size at opening, `PIECE_BYTES` at a time.

    Raises:
        ConfigError: The file cannot be read, or differs from the approved one.
    """
    digest = hashlib.sha256()
    with (
        system_errors(ConfigError, f"cannot read {path}", code="RID-FILE-READ"),
        open_file(path, most_bytes) as file,
    ):
        left = os.fstat(file.fileno()).st_size
        while piece := file.read(min(PIECE_BYTES, left)):
            digest.update(piece)
            left -= len(piece)
            yield piece
    require_approved_hash(path, digest.hexdigest())


def decode_text(data: bytes) -> str:
    """Return the text of a whole file, without its byte order mark.

    Windows PowerShell writes UTF-16 if a program's output is redirected into a file, and
    spreadsheets write it as "Unicode text".

    Args:
        data: Contents of the file.

    Raises:
        UnicodeDecodeError: The bytes are not a text in the recognised encoding.
    """
    return data.decode(encoding_of(data[:BEGINNING_BYTES]))


def encoding_of(beginning: bytes) -> str:
    """Return the name of the Unicode encoding of a text.

    The byte order mark states the encoding. Without it, a text is UTF-16 if more than half of the
    bytes at even positions are zero and none at odd positions, or the reverse; any other text is
    UTF-8.

    Args:
        beginning: First bytes of the text, at most `BEGINNING_BYTES`.

    Returns:
        A name that `bytes.decode` accepts. The decoded text contains no byte order mark.
    """
    if beginning[:4] in (b"\xff\xfe\0\0", b"\0\0\xfe\xff"):
        return "utf-32"
    if beginning[:2] in (b"\xff\xfe", b"\xfe\xff"):
        return "utf-16"
    first, second = beginning[0::2], beginning[1::2]
    if second.count(0) > 0.5 * len(second) and 0 not in first:
        return "utf-16-le"
    if first.count(0) > 0.5 * len(first) and 0 not in second:
        return "utf-16-be"
    return "utf-8-sig"


def encoding_hint(text: bytes) -> str:
    """Return the end of a message on bytes that are not UTF-8: what to do about them."""
    encoding = encoding_of(text[:BEGINNING_BYTES])
    if encoding.startswith(("utf-16", "utf-32")):
        return f": it is {encoding[:6].upper()} text; save it as UTF-8"
    return "; is it the right file?"


def _size(count: int) -> str:
    """Return a number of bytes in GB, MB or kB."""
    for unit, factor in (("GB", 10**9), ("MB", 10**6)):
        if count >= factor:
            return f"{count / factor:.3g} {unit}"
    return f"{count / 1e3:.3g} kB"
