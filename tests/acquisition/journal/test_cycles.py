from __future__ import annotations

import errno
import os
import random
import resource
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.reader import make_reader

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.header import JournalHeader
from config.cell.torque_filter import ButterworthFilter
from config.errors import RecordingError
from tests.builders.raised_codes import raises_code

ROWS = 2000
ROWS_PER_FLUSH = 13
HEADER = JournalHeader(
    joint_names=("axis1", "axis2", "axis3"),
    sample_period_s=0.008,
    samples_per_period=100,
    torque_filter=ButterworthFilter(order=8, cutoff_hz=40.0),
    cell_name="cell",
    robot_name="arm",
    run_id="01J",
)


def some_rows(count: int = ROWS) -> np.ndarray:
    rng = np.random.default_rng(1)
    rows = np.zeros(count, dtype=row_dtype(3))
    rows["time_s"] = np.arange(count) * 0.008
    rows["cycle"] = np.arange(count)
    rows["sample_index"] = np.arange(count) - 5
    for field in ("position", "torque_nm", "target_position"):
        rows[field] = rng.normal(size=(count, 3))
    rows["valid"] = 1
    rows["valid"][7, 1] = 0
    rows["phase"] = 3
    return rows


def write(path: Path, rows: np.ndarray, *, finish: bool = True) -> None:
    with JournalWriter(path, HEADER) as writer:
        for start in range(0, len(rows), ROWS_PER_FLUSH):
            writer.append(rows[start : start + ROWS_PER_FLUSH].tobytes())
            writer.flush()
        if not finish:
            writer.abandon()


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    path = tmp_path_factory.mktemp("journal") / "whole.mcap"
    write(path, some_rows())
    return path.read_bytes()


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "recording.mcap"


@pytest.mark.parametrize("cuts", [[], [0, 7, 7, 8, 900], [1990]])
def test_many_rows_at_once_give_the_same_file_as_row_by_row(
    tmp_path: Path, cuts: list[int]
) -> None:
    rows = some_rows()
    rows["time_s"][[3, 500, 600, 601]] = -1.0, np.nan, 1e11, 700.123456789
    one, other = tmp_path / "one.mcap", tmp_path / "other.mcap"
    with JournalWriter(one, HEADER) as writer:
        writer.append(rows.tobytes())
    with JournalWriter(other, HEADER) as writer:
        for number, part in enumerate(np.split(rows, cuts)):
            if number % 2:
                writer.append(part.tobytes())
            else:
                writer.append_array(part)
        assert writer.rows == ROWS
    assert one.read_bytes() == other.read_bytes()


def test_rows_and_header_are_read_back_bit_by_bit(path: Path) -> None:
    rows = some_rows()
    write(path, rows)
    journal = read_journal(path)
    assert journal.header == HEADER
    assert journal.rows.tobytes() == rows.tobytes()
    assert journal.damage.finished
    assert journal.damage.notes == ()
    assert not journal.rows.flags.writeable


def test_a_journal_becomes_a_recording(path: Path) -> None:
    rows = some_rows()
    write(path, rows)
    recording = read_journal(path).recording()
    assert recording.joint_names == HEADER.joint_names
    assert recording.source == "cell"
    assert recording.samples_per_period == 100
    assert recording.torque_filter == HEADER.torque_filter
    np.testing.assert_array_equal(recording.torque_nm, rows["torque_nm"])
    assert np.flatnonzero(~recording.valid).tolist() == [7]


def test_the_mcap_package_reads_the_same_rows(path: Path) -> None:
    rows = some_rows()
    write(path, rows)
    with path.open("rb") as file:
        messages = list(make_reader(file, validate_crcs=True).iter_messages())
    schema, channel, first = messages[0]
    assert schema is not None
    assert (schema.name, schema.encoding) == ("rid_daq/msg/Cycle", "ros2msg")
    assert (channel.topic, channel.message_encoding) == ("/cycle", "cdr")
    assert first.data[:4] == b"\x00\x01\x00\x00"
    assert b"".join(message.data[4:] for _, _, message in messages) == rows.tobytes()
    assert messages[100][2].log_time == 800_000_000


def test_an_unfinished_file_gives_every_flushed_row_and_is_reported_as_unfinished(
    path: Path,
) -> None:
    rows = some_rows(500)
    write(path, rows, finish=False)
    journal = read_journal(path)
    assert journal.rows.tobytes() == rows.tobytes()
    assert not journal.damage.finished
    assert "not closed" in journal.damage.notes[0]


