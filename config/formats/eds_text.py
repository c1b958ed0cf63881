"""Text of an electronic data sheet: its sections and keys, with their line numbers.

The INI dialect of CiA 306-1, 4.2, as vendors write it: any case, spaces around keys and values,
comments after `;` or in lines that begin with `#`, any line ends, UTF-8 or Latin-1. Only known
sections and keys are kept. Other sections, which are mostly vendor-specific, may contain any text
of limited line length.
"""

from __future__ import annotations

import io
import re
from dataclasses import dataclass, field
from typing import NoReturn

from config.errors import ConfigError

MAX_BYTES = 4_000_000
MAX_LINE_CHARACTERS = 4096
MAX_SECTIONS = 30_000

_SHOWN = 40
_PLACE_DIGITS = 3  # a number as a key denotes an object of a compact array
_KEYS = frozenset(
    (
        "vendorname", "vendornumber", "productname", "productnumber", "revisionnumber", "nodeid",
        "parametername", "objecttype", "datatype", "accesstype", "pdomapping", "defaultvalue",
        "parametervalue", "lowlimit", "highlimit", "subnumber", "compactsubobj",
    )
)  # fmt: skip
_COMMENT = re.compile(r"\s;")
_READ = re.compile(
    r"deviceinfo|devicecomm?issioning|[0-9a-f]{4}(?:name|value|sub[0-9a-f]{1,2})?",
)


@dataclass(frozen=True, slots=True)
class EdsEntry:
    """A key in its original case, its value, and its line, counted from 1."""

    key: str
    text: str
    line: int


@dataclass(frozen=True)
class EdsSection:
    """A section in its original case, its first line, and its entries by keys in lower case."""

    name: str
    line: int
    entries: dict[str, EdsEntry] = field(default_factory=dict)

    def get(self, key: str) -> EdsEntry | None:
        """Return the entry of a key in lower case; None if it is missing or empty."""
        entry = self.entries.get(key)
        return entry if entry is not None and entry.text else None


def parse_sections(data: bytes, name: str) -> dict[str, EdsSection]:
    """Return the known sections of a data sheet, by their names in lower case.

    These are the device information, the commissioning (of a DCF) and the objects.

    Args:
        data: The file's bytes.
        name: Name of the file in messages.

    Raises:
        ConfigError: The file is too large, is not text, or a line is invalid; the message has
            `name:line` unless the file is too large.
    """
    if len(data) > MAX_BYTES:
        raise ConfigError(
            f"{name}: more than {MAX_BYTES} bytes; is it an electronic data sheet (EDS or DCF)?",
            code="RID-FILE-TYPE",
        )
    sections: dict[str, EdsSection] = {}
    section: EdsSection | None = None
    begun = False
    for number, raw in enumerate(io.StringIO(_text(data), newline=None), start=1):
        line = raw.strip()
        if not line or line[0] in ";#":
            continue
        if len(line) > MAX_LINE_CHARACTERS:
            refuse_line(
                name,
                number,
                f"the line has {len(line)} characters, at most {MAX_LINE_CHARACTERS} are allowed",
            )
        if "\0" in line:
            refuse_line(
                name,
                number,
                "a zero byte: this is not a text file; save it as UTF-8",
                "RID-FILE-TYPE",
            )
        if line[0] == "[":
            begun = True
            title = _title(line, name, number)
            section = None
            if _READ.fullmatch(title.lower()):
                section = _begin(sections, title, name, number)
        elif section is not None:
            _enter(section, _without_comment(line), name, number)
        elif not begun and line[0] == "<":
            refuse_line(
                name,
                number,
                "an XML device description (XDD or XDC, CiA 311) is not read: ask the manufacturer"
                " for the EDS or DCF, or convert the file to an EDS",
                "RID-FILE-TYPE",
            )
        elif not begun:
            refuse_line(
                name,
                number,
                f"{shown(line)} is before the first [section]; is it a data sheet (EDS, DCF)?",
                "RID-FILE-TYPE",
            )
    return sections


def refuse_line(name: str, line: int, problem: str, code: str = "RID-EDS-INVALID") -> NoReturn:
    """Raise a `ConfigError` that names file and line."""
    raise ConfigError(f"{name}:{line}: {problem}", code=code)


def shown(text: str) -> str:
    """Return text of a file in quotes, shortened, with non-printable characters escaped."""
    return repr(text) if len(text) <= _SHOWN else f"{text[:_SHOWN]!r}…"


def _text(data: bytes) -> str:
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def _title(line: str, name: str, number: int) -> str:
    title, closed, rest = line[1:].partition("]")
    if not closed:
        refuse_line(name, number, f"{shown(line)} has no closing ]; write [section]")
    if rest.strip()[:1] not in ("", ";", "#"):
        refuse_line(name, number, f"{shown(rest)} follows [section]; put it on a separate line")
    return title.strip()


def _begin(sections: dict[str, EdsSection], title: str, name: str, number: int) -> EdsSection:
    key = title.lower()
    if key[4:7] == "sub":  # [1018sub01] and [1018sub1] are the same
        key = f"{key[:7]}{int(key[7:], 16):x}"
    earlier = sections.get(key)
    if earlier is not None:
        refuse_line(
            name,
            number,
            f"[{title}] is a duplicate of line {earlier.line}; remove one",
            "RID-FILE-DUPLICATE",
        )
    if len(sections) == MAX_SECTIONS:
        refuse_line(
            name, number, f"more than {MAX_SECTIONS} sections; is it the file of one device?"
        )
    return sections.setdefault(key, EdsSection(title, number))


def _enter(section: EdsSection, line: str, name: str, number: int) -> None:
    key, equals, text = line.partition("=")
    key = key.strip()
    if not equals or not key:
        refuse_line(
            name, number, f"{shown(line)} in [{section.name}] is not key=value; correct the line"
        )
    lower = key.lower()
    if lower not in _KEYS and not (key.isdecimal() and len(key) <= _PLACE_DIGITS):
        return
    text = text.strip()
    earlier = section.entries.get(lower)
    if earlier is not None and earlier.text != text:
        refuse_line(
            name,
            number,
            f"{shown(key)} in [{section.name}] is a duplicate of line {earlier.line} with another"
            " value; remove one",
            "RID-FILE-DUPLICATE",
        )
    section.entries.setdefault(lower, EdsEntry(key, text, number))


def _without_comment(line: str) -> str:
    """Remove a comment at the end of a line: a `;` after a space."""
    comment = _COMMENT.search(line)
    return line if comment is None else line[: comment.start()].rstrip()
