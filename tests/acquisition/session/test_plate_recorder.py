"""Plate recorder on the simulated amplifier: recorded and lost rows, errors, and its file."""

from __future__ import annotations

import math
import os
import random
from collections.abc import Callable
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from acquisition.journal.plate import (
    EVENT_DTYPE,
    LINE_LOST,
    LINE_RESTORED,
    ROW_DTYPE,
    PlateHeader,
    PlateJournalWriter,
    PlateRows,
    read_plate_journal,
)
from acquisition.session.plate_block import PlateBlock, PlateState
from acquisition.session.plate_recorder import PlateTask, run_plate_recorder
from config.errors import DeviceFaultError, RecordingError, RidDaqError, TransportError
from config.simulation.faults import AmplifierFault
from drivers.amplifier.amplifier import open_amplifier
from drivers.amplifier.frames import PLATE_EVENT, PLATE_ROW
from drivers.interfaces.force_plate import PlateRead
from tests.builders.raised_codes import raises_code

Serve = Callable[..., Any]
ROWS = 1000


@pytest.fixture(autouse=True)
def patience(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("acquisition.session.plate_recorder.leave_terminal", lambda: None)
    monkeypatch.setattr("drivers.amplifier.dialogue.ANSWER_TIMEOUT_S", 20.0)
    monkeypatch.setattr("drivers.amplifier.dialogue.BAUD_RATES", ())
    monkeypatch.setattr("acquisition.session.plate_recorder.STOP_PATIENCE_S", 20.0)
    monkeypatch.setattr("acquisition.session.plate_recorder.RETRY_S", 0.0)
    monkeypatch.setattr("acquisition.session.plate_recorder.RETRY_PATIENCE_S", 60.0)


def prepare_amplifier(served: Any) -> None:
    with open_amplifier(served.plate.amplifier, served.profile) as amplifier:
        amplifier.connect()
        amplifier.configure()
        amplifier.reset()
        amplifier.operate()


def record(served: Any, path: Path, *, parent: int | None = None, ends: bool = True) -> PlateBlock:
    """Record until the amplifier's stream ends, or if `ends` is False until an error."""
    block = PlateBlock.create()
    if ends:
        served.on_end = block.request_stop
    task = PlateTask(served.plate, served.profile, path, cell_name="cell", run_id="01J")
    run_plate_recorder(task, block, os.getppid() if parent is None else parent)
    return block


def record_rows(served: Any, tmp_path: Path) -> tuple[PlateRows, PlateBlock]:
    prepare_amplifier(served)
    block = record(served, tmp_path / "plate.mcap")
    assert block.error is None
    assert block.state is PlateState.FINISHED
    return read_plate_journal(tmp_path / "plate.mcap"), block


@pytest.mark.parametrize("form", ["binary", "ascii"])
def test_every_row_is_recorded_with_its_times(
    serve_amplifier: Serve, tmp_path: Path, form: str
) -> None:
    rows, block = record_rows(serve_amplifier(format=form, baud_rate=921600), tmp_path)
    assert rows.sequence.tolist() == list(range(ROWS))
    assert np.allclose(np.diff(rows.device_s), 0.001, atol=2e-6)
    assert np.all(np.diff(rows.arrival_s) >= 0.0)
    assert (rows.rows_lost, rows.damage.notes, rows.header.simulated_time) == (0, (), True)
    assert rows.operating.all()
    assert not rows.overload.any()
    assert rows.header.identity.startswith("rid-daq,simulated")
    np.testing.assert_allclose(rows.channels_n, rows.rows["force_n"], rtol=1e-6)
    status = block.status(0.0)
    assert (status.rows, status.rows_lost, status.overloaded_rows) == (ROWS, 0, 0)
    np.testing.assert_allclose(status.force_max_n, np.abs(rows.channels_n).max(axis=0), rtol=1e-6)
    np.testing.assert_allclose(status.force_n, rows.channels_n[-1], rtol=1e-6)


def test_the_same_seed_gives_the_same_file(serve_amplifier: Serve, tmp_path: Path) -> None:
    rows = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        rows.append(record_rows(serve_amplifier(), tmp_path / name)[0].rows)
    assert rows[0].tobytes() == rows[1].tobytes()


def test_corrupted_bytes_lose_only_the_rows_that_they_hit_and_are_counted(
    serve_amplifier: Serve, tmp_path: Path
) -> None:
    clean, _ = record_rows(serve_amplifier(), tmp_path)
    faults = (
        AmplifierFault(kind="garbage", row=100, count=300),
        AmplifierFault(kind="nuls", row=200, count=5000),
        AmplifierFault(kind="lost_bytes", row=300, count=5),
        AmplifierFault(kind="torn_row", row=400, count=2),
        AmplifierFault(kind="gap", row=500, count=7),
        AmplifierFault(kind="bad_checksum", row=600, count=3),
    )
    (tmp_path / "dirty").mkdir()
    dirty, block = record_rows(serve_amplifier(*faults), tmp_path / "dirty")
    lost = {300, 400, 401, *range(500, 507), 600, 601, 602}
    assert sorted(set(range(ROWS)) - set(dirty.sequence.tolist())) == sorted(lost)
    assert dirty.rows["counts"].tolist() == clean.rows["counts"][dirty.sequence].tolist()
    assert dirty.rows_lost == block.status(0.0).rows_lost == len(lost)
    assert block.status(0.0).garbage_bytes > 5300
    assert block.status(0.0).bad_frames >= 3


def test_every_overloaded_row_is_flagged(
    serve_amplifier: Serve, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A slow computer would clear the flag during the overload, which then causes a second event.
    monkeypatch.setattr("acquisition.session.plate_recorder.OVERLOAD_PERIOD_S", math.inf)
    fault = AmplifierFault(kind="overload", row=500, duration_s=0.1, channel=5)
    rows, block = record_rows(serve_amplifier(fault), tmp_path)
    full = np.abs(rows.rows["counts"].astype(int)) >= 32767
    assert full[:, 5].any()
    assert not full[:, [0, 1, 2, 3, 4, 6, 7]].any()
    assert np.all(rows.overload[full])
    assert block.status(0.0).overloads == (False,) * 5 + (True, False, False)
    (event,) = rows.of_kind("overload")
    assert int(event["detail"]) == 1 << 5


def test_after_a_replug_the_recording_continues_as_a_new_stream(
    serve_amplifier: Serve, tmp_path: Path
) -> None:
    served = serve_amplifier(AmplifierFault(kind="unplug", row=5000, duration_s=0.2))
    # more than the system buffers; the buffer is lost when the plate is unplugged
    served.stream_s = 6.0
    rows, block = record_rows(served, tmp_path)
    assert np.unique(rows.stream).tolist() == [0, 1]
    assert [int(event["kind"]) for event in rows.events if event["kind"] > 255] == [
        LINE_LOST,
        LINE_RESTORED,
    ]
    assert block.status(0.0).losses == 1
    assert rows.damage.finished


def test_a_line_that_stays_disconnected_is_an_error(
    serve_amplifier: Serve, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("acquisition.session.plate_recorder.RETRY_PATIENCE_S", 0.05)
    served = serve_amplifier(AmplifierFault(kind="unplug", row=5000, duration_s=1e5))
    served.stream_s = 6.0
    prepare_amplifier(served)
    block = record(served, tmp_path / "plate.mcap", ends=False)
    assert isinstance(block.error, TransportError)
    assert block.error.refusal == "RID-AMPLIFIER-SILENT"


def test_an_incomplete_file_is_an_error(
    serve_amplifier: Serve, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(PlateJournalWriter, "trouble", "was deleted")
    served = serve_amplifier()
    prepare_amplifier(served)
    block = record(served, tmp_path / "plate.mcap")
    assert isinstance(block.error, RecordingError)
    assert block.error.refusal == "RID-RECORDING-LOST"


def test_an_amplifier_in_reset_is_refused(serve_amplifier: Serve, tmp_path: Path) -> None:
    served = serve_amplifier()
    with open_amplifier(served.plate.amplifier, served.profile) as amplifier:
        amplifier.connect()
        amplifier.configure()
    block = record(served, tmp_path / "plate.mcap")
    assert block.state is PlateState.FAILED
    assert isinstance(block.error, DeviceFaultError)
    assert block.error.refusal == "RID-PLATE-NOT-ZEROED"
    assert not (tmp_path / "plate.mcap").exists()


def test_an_amplifier_that_goes_into_reset_ends_the_recording(
    serve_amplifier: Serve, tmp_path: Path
) -> None:
    served = serve_amplifier(AmplifierFault(kind="reset", row=500))
    prepare_amplifier(served)
    block = record(served, tmp_path / "plate.mcap", ends=False)
    assert block.state is PlateState.FAILED
    assert isinstance(block.error, DeviceFaultError)
    assert block.error.refusal == "RID-PLATE-NOT-ZEROED"
    rows = read_plate_journal(tmp_path / "plate.mcap")
    assert int(np.argmin(rows.operating)) >= 500


def test_an_amplifier_with_another_range_is_refused_with_its_name(
    serve_amplifier: Serve, tmp_path: Path
) -> None:
    served = serve_amplifier()
    prepare_amplifier(served)
    other = served.plate.amplifier.model_copy(
        update={"range_n": (2500.0, *served.plate.amplifier.range_n[1:])}
    )
    served.plate = served.plate.model_copy(update={"amplifier": other})
    block = record(served, tmp_path / "plate.mcap")
    assert isinstance(block.error, RidDaqError)
    assert block.error.refusal == "RID-PLATE-NOT-ZEROED"
    assert all(text in str(block.error) for text in ("fx12", "1250 N", "2500 N"))


def test_a_missing_port_is_an_error(serve_amplifier: Serve, tmp_path: Path) -> None:
    served = serve_amplifier()
    gone = served.plate.amplifier.model_copy(update={"address": str(tmp_path / "none")})
    served.plate = served.plate.model_copy(update={"amplifier": gone})
    block = record(served, tmp_path / "plate.mcap")
    assert isinstance(block.error, TransportError)


def test_an_orphaned_recorder_ends(serve_amplifier: Serve, tmp_path: Path) -> None:
    served = serve_amplifier()
    prepare_amplifier(served)
    block = record(served, tmp_path / "plate.mcap", parent=-1)
    assert block.state is PlateState.FINISHED
    assert read_plate_journal(tmp_path / "plate.mcap").damage.finished


def test_a_run_is_never_overwritten(serve_amplifier: Serve, tmp_path: Path) -> None:
    served = serve_amplifier()
    prepare_amplifier(served)
    (tmp_path / "plate.mcap").write_bytes(b"x")
    block = record(served, tmp_path / "plate.mcap")
    assert isinstance(block.error, RecordingError)


def test_the_recorder_runs_as_a_separate_process(serve_amplifier: Serve, tmp_path: Path) -> None:
    served = serve_amplifier()
    prepare_amplifier(served)
    block = PlateBlock.create()
    served.on_end = block.request_stop
    path = tmp_path / "plate.mcap"
    process = get_context("spawn").Process(
        target=run_plate_recorder,
        args=(PlateTask(served.plate, served.profile, path), block, os.getpid()),
    )
    process.start()
    process.join(120.0)
    assert (process.exitcode, block.error) == (0, None)
    assert len(read_plate_journal(path).rows) == block.status(0.0).rows == ROWS


# the file format alone


def header(served: Any) -> PlateHeader:
    return PlateHeader(plate=served.plate, profile=served.profile, run_id="01J")


def plate_read(rows: int, events: int, first: int) -> PlateRead:
    read = np.zeros(rows, dtype=PLATE_ROW)
    read["sequence"] = first + np.arange(rows)
    read["ticks"] = 1000 * read["sequence"]
    read["counts"] = read["sequence"][:, None]
    happened = np.zeros(events, dtype=PLATE_EVENT)
    happened["kind"], happened["detail"] = 4, first
    return PlateRead(read, happened, np.full(rows, 0.001 * first), np.full(events, 0.5), 0.5)


def write(path: Path, head: PlateHeader, *, finish: bool) -> None:
    with PlateJournalWriter(path, head) as writer:
        for first in range(0, 600, 12):
            writer.note_mark_request(first, 0.25)
            writer.append(plate_read(12, 1, first), 0)
            writer.flush()
        if not finish:
            writer.abandon()


def test_a_mark_is_stored_with_the_time_of_its_request(
    serve_amplifier: Serve, tmp_path: Path
) -> None:
    write(tmp_path / "p.mcap", header(serve_amplifier()), finish=True)
    marks = read_plate_journal(tmp_path / "p.mcap").of_kind("mark")
    assert set(marks["asked_s"].tolist()) == {0.25}
    assert set(marks["arrival_s"].tolist()) == {0.5}


def test_other_programs_read_the_same_rows(serve_amplifier: Serve, tmp_path: Path) -> None:
    path = tmp_path / "p.mcap"
    write(path, header(serve_amplifier()), finish=True)
    with path.open("rb") as file:
        messages = list(make_reader(file, validate_crcs=True).iter_messages(topics=["/plate"]))
    schema, channel, _ = messages[0]
    assert schema is not None
    assert (schema.name, channel.message_encoding) == ("rid_daq/msg/Plate", "cdr")
    assert b"float32[8] force_n" in schema.data
    body = b"".join(message.data[4:] for _, _, message in messages)
    assert body == read_plate_journal(path).rows.tobytes()
    for dtype in (ROW_DTYPE, EVENT_DTYPE):  # CDR aligns every number to its size
        for name in dtype.names or ():
            kind, offset = dtype.fields[name][:2]  # type: ignore[index]
            assert offset % kind.base.itemsize == 0


def test_a_truncated_file_gives_every_flushed_row(serve_amplifier: Serve, tmp_path: Path) -> None:
    path = tmp_path / "p.mcap"
    write(path, header(serve_amplifier()), finish=False)
    whole = path.read_bytes()
    assert len(read_plate_journal(path).rows) == 600
    assert not read_plate_journal(path).damage.finished
    for cut in random.Random(2).sample(range(8000, len(whole)), 60):
        path.write_bytes(whole[:cut])
        rows = read_plate_journal(path)
        assert rows.sequence.tolist() == list(range(len(rows.rows)))
        assert len(rows.rows) >= 600 * cut / len(whole) - 60


def test_damaged_chunks_are_skipped_and_reported(serve_amplifier: Serve, tmp_path: Path) -> None:
    path = tmp_path / "p.mcap"
    write(path, header(serve_amplifier()), finish=True)
    data = bytearray(path.read_bytes())
    at = data.index(read_plate_journal(path).rows[300].tobytes())
    data[at + 40] ^= 1
    path.write_bytes(data)
    rows = read_plate_journal(path)
    assert rows.sequence.tolist() == [*range(300), *range(312, 600)]
    assert (rows.damage.bad_chunks, rows.rows_lost) == (1, 12)


def test_a_file_that_is_not_a_plate_recording_is_refused_with_its_name(tmp_path: Path) -> None:
    path = tmp_path / "p.mcap"
    path.write_bytes(b"nonsense")
    with raises_code(RecordingError, "RID-RECORDING-EMPTY", "p.mcap"):
        read_plate_journal(path)


def test_a_block_without_rows_has_no_age() -> None:
    block = PlateBlock.create()
    assert block.status(10.0).age_s == float("inf")
    block.add_rows(np.full((2, 8), -3.0, np.float32), np.array([0, 4], np.uint8), 9.5)
    assert block.status(10.0).age_s == 0.5
    assert block.status(10.0).force_max_n.tolist() == [3.0] * 8
    assert block.status(10.0).overloads == (False, False, True, *[False] * 5)
