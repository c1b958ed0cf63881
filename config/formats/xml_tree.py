"""Conversion of XML text to plain elements with line numbers, safe against hostile files.

Document types are refused, and with them all declarations of entities (expansion bombs, inclusion
of files and addresses); size and depth are limited.
"""

from __future__ import annotations

import codecs
import re
from dataclasses import dataclass, field
from typing import Final
from xml.parsers import expat

from config.errors import ConfigError
from config.formats.number import NUMBER_CODE, number_hint, parse_number

MAX_BYTES: Final = 20_000_000
MAX_DEPTH: Final = 60
LARGEST_NUMBER: Final = 1e12
START_TAG: Final = re.compile(rb"""<(?:[^"'>]|"[^"]*"|'[^']*')*>""")
_MARKS: Final = (
    (codecs.BOM_UTF8, "utf-8"),
    # tested before UTF-16, because the two byte order marks begin alike
    (codecs.BOM_UTF32_LE, "utf-32"),
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


@dataclass(frozen=True)
class XmlElement:
    """One element: its tag, attributes, children and place in the file.

    Attributes:
        file: Name of the file in messages.
        start: Position of the element's first byte in the file, after `utf8_xml`.
        end: Position after the element's last byte.
    """

    tag: str
    attributes: dict[str, str]
    line: int
    file: str
    children: tuple[XmlElement, ...] = ()
    text: str = ""
    start: int = 0
    end: int = 0

    @property
    def where(self) -> str:
        """`file:line` of this element."""
        return f"{self.file}:{self.line}"

    def all(self, tag: str) -> list[XmlElement]:
        """Return the children with a tag."""
        return [child for child in self.children if child.tag == tag]

    def one(self, tag: str) -> XmlElement | None:
        """Return the only child with a tag; None if it is missing.

        Raises:
            ConfigError: Several children have this tag.
        """
        found = self.all(tag)
        if len(found) > 1:
            raise ConfigError(
                f"{found[1].where}: <{self.tag}> has a second <{tag}>; remove one",
                code="RID-FILE-DUPLICATE",
            )
        return found[0] if found else None

    def attribute(self, name: str) -> str:
        """Return an attribute.

        Raises:
            ConfigError: The attribute is missing.
        """
        value = self.attributes.get(name)
        if value is None:
            raise ConfigError(
                f"{self.where}: <{self.tag}> has no {name!r}; add it", code="RID-URDF-STRUCTURE"
            )
        return value

    def numbers(self, name: str, count: int, default: tuple[float, ...]) -> tuple[float, ...]:
        """Return `count` numbers of an attribute, or the default if it is missing.

        Raises:
            ConfigError: The attribute does not have `count` numbers with magnitudes below 1e12.
        """
        text = self.attributes.get(name)
        if text is None:
            return default
        words = text.split()
        try:
            values = tuple(parse_number(word) for word in words)
        except ConfigError:
            values = ()
        if len(values) != count or not all(abs(value) < LARGEST_NUMBER for value in values):
            raise ConfigError(
                f"{self.where}: {name} of <{self.tag}> is {text!r}, not {count}"
                f" number{'s' if count > 1 else ''} within ±{LARGEST_NUMBER:.0e}"
                f"{'' if values else number_hint(text.strip())}",
                code=NUMBER_CODE,
            )
        return values

    def number(self, name: str) -> float:
        """Return one number.

        Raises:
            ConfigError: The attribute is missing, or not a number with a magnitude below 1e12.
        """
        self.attribute(name)
        return self.numbers(name, 1, ())[0]

    def optional_number(self, name: str) -> float | None:
        """Return one number, or None if the attribute is missing.

        Raises:
            ConfigError: The attribute is not a number with a magnitude below 1e12.
        """
        return self.number(name) if name in self.attributes else None


@dataclass(frozen=True)
class _Open:
    """An element that is still being read; its lists grow."""

    tag: str
    attributes: dict[str, str]
    line: int
    start: int
    children: list[XmlElement] = field(default_factory=list)
    texts: list[str] = field(default_factory=list)


def utf8_xml(data: bytes, name: str) -> bytes:
    """Return XML bytes in UTF-8, or unchanged in a one-byte encoding (ISO 8859, Windows-125x).

    The encoding is that of the byte order mark or, without a mark, of the `<` at the beginning of
    the file. If these bytes do not show the encoding, the XML declaration states it. If the text is
    converted, its declaration becomes `utf-8`.

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
        proved = "utf-8"  # a file in this encoding would begin with other bytes
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


def parse_xml(data: bytes, name: str) -> XmlElement:
    """Parse one XML document and return its root.

    Args:
        data: The file's bytes, in any encoding that `utf8_xml` converts.
        name: Name of the file in messages.

    Raises:
        ConfigError: The text is not XML, has a document type, or is too large or too deep.
    """
    if len(data) > MAX_BYTES:
        raise ConfigError(
            f"{name}: {len(data)} bytes; at most {MAX_BYTES} are allowed", code="RID-FILE-SIZE"
        )
    data = utf8_xml(data, name)
    parser = expat.ParserCreate()
    parser.buffer_text = True
    waiting: list[_Open] = [_Open("", {}, 0, 0)]

    def start(tag: str, attributes: dict[str, str]) -> None:
        if len(waiting) > MAX_DEPTH:
            raise ConfigError(
                f"{name}:{parser.CurrentLineNumber}: nested deeper than {MAX_DEPTH}",
                code="RID-FILE-SIZE",
            )
        waiting.append(
            _Open(tag, dict(attributes), parser.CurrentLineNumber, parser.CurrentByteIndex)
        )

    def end(_tag: str) -> None:
        done = waiting.pop()
        tag = START_TAG.match(data, done.start)
        if tag is not None and tag.group().endswith(b"/>"):
            after = tag.end()
        else:
            after = data.find(b">", parser.CurrentByteIndex) + 1
        waiting[-1].children.append(
            XmlElement(
                tag=done.tag,
                attributes=done.attributes,
                line=done.line,
                file=name,
                children=tuple(done.children),
                text="".join(done.texts).strip(),
                start=done.start,
                end=after,
            )
        )

    def characters(text: str) -> None:
        waiting[-1].texts.append(text)

    def refuse(*_: object) -> None:
        raise ConfigError(
            f"{name}:{parser.CurrentLineNumber}: a document type or entity is declared; delete the"
            " declaration; a URDF does not need it",
            code="RID-URDF-ENTITY",
        )

    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.CharacterDataHandler = characters
    parser.StartDoctypeDeclHandler = refuse
    parser.EntityDeclHandler = refuse
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise ConfigError(
            f"{name}:{error.lineno}:{error.offset + 1}: not XML: {expat.ErrorString(error.code)}",
            code="RID-FILE-SYNTAX",
        ) from None
    except (LookupError, ValueError) as error:
        raise ConfigError(f"{name}: not XML: {error}", code="RID-FILE-SYNTAX") from None
    return waiting[0].children[0]
