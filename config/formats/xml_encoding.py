"""`utf8_xml`: XML bytes of any encoding as bytes in which every tag is ASCII."""

from __future__ import annotations

import codecs
import re
from typing import Final

from config.errors import ConfigError

_MARKS: Final = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32"),  # before UTF-16: its mark begins like that of UTF-16
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
    (b"<\0\0\0", "utf-32-le"),
    (b"\0\0\0<", "utf-32-be"),
    (b"<\0", "utf-16-le"),
    (b"\0<", "utf-16-be"),
)
"""First bytes of a file, and the encoding that they prove (XML 1.0, appendix F)."""
_DECLARED: Final = re.compile(rb"""(<\?xml[^>]*?\sencoding\s*=\s*["'])([A-Za-z][\w.-]*)(["'])""")
_ONE_BYTE: Final = re.compile(
    r"us-ascii|ascii|utf-?8|iso-8859-\d+|latin-?\d+|windows-125\d|cp125\d"
)


def utf8_xml(data: bytes, name: str) -> bytes:
    """Return XML bytes in UTF-8, or as they are if every character below 128 is one byte.

    A byte order mark, or the first bytes of `<`, determine the encoding; the declaration determines
    it otherwise. If the text is converted, its declaration becomes `utf-8`.

    Args:
        data: The file's bytes.
        name: Name of the file in messages.

    Raises:
        ConfigError: The bytes are not text in this encoding, or the encoding is unknown.
    """
    declared = _DECLARED.match(data.removeprefix(codecs.BOM_UTF8))
    stated = declared[2].decode().lower() if declared else "utf-8"
    proved = next((encoding for mark, encoding in _MARKS if data.startswith(mark)), None)
    if proved is None and stated.startswith(("utf-16", "utf-32")):
        proved = "utf-8"  # such a file would begin otherwise
    encoding = proved or stated
    if encoding == "utf-8":
        return data if stated in ("utf-8", "utf8") else _declared_as_utf8(data)
    if proved is None and _ONE_BYTE.fullmatch(encoding):
        return data
    try:
        text = data.decode(encoding)
    except (LookupError, UnicodeError) as error:
        raise ConfigError(
            f"{name}: is not text in {encoding.upper()} ({error}); save it in UTF-8",
            code="RID-FILE-TYPE",
        ) from None
    return _declared_as_utf8(text.removeprefix("\ufeff").encode())


def _declared_as_utf8(data: bytes) -> bytes:
    return _DECLARED.sub(rb"\1utf-8\3", data, count=1)
