"""Randomly changed EDS files are read, or refused with file and line, within a short time.

The test makes 10,000 changed files, and 100,000 in a run of the long tests. Bytes are flipped, cut,
doubled, or replaced by text that has broken parsers before; lines are deleted, doubled or moved.
Then files of the largest allowed size are read.
"""

from __future__ import annotations

import random
import re
import time
import tracemalloc
from collections import Counter
from datetime import datetime
from fractions import Fraction

import pytest

from config.errors import ConfigError
from config.formats.eds import MAX_OBJECTS, parse_eds
from config.formats.eds_text import MAX_BYTES, MAX_LINE_CHARACTERS
from mock_hw.drive.eds import drive_eds
from mock_hw.drive.objects import SimulatedIdentity

pytestmark = pytest.mark.slow

SMALL = b"""[DeviceInfo]
VendorNumber=0xFB
RevisionNumber=0x10000
[1000]
ParameterName=Type
DataType=7
AccessType=ro
DefaultValue=131474
[1003]
ObjectType=8
DataType=7
AccessType=ro
CompactSubObj=4
[1400sub1]
DataType=0x7
AccessType=rw
DefaultValue=$NODEID+0x200
[6077]
DataType=3
AccessType=ro
PDOMapping=1
LowLimit=-32768 ; all
[DeviceComissioning]
NodeID=5
"""
NASTY = (
    b"9" * 400, b"0x" + b"F" * 400, b"-", b"+", b"0x", b"08", b"1e999", b"NaN", b"$NODEID",
    b"$NODEID+", b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\x1b[2J", b"\x85", b"\xc2\x85", b"\x0b",
    b"\x1c", b"\r", b"\n", b"\r\n", b"\t", b" ", b";", b" ;", b"#", b"=", b"==", b":", b"[", b"]",
    b"[]", b"[1000]", b"[1000sub0]", b"[FFFFsubFF]", b"[1000subFFF]", b"[1000Name]",
    b"\n[2000]\nCompactSubObj=254\n", b"\nCompactSubObj=0xFE\n", b"\nObjectType=9\n",
    b"\nDataType=1\n", b"\nDataType=8\n", b"\nParameterValue=1\n", b"\xf0\x9f\xa4\x96",
    b"\xed\xa0\x80", b"%s%n", b"\\x00", b"rw", b"x" * 5000,
)  # fmt: skip
REFUSED = re.compile(r"drive\.eds(:\d+)?: [^\s].*")
LONGEST_S = 30.0  # processor time: detects an endless loop


def change_bytes(data: bytes, chance: random.Random) -> bytes:
    """Return a copy of an EDS file with one to five random changes."""
    copy = bytearray(data)
    for _ in range(chance.choice((1, 1, 1, 2, 5))):
        at, size = chance.randrange(len(copy) + 1), chance.choice((1, 2, 8, 64))
        match chance.randrange(8):
            case 0:
                copy[at : at + size] = b""
            case 1:
                copy[at:at] = copy[at : at + size]
            case 2:
                copy[at:at] = chance.choice(NASTY)
            case 3:
                copy[at : at + size] = chance.choice(NASTY)
            case 4 if at < len(copy):
                copy[at] ^= 1 << chance.randrange(8)
            case 5:
                del copy[at:]
            case _:
                lines = copy.splitlines(keepends=True)
                line = chance.randrange(len(lines)) if lines else 0
                kept = lines[line : line + 1]
                if chance.random() < 0.5:
                    del lines[line : line + 1]
                place = chance.randrange(len(lines) + 1)
                copy = bytearray(b"".join([*lines[:place], *kept, *lines[place:]]))
    return bytes(copy)


def outcome(data: bytes) -> str:
    """Read an EDS file; return `read`, or the error without positions and values."""
    try:
        sheet = parse_eds(data, "drive.eds")
    except ConfigError as error:
        message = str(error)
        assert message.isprintable()
        assert REFUSED.fullmatch(message)
        assert len(message) < 400
        return re.sub(r"'.*'|\".*\"|\d+", "", message)
    addresses = [(item.index, item.subindex) for item in sheet.objects]
    assert addresses == sorted(set(addresses))
    assert 0 < len(addresses) <= MAX_OBJECTS
    assert all(fault.text.isprintable() and len(fault.text) < 400 for fault in sheet.faults)
    return "read"


@pytest.mark.parametrize("sheets", [10_000, pytest.param(100_000, marks=pytest.mark.long)])
def test_sheets_with_random_changes_are_read_or_refused_with_their_line(sheets: int) -> None:
    chance = random.Random(4)
    counts: Counter[str] = Counter()
    for _ in range(sheets):  # the timeout of the test ends an endless loop
        counts[outcome(change_bytes(SMALL, chance))] += 1
    assert counts["read"] > 0.2 * sheets
    assert counts.total() - counts["read"] > 0.2 * sheets
    # At least this many kinds of refusals occurred; a faulty object does not refuse the sheet.
    assert len(counts) > (44 if sheets == 100_000 else 34)


def test_a_complete_sheet_with_random_changes_is_read_or_refused() -> None:
    sheet = drive_eds(
        SimulatedIdentity(5, 4096, Fraction(100), 1500), "drive.eds", datetime(2026, 1, 2)
    )
    data, chance = sheet.encode(), random.Random(9)
    counts = Counter(outcome(change_bytes(data, chance)) for _ in range(1000))
    assert counts["read"] > 100
    assert len(counts) > 30


@pytest.mark.parametrize(
    "piece",
    [
        b"[", b"[]\n", b"[1000]\n", b"\n", b"\r", b";\n", b"a=b\n", b"=", b" ", b"\x00", b"\xff",
        b" ;", b"9", b"[DeviceInfo]\na=b\n", b"x" * (MAX_LINE_CHARACTERS - 1) + b"\n",
        b"\xc2\x85", b"\x0c",
    ],
)  # fmt: skip
def test_files_filled_with_one_kind_of_content_are_read_or_refused(piece: bytes) -> None:
    whole = piece * (MAX_BYTES // len(piece))
    begun_s = time.process_time()
    for head in (b"", b"[DeviceInfo]\n[1000]\nDataType=9\nDefaultValue="):
        outcome(head + whole[: MAX_BYTES - len(head)])
    assert time.process_time() - begun_s < LONGEST_S


def sub_objects() -> bytes:
    return b"".join(b"[%04Xsub%X]\nDataType=7\n" % (i >> 8, i & 0xFF) for i in range(180_000))


def compact_arrays() -> bytes:
    return b"".join(b"[%04X]\nDataType=7\nCompactSubObj=254\n" % i for i in range(0x10000))


def keys() -> bytes:
    return b"[1000]\n" + b"".join(b"%d=\n" % i for i in range(450_000))


def comments() -> bytes:
    line = b"k=" + b";" * (MAX_LINE_CHARACTERS - 2) + b"\n"
    return b"[1000]\n" + line * (MAX_BYTES // len(line) - 1)


@pytest.mark.parametrize("make", [sub_objects, compact_arrays, keys, comments])
def test_the_largest_files_need_little_memory(make: object) -> None:
    assert callable(make)
    data = b"[DeviceInfo]\nVendorNumber=1\n" + make()[: MAX_BYTES - 1000]
    begun_s = time.process_time()
    tracemalloc.start()
    try:
        outcome(data)
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert time.process_time() - begun_s < LONGEST_S
    assert peak < 25 * MAX_BYTES
