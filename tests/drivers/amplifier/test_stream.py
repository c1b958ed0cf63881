"""Data stream of the amplifier with garbage, arbitrary splits and counter overflows: a decoded
number is never wrong.
"""

from __future__ import annotations

import random
import struct
from binascii import crc_hqx
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.cell.amplifier_profile import AmplifierProfile
from config.load import load_bundled_or_path
from drivers.amplifier.frames import (
    encode_event,
    encode_row,
    event_layout,
    row_layout,
)
from drivers.amplifier.stream import AmplifierStream

PROFILE = load_bundled_or_path("kistler_style", "profiles", AmplifierProfile)
RATE_HZ = 1000.0
ROW_TICKS = round(PROFILE.ticks_per_s / RATE_HZ)
FORMS = ("ascii", "binary")
EVENTS = PROFILE.events

form = pytest.mark.parametrize("form", FORMS)


def counts_of(number: int) -> list[int]:
    return [int(v) for v in np.random.default_rng(number).integers(-32768, 32768, 8)]


def row(form: str, number: int, *, sequence: int | None = None, ticks: int | None = None) -> bytes:
    return encode_row(
        row_layout(PROFILE, form),
        number if sequence is None else sequence,
        number * ROW_TICKS if ticks is None else ticks,
        1 << PROFILE.status_bits.operate,
        counts_of(number),
    )


def event(form: str, kind: int, number: int, detail: int = 0) -> bytes:
    layout = event_layout(PROFILE, form)
    return encode_event(layout, kind, number, number * ROW_TICKS, detail)


def stream(form: str) -> AmplifierStream:
    return AmplifierStream(PROFILE, form, RATE_HZ)


def rows_of(form: str, data: bytes, cuts: list[int] | None = None) -> tuple[Any, AmplifierStream]:
    parser = stream(form)
    edges = [0, *sorted(cuts or []), len(data)]
    blocks = [parser.feed(data[a:b]).rows for a, b in pairwise(edges)]
    return np.concatenate(blocks), parser


# transcripts: the profile's layout, byte by byte


def test_a_text_row_is_decoded_as_on_the_line() -> None:
    line = encode_row(row_layout(PROFILE, "ascii"), 26, 5_000_000, 0x104, [1, -1, 0, 32767] * 2)
    body = b"#001A,004C4B40,0104" + b"+00001-00001+00000+32767" * 2 + b"*"
    assert line == body + b"%04X\r" % crc_hqx(body, 0xFFFF)
    assert len(line) == PROFILE.row_bytes("ascii") == 73


def test_a_binary_row_is_decoded_as_on_the_line() -> None:
    data = encode_row(row_layout(PROFILE, "binary"), 26, 5_000_000, 0x104, [1, -1, 0, 32767] * 2)
    body = b"\xa5\x5a" + struct.pack("<HIH8h", 26, 5_000_000, 0x104, *([1, -1, 0, 32767] * 2))
    assert data == body + struct.pack(">H", crc_hqx(body, 0xFFFF))
    assert len(data) == PROFILE.row_bytes("binary") == 28


def test_the_checksum_is_the_published_one() -> None:
    assert crc_hqx(b"123456789", 0xFFFF) == 0x29B1  # CRC-16/IBM-3740, "CCITT-FALSE"


def test_an_event_is_decoded_as_on_the_line() -> None:
    line = event("ascii", EVENTS.trigger, 3, detail=7)
    assert line.startswith(b"!03,0003,00000BB8,0007*")
    assert (len(line), len(event("binary", 3, 3))) == (28, 14)


@form
def test_rows_are_decoded_as_sent(form: str) -> None:
    rows, parser = rows_of(form, b"".join(row(form, i) for i in range(500)))
    assert rows["sequence"].tolist() == list(range(500))
    assert rows["ticks"].tolist() == [i * ROW_TICKS for i in range(500)]
    assert rows["counts"].tolist() == [counts_of(i) for i in range(500)]
    assert set(rows["status"].tolist()) == {1 << PROFILE.status_bits.operate}
    assert (parser.counts.garbage_bytes, parser.counts.gaps, parser.buffered_bytes) == (0, 0, 0)


