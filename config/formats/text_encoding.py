"""`decode_text`, `encoding_of`: read texts of other programs in any Unicode encoding."""

from __future__ import annotations

from typing import Final

BEGINNING_BYTES: Final = 4096
"""Number of bytes from which `encoding_of` recognises the encoding of a file."""


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

    The byte order mark states the encoding. Without it, a text whose digits and commas have a zero
    byte each is UTF-16; any other text is UTF-8.

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
