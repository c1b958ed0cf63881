"""Commands and answers of an amplifier, byte by byte.

Only the command `operate` was seen on a real one; the answers are assumed.
"""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.cell.amplifier_profile import AmplifierProfile
from config.errors import ProtocolError
from config.load import load_bundled_or_path
from drivers.amplifier.codec import (
    MAX_LINE_BYTES,
    AmplifierCodec,
    AmplifierCommand,
    AmplifierReply,
    LineSplitter,
    RequestError,
)
from tests.builders.raised_codes import raises_code

PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
CODEC = AmplifierCodec(PROFILE)

# Verified: a Kistler 5015 on RS-232 accepts RO1 (operate) and RO0 (reset), ended by CR, and answers
# with a line ended by CR. The other commands are the profile's own, in the same style.
TRANSCRIPT = [
    (b"RO1\r", AmplifierCommand("operate", 0, "1")),
    (b"RO0\r", AmplifierCommand("operate", 0, "0")),
    (b"RO?\r", AmplifierCommand("operate", 0, None)),
    (b"ID?\r", AmplifierCommand("identify", 0, None)),
    (b"3:RG2500\r", AmplifierCommand("range", 3, "2500")),
    (b"3:RG?\r", AmplifierCommand("range", 3, None)),
    (b"8:SE-3.8\r", AmplifierCommand("sensitivity", 8, "-3.8")),
    (b"LP300\r", AmplifierCommand("low_pass", 0, "300")),
    (b"OV?\r", AmplifierCommand("overload", 0, None)),
    (b"VA?\r", AmplifierCommand("values", 0, None)),
    (b"SF1\r", AmplifierCommand("format", 0, "1")),
    (b"SR1000\r", AmplifierCommand("rate", 0, "1000")),
    (b"ST1\r", AmplifierCommand("stream", 0, "1")),
    (b"TM?\r", AmplifierCommand("time", 0, None)),
]


@pytest.mark.parametrize(("line", "request_"), TRANSCRIPT)
def test_commands_are_encoded_as_on_the_line(line: bytes, request_: AmplifierCommand) -> None:
    assert CODEC.request(request_.name, request_.value, request_.channel) == line
    assert CODEC.read_request(line.rstrip(b"\r")) == request_


def test_only_operate_is_verified_and_its_source_is_given() -> None:
    verified = {name: word for name, word in PROFILE.commands if word.verified}
    assert list(verified) == ["operate"]
    assert verified["operate"].source


@pytest.mark.parametrize(
    ("line", "answer"),
    [
        (b"OK\r", AmplifierReply()),
        (b"OK,CL\r", AmplifierReply(charge_lost=True)),
        (b"E03\r", AmplifierReply(error="03")),
        (b"2500\r", AmplifierReply(text="2500")),
        (b"Example,M8,007,1.2\r", AmplifierReply(text="Example,M8,007,1.2")),
    ],
)
def test_answers_are_decoded_as_on_the_line(line: bytes, answer: AmplifierReply) -> None:
    assert CODEC.answer(answer) == line
    assert CODEC.read_answer(line.rstrip(b"\r")) == answer


@pytest.mark.parametrize(
    ("line", "number"),
    [
        (b"XX1", "01"),
        (b"RO", "01"),
        (b"", "01"),
        (b"ro1", "01"),
        (b"\xff?", "01"),
        (b"9:RG?", "04"),
    ],
)
def test_a_refused_command_is_reported_with_its_number(line: bytes, number: str) -> None:
    with pytest.raises(RequestError) as caught:
        CODEC.read_request(line)
    assert caught.value.number == number


def test_an_answer_that_is_not_text_is_shown_escaped() -> None:
    with raises_code(ProtocolError, "RID-AMPLIFIER-ANSWER", "\\x1b[2J"):
        CODEC.read_answer(b"\x1b[2J")
    assert CODEC.error_text("03") == "error E03 (value out of range)"
    assert CODEC.error_text("77").startswith("error E77 (")
    assert "77" not in PROFILE.errors


@given(st.binary(max_size=40))
def test_any_line_is_a_command_or_an_error(line: bytes) -> None:
    try:
        request = CODEC.read_request(line)
    except RequestError:
        return
    again = CODEC.request(request.name, request.value, request.channel)
    assert CODEC.read_request(again.rstrip(b"\r")) == request


@pytest.mark.parametrize("end", [b"\r", b"\n", b"\r\n"])
def test_lines_end_with_cr_or_lf_or_both(end: bytes) -> None:
    lines = LineSplitter()
    lines.feed(b"OK" + end + b"E01" + end + b"ha")
    assert [lines.next_line(), lines.next_line(), lines.next_line()] == [b"OK", b"E01", None]
    lines.feed(b"lf" + end)
    assert lines.next_line() == b"half"


def test_an_endless_line_needs_bounded_memory() -> None:
    lines = LineSplitter()
    for _ in range(1000):
        lines.feed(bytes(100))
        assert lines.next_line() is None
        assert len(lines.rest) <= MAX_LINE_BYTES
    lines.feed(b"\rOK\r")
    lines.next_line()
    assert lines.next_line() == b"OK"
