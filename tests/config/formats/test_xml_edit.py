"""Changes of an XML file at given positions: all bytes outside the change stay the same."""

from __future__ import annotations

import pytest

from config.formats.xml_edit import XmlEditor
from config.formats.xml_tree import parse_xml


def editor_of(data: bytes) -> XmlEditor:
    return XmlEditor(data, parse_xml(data, "arm.xml"))


def test_values_change_in_place_with_their_quotes() -> None:
    data = b"<a>\n <!-- 1 -->\n <b\tx = '1'  y=\"2 > 1\" >t</b ><!-- 2 --></a>\n"
    editor = editor_of(data)
    editor.set_attributes(editor.root.children[0], {"y": "7", "x": "8"})
    assert editor.result() == data.replace(b"'1'", b"'8'").replace(b"2 > 1", b"7")


def test_a_missing_attribute_is_added_after_the_last_one() -> None:
    editor = editor_of(b"<a><b x='1' /><c/></a>")
    editor.set_attributes(editor.root.children[0], {"x": "3", "y": "2"})
    editor.set_attributes(editor.root.children[1], {"z": "4"})
    assert editor.result() == b'<a><b x=\'3\' y="2" /><c z="4"/></a>'


def test_new_elements_have_the_indent_and_the_line_break_of_the_file() -> None:
    data = b"<a>\r\n\t<b>\r\n\t\t<c/>\r\n\t</b>\r\n\t<d/>\r\n</a>"
    editor = editor_of(data)
    b, d = editor.root.children
    editor.insert_first(b, ["<x/>"])
    editor.insert_last(b, ["<y/>"])
    editor.insert_last(d, ["<z/>"])
    assert editor.result() == (
        b"<a>\r\n\t<b>\r\n\t\t<x/>\r\n\t\t<c/>\r\n\t\t<y/>\r\n\t</b>\r\n"
        b"\t<d>\r\n\t  <z/>\r\n\t</d>\r\n</a>"
    )


@pytest.mark.parametrize(
    "data",
    [
        "\ufeff<a><b x='1'/></a>".encode(),
        "<?xml version='1.0' encoding='ISO-8859-1'?><!-- é --><a é='ü'><b x='1'/></a>".encode(
            "latin-1"
        ),
        b"<a><![CDATA[<b x='1'/>]]><b x='1'/></a>",
    ],
)
def test_positions_are_bytes_of_the_file(data: bytes) -> None:
    editor = editor_of(data)
    editor.set_attributes(editor.root.children[0], {"x": "25"})
    before, _, after = data.rpartition(b"'1'")
    assert editor.result() == before + b"'25'" + after


def test_a_last_child_without_end_tag_ends_before_its_parent() -> None:
    editor = editor_of(b"<a><b><c x='/>'/></b><d>/></d></a>")
    b, d = editor.root.children
    assert [editor.data[one.start : one.end] for one in (b.children[0], d)] == [
        b"<c x='/>'/>",
        b"<d>/></d>",
    ]
    editor.insert_last(b, ["<e/>"])
    assert parse_xml(editor.result(), "again").children[0].children[1].tag == "e"