@form
@given(data=st.data())
def test_any_split_gives_the_same_rows(form: str, data: st.DataObject) -> None:
    pieces = [row(form, i) for i in range(8)]
    for i in range(8):
        pieces[i] = data.draw(st.binary(max_size=12)) + pieces[i]
    whole = b"".join(pieces)
    cuts = data.draw(st.lists(st.integers(0, len(whole)), max_size=12))
    together, parser = rows_of(form, whole)
    apart, other = rows_of(form, whole, cuts)
    assert apart.tobytes() == together.tobytes()
    assert other.counts == parser.counts


@form
@given(garbage=st.binary(max_size=400))
def test_garbage_between_rows_loses_at_most_two(form: str, garbage: bytes) -> None:
    data = b"".join(row(form, i) for i in range(5)) + garbage
    data += b"".join(row(form, i) for i in range(5, 12))
    rows, _ = rows_of(form, data)
    numbers = rows["sequence"].tolist()
    assert len(set(numbers) & set(range(12))) >= 10
    assert numbers[-1] == 11


@form
@given(data=st.data())
def test_lost_and_changed_bytes_lose_only_the_rows_that_they_hit(
    form: str, data: st.DataObject
) -> None:
    whole = b"".join(row(form, i) for i in range(12))
    start = data.draw(st.integers(0, len(whole) - 1))
    end = data.draw(st.integers(start, min(start + 100, len(whole))))
    hit = set(range(start // len(row(form, 0)), -(-end // len(row(form, 0)))))
    rows, _ = rows_of(form, whole[:start] + data.draw(st.binary(max_size=30)) + whole[end:])
    good = {r["sequence"]: r["counts"].tolist() for r in rows}
    assert set(range(12)) - hit <= set(good) | ({max(hit) + 1} if hit else set())
    assert all(good[i] == counts_of(i) for i in good if i < 12)


@form
def test_the_start_of_a_row_as_garbage_loses_no_row(form: str) -> None:
    data = row(form, 0) + row(form, 1)[:20] + row(form, 2) + row(form, 3)
    rows, parser = rows_of(form, data)
    assert rows["sequence"].tolist() == [0, 2, 3]
    assert (parser.counts.bad_frames, parser.counts.gaps, parser.counts.rows_lost) == (1, 1, 1)


@form
@pytest.mark.parametrize("flood", [b"\0", b"\xff", b"#", b"\xa5", b"\xa5\x5a", b"\r"])
def test_continuous_garbage_needs_bounded_memory(form: str, flood: bytes) -> None:
    parser = stream(form)
    for _ in range(200):
        assert len(parser.feed(flood * 500).rows) == 0
        assert parser.buffered_bytes < 73
    parser.feed(b"".join(row(form, i) for i in range(3)))
    assert parser.feed(row(form, 3)).rows["sequence"].tolist() == [3]


@form
def test_every_single_changed_bit_is_detected(form: str) -> None:
    good = row(form, 7)
    for bit in range(8 * (len(good) - (form == "ascii"))):
        bad = bytearray(good)
        bad[bit // 8] ^= 1 << bit % 8
        rows, _ = rows_of(form, row(form, 6) + bytes(bad) + row(form, 8))
        numbers = rows["sequence"].tolist()
        # a lower-case and an upper-case hex digit of the checksum are the same digit
        assert numbers == [6, 8] or (bytes(bad).upper() == good and form == "ascii")


@form
def test_gaps_are_counted(form: str) -> None:
    rows, parser = rows_of(form, b"".join(row(form, i) for i in (0, 1, 4, 5, 9)))
    assert rows["sequence"].tolist() == [0, 1, 4, 5, 9]
    assert (parser.counts.gaps, parser.counts.rows_lost) == (2, 5)


@form
def test_sequence_and_time_continue_over_their_overflows(form: str) -> None:
    first = (1 << 32) // ROW_TICKS - 5
    numbers = range(first, first + 10)
    rows, parser = rows_of(form, b"".join(row(form, i) for i in numbers))
    assert np.diff(rows["sequence"]).tolist() == [1] * 9
    assert np.diff(rows["ticks"]).tolist() == [ROW_TICKS] * 9
    assert (parser.counts.gaps, rows["stream"].max()) == (0, 0)


def test_a_gap_longer_than_the_sequence_is_counted_by_the_device_time() -> None:
    parser = AmplifierStream(PROFILE, "binary", 10_000.0)
    lost = 200_000
    data = [row("binary", 0, ticks=0), row("binary", 0, sequence=lost, ticks=lost * 100)]
    rows = parser.feed(b"".join(data)).rows
    assert rows["sequence"].tolist() == [0, lost]
    assert parser.counts.rows_lost == lost - 1


@form
def test_a_restarted_device_starts_a_new_stream(form: str) -> None:
    numbers = [50_000, 50_001, 0, 1, 2]
    rows, _ = rows_of(form, b"".join(row(form, i) for i in numbers))
    assert rows["stream"].tolist() == [0, 0, 1, 1, 1]
    assert rows["sequence"].tolist() == numbers
    assert rows["ticks"].tolist() == [i * ROW_TICKS for i in numbers]


@form
def test_a_repeated_row_is_skipped(form: str) -> None:
    rows, parser = rows_of(form, row(form, 1) * 2 + row(form, 2))
    assert rows["sequence"].tolist() == [1, 2]
    assert parser.counts.repeated_rows == 1


@form
def test_events_keep_their_place_and_time(form: str) -> None:
    data = event(form, EVENTS.trigger, 0, detail=1) + row(form, 0) + row(form, 1)
    data += event(form, EVENTS.overload, 2, detail=0b100) + row(form, 2)
    parser = stream(form)
    block = parser.feed(data)
    assert block.events["kind"].tolist() == [EVENTS.trigger, EVENTS.overload]
    assert block.events["sequence"].tolist() == [0, 2]
    assert block.events["ticks"].tolist() == [0, 2 * ROW_TICKS]
    assert block.events["detail"].tolist() == [1, 4]
    assert len(block.rows) == 3
    assert parser.counts.garbage_bytes == 0


@form
def test_an_event_near_the_overflow_has_the_time_of_its_row(form: str) -> None:
    last = (1 << 32) // ROW_TICKS
    parser = stream(form)
    events = parser.feed(event(form, EVENTS.trigger, last - 1)).events
    rows = parser.feed(row(form, last + 1)).rows
    late = parser.feed(event(form, EVENTS.trigger, last - 1)).events
    assert int(rows["ticks"][0] - events["ticks"][0]) == 2 * ROW_TICKS
    assert late["ticks"].tolist() == events["ticks"].tolist()


@form
def test_after_the_stopped_event_the_line_is_text_again(form: str) -> None:
    parser = stream(form)
    block = parser.feed(row(form, 0) + event(form, EVENTS.stopped, 1) + b"\rOK\r")
    assert len(block.rows) == 1
    assert parser.stopped
    assert parser.rest == b"\rOK\r" or parser.rest == b"\r\rOK\r"
    assert len(parser.feed(row(form, 5)).rows) == 0


def test_lower_case_hex_digits_and_line_feeds_are_accepted() -> None:
    line = row("ascii", 0xABC).rstrip(b"\r")
    crc = line[-4:].lower()
    rows, parser = rows_of("ascii", line[:-4] + crc + b"\r\n" + row("ascii", 0xABD))
    assert rows["sequence"].tolist() == [0xABC, 0xABD]
    assert parser.counts.garbage_bytes == 0


@pytest.mark.parametrize("count", [b"+99999", b"+1_000", b" 00001", b"-32769", b"000001"])
def test_a_text_row_without_numbers_is_refused_despite_its_checksum(count: bytes) -> None:
    body = b"#001A,004C4B40,0100" + b"+00001" * 7 + count + b"*"
    rows, parser = rows_of("ascii", body + b"%04X\r" % crc_hqx(body, 0xFFFF) + row("ascii", 1))
    assert rows["sequence"].tolist() == [1]
    assert parser.counts.bad_frames == 1


def test_counts_out_of_range_are_not_sent() -> None:
    for name in FORMS:
        layout = row_layout(PROFILE, name)
        with pytest.raises((ValueError, struct.error)):
            encode_row(layout, 0, 0, 0, [0] * 7)
        with pytest.raises((ValueError, struct.error)):
            encode_row(layout, 0, 0, 0, [100_000, *[0] * 7])


def test_a_stream_with_random_damage_never_gives_a_wrong_number() -> None:
    rng = random.Random(5)
    whole = b"".join(row("binary", i) for i in range(40))
    for _ in range(300):
        damaged = bytearray(whole)
        for _ in range(rng.randrange(1, 6)):
            at = rng.randrange(len(damaged))
            if rng.random() < 0.5:
                del damaged[at : at + rng.randrange(1, 40)]
            else:
                damaged[at : at + 4] = rng.randbytes(4)
        rows, _ = rows_of("binary", bytes(damaged))
        for r in rows:
            assert r["counts"].tolist() == counts_of(int(r["sequence"]))
