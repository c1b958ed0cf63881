"""`XmlEditor`: changes of single attributes and elements in an XML file; all other bytes stay.

An XML library that reads a file and writes it again loses comments, the order of attributes, quotes
and line breaks. The editor replaces bytes at the positions that `parse_xml` found.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Final

from config.formats.xml_tree import START_TAG, XmlElement

STEP: Final = "  "
_ATTRIBUTE: Final = re.compile(rb"""\s([^\s=<>"'/]+)\s*=\s*("[^"]*"|'[^']*')""")


@dataclass(frozen=True)
class XmlEditor:
    """Collector of changes to a file.

    Attributes:
        data: The file's bytes; `utf8_xml` leaves them unchanged.
        root: The root element that `parse_xml` found in them.
    """

    data: bytes
    root: XmlElement
    _changes: list[tuple[int, int, bytes]] = field(default_factory=list)

    def set_attributes(self, element: XmlElement, values: Mapping[str, str]) -> None:
        """Replace attributes' values, and add the attributes that the element does not have.

        Args:
            element: An element of the file.
            values: New values by name; ASCII without `<`, `&` and quotes.
        """
        tag, _ = self._start_tag(element)
        present = {}
        for found in _ATTRIBUTE.finditer(tag):
            start, end = found.span(2)
            present[found.group(1).decode("latin-1")] = (
                element.start + start + 1,
                element.start + end - 1,
            )
        end_of_name = re.match(rb"<[^\s/>]+", tag)
        last = max(
            (end + 1 for _, end in present.values()),
            default=element.start + (end_of_name.end() if end_of_name else 0),
        )
        for name, value in values.items():
            if name in present:
                self._replace(*present[name], value)
            else:
                self._replace(last, last, f' {name}="{value}"')

    def insert_first(self, parent: XmlElement, lines: list[str]) -> None:
        """Insert an element, given as lines, before all other children of an element."""
        tag, is_empty = self._start_tag(parent)
        after = parent.start + len(tag)
        if is_empty:
            self._open(parent, lines)
            return
        self._replace(after, after, self._indented(parent, lines))

    def insert_last(self, parent: XmlElement, lines: list[str]) -> None:
        """Insert an element, given as lines, after all other children of an element."""
        if not parent.children:
            self.insert_first(parent, lines)
            return
        after = parent.children[-1].end
        self._replace(after, after, self._indented(parent, lines))

    def result(self) -> bytes:
        """Return the file with all changes."""
        parts, at = [], 0
        for start, end, text in sorted(self._changes, key=lambda change: change[:2]):
            parts += [self.data[at:start], text]
            at = end
        return b"".join((*parts, self.data[at:]))

    @property
    def line_break(self) -> str:
        """The file's line break."""
        return "\r\n" if b"\r\n" in self.data else "\n"

    def _start_tag(self, element: XmlElement) -> tuple[bytes, bool]:
        """Return an element's start tag, and True if the element has no end tag."""
        found = START_TAG.match(self.data, element.start)
        if found is None:
            raise AssertionError(f"{element.where}: no start tag at byte {element.start}")
        return found.group(), found.group().endswith(b"/>")

    def _open(self, element: XmlElement, lines: list[str]) -> None:
        """Insert the first child into an element that has no end tag."""
        tag, _ = self._start_tag(element)
        end = element.start + len(tag)
        close = f"{self.line_break}{self._indent(element)}</{element.tag}>"
        self._replace(end - 2, end, f">{self._indented(element, lines)}{close}")

    def _indented(self, parent: XmlElement, lines: list[str]) -> str:
        indent = self._indent(parent)
        inner = self._indent(parent.children[0]) if parent.children else ""
        inner = inner if len(inner) > len(indent) else indent + STEP
        return "".join(f"{self.line_break}{inner}{line}" for line in lines)

    def _indent(self, element: XmlElement) -> str:
        """Return the white space before an element; empty if another element is on its line."""
        line = self.data.rfind(b"\n", 0, element.start) + 1
        before = self.data[line : element.start]
        return before.decode("ascii") if not before.strip() else ""

    def _replace(self, start: int, end: int, text: str) -> None:
        self._changes.append((start, end, text.encode("ascii")))
