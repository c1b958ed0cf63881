"""Text from a device, escaped so that a terminal or a report can show it safely."""

from __future__ import annotations


def printable(text: bytes | str, limit: int = 64) -> str:
    r"""Return `text` with non-printable characters escaped, cut to `limit` characters.

    Args:
        text: Text from the device; bytes are read as Latin-1, so that every byte has a character.
        limit: Largest number of characters of `text` that are kept before escaping.

    Example:
        >>> printable(b"servo\x1b[2J")
        'servo\\x1b[2J'
    """
    characters = text.decode("latin-1") if isinstance(text, bytes) else text
    shown = characters[:limit]
    escaped = "".join(
        c if c.isprintable() and c != "\\" else c.encode("unicode_escape").decode("ascii")
        for c in shown
    )
    return escaped if len(characters) <= limit else escaped + "..."