def test_a_truncated_file_loses_at_most_its_last_block(path: Path, whole: bytes) -> None:
    rows = some_rows()
    bytes_per_row = len(whole) / ROWS
    for cut in random.Random(3).sample(range(len(whole) - 1), 300):
        path.write_bytes(whole[:cut])
        try:
            journal = read_journal(path)
        except RecordingError:
            assert cut < 3 * ROWS_PER_FLUSH * bytes_per_row
            continue
        assert not journal.damage.finished
        assert journal.rows.tobytes() == rows[: len(journal.rows)].tobytes()
        assert len(journal.rows) >= min(ROWS, cut / bytes_per_row - 2 * ROWS_PER_FLUSH)


def test_a_flipped_bit_never_changes_a_number_or_hides_a_loss(path: Path, whole: bytes) -> None:
    rows = some_rows()
    for bit in random.Random(4).sample(range(8 * len(whole)), 300):
        damaged = bytearray(whole)
        damaged[bit // 8] ^= 1 << bit % 8
        path.write_bytes(damaged)
        journal = read_journal(path)
        kept = journal.rows["cycle"].astype(int)
        assert journal.header == HEADER
        assert journal.rows.tobytes() == rows[kept].tobytes()
        assert len(kept) >= 0.99 * ROWS
        if len(kept) < ROWS:
            assert journal.damage.rows_lost == ROWS - len(kept) or not journal.damage.finished
            assert journal.damage.notes


def test_lost_rows_are_reported(path: Path, whole: bytes) -> None:
    at = whole.index(some_rows()[650].tobytes())
    damaged = bytearray(whole)
    damaged[at + 40] ^= 0xFF
    path.write_bytes(damaged)
    damage = read_journal(path).damage
    assert damage.gaps == ((650, 13),)
    assert damage.bad_chunks == 1
    assert damage.notes[0] == "rows 650 to 662 are lost (13 rows)"


def test_trailing_zeros_are_ignored(path: Path, whole: bytes) -> None:
    path.write_bytes(whole[: len(whole) // 2] + bytes(len(whole) // 2))
    journal = read_journal(path)
    assert journal.rows.tobytes() == some_rows()[: len(journal.rows)].tobytes()
    assert not journal.damage.finished


@settings(max_examples=60)
@given(st.binary(max_size=2000))
def test_garbage_is_refused(tmp_path_factory: pytest.TempPathFactory, garbage: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "garbage.mcap"
    path.write_bytes(garbage)
    with pytest.raises(RecordingError) as caught:
        read_journal(path)
    assert caught.value.refusal in ("RID-RECORDING-DAMAGED", "RID-RECORDING-EMPTY")
    assert "garbage.mcap" in str(caught.value)


def test_a_file_that_is_not_a_journal_is_refused_with_its_name(path: Path) -> None:
    with raises_code(RecordingError, "RID-FILE-READ", "recording.mcap"):
        read_journal(path)
    path.write_bytes(b"")
    with raises_code(RecordingError, "RID-RECORDING-DAMAGED", "empty"):
        read_journal(path)
    path.write_text("time,position\n0,1\n")
    with raises_code(RecordingError, "RID-RECORDING-EMPTY"):
        read_journal(path)


def test_an_unreadable_disk_is_an_error(tmp_path: Path) -> None:
    # reading the first page of this regular file fails with an input/output error
    unreadable = Path("/proc/self/mem")
    with raises_code(RecordingError, "RID-FILE-READ", "/proc/self/mem", "Input/output"):
        read_journal(unreadable)
    with raises_code(RecordingError, "RID-FILE-READ"):
        read_journal(tmp_path)


def test_a_recording_is_never_overwritten(path: Path) -> None:
    path.write_bytes(b"x")
    with raises_code(RecordingError, "RID-OUTPUT-EXISTS"):
        JournalWriter(path, HEADER)


@pytest.fixture
def small_disk() -> Iterator[None]:
    """Limit the size of files to 200 kB."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, hard))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


@pytest.mark.usefixtures("small_disk")
def test_a_full_disk_is_an_error_and_the_written_rows_stay_readable(path: Path) -> None:
    rows = some_rows()
    with raises_code(RecordingError, "RID-RECORDING-LOST", f"{path}: ", os.strerror(errno.EFBIG)):
        write(path, rows)
    journal = read_journal(path)
    assert len(journal.rows) > 400
    assert journal.rows.tobytes() == rows[: len(journal.rows)].tobytes()
