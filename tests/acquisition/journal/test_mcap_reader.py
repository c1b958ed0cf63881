"""A growing journal is read in parts; each part begins at the end of the previous part."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.journal import mcap_reader
from acquisition.journal.cycle_reader import CycleReader
from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.header import JournalHeader
from acquisition.journal.mcap_reader import JournalReader, read_raw_journal
from config.errors import RecordingError
from tests.builders.raised_codes import raises_code

HEADER = JournalHeader(joint_names=("a", "b"), sample_period_s=0.01)


def some_rows(count: int) -> np.ndarray:
    rows = np.zeros(count, dtype=row_dtype(2))
    rows["time_s"] = 0.01 * np.arange(count)
    rows["sample_index"] = np.arange(count)
    rows["position"] = np.random.default_rng(1).normal(size=(count, 2))
    return rows


def write(path: Path, rows: np.ndarray) -> None:
    with JournalWriter(path, HEADER) as writer:
        writer.append(rows.tobytes())


def test_rows_written_during_reading_are_read_once(tmp_path: Path) -> None:
    rows, path = some_rows(3000), tmp_path / "r.mcap"
    blocks: list[np.ndarray] = []
    with JournalWriter(path, HEADER) as writer, CycleReader(path) as reader:
        assert list(reader.rows(growing=True)) == []
        for start in range(0, 3000, 500):
            writer.append(rows[start : start + 500].tobytes())
            writer.flush()
            blocks += reader.rows(growing=True)
            assert sum(map(len, blocks)) == start + 500
            assert list(reader.rows(growing=True)) == []
    assert reader.header == HEADER
    np.testing.assert_array_equal(np.concatenate(blocks), rows)


def test_a_half_written_chunk_is_read_when_it_is_complete(tmp_path: Path) -> None:
    write(tmp_path / "whole.mcap", some_rows(1000))
    whole, path = (tmp_path / "whole.mcap").read_bytes(), tmp_path / "r.mcap"
    path.write_bytes(b"")
    numbers: list[int] = []
    with JournalReader(path) as reader, path.open("ab", buffering=0) as file:
        for start in range(0, len(whole), 777):
            file.write(whole[start : start + 777])
            for piece in reader.pieces(growing=True):
                numbers += piece.sequences
        assert reader.damage().finished
    assert numbers == list(range(1000))


@settings(max_examples=30)
@given(piece=st.integers(1, 60_000), cut=st.integers(0, 40_000), harm=st.integers(0, 60_000))
def test_pieces_of_any_size_give_the_same_rows(
    tmp_path_factory: pytest.TempPathFactory, piece: int, cut: int, harm: int
) -> None:
    path = tmp_path_factory.mktemp("pieces") / "r.mcap"
    write(path, some_rows(300))
    data = bytearray(path.read_bytes())
    data = data[: max(len(data) - cut, 1)]
    data[harm % len(data)] ^= 0xFF
    path.write_bytes(data)
    whole = read_raw_journal(path)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(mcap_reader, "PIECE_BYTES", max(piece, 1000))
        parts = read_raw_journal(path)
    assert (parts.sequences, parts.payloads) == (whole.sequences, whole.payloads)
    assert parts.damage == whole.damage


def test_time_that_goes_back_between_two_pieces_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = some_rows(1000)
    rows["time_s"][900:] -= 5.0
    write(tmp_path / "r.mcap", rows)
    monkeypatch.setattr(mcap_reader, "PIECE_BYTES", 10_000)
    with (
        CycleReader(tmp_path / "r.mcap") as reader,
        raises_code(RecordingError, "RID-RECORDING-CLOCK"),
    ):
        list(reader.recordings())
    with raises_code(RecordingError, "RID-RECORDING-CLOCK"):
        read_journal(tmp_path / "r.mcap").recording()
