"""Repair of damaged journals: no number is wrong, no loss is hidden, and few rows are lost."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from acquisition.journal.cycle_row import row_struct
from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.mcap_reader import JournalDamage
from acquisition.journal.mcap_writer import is_being_written
from acquisition.journal.monitor import MonitorHeader, MonitorWriter, read_monitor
from acquisition.session.cycle_recorder import run_recorder
from acquisition.session.repair import Repair, examine_journal, repair_journal
from acquisition.task.control_block import ControlBlock
from acquisition.task.ring import Ring
from acquisition.task.states import TaskState
from benchmarks.recover import HEADER, KILLED, invented_rows
from config.errors import RecordingError
from config.process.termination import TERMINATION
from drivers.interfaces.drive_monitor import MonitorReading
from tests.builders.raised_codes import raises_code

ROWS = 4000
KILLS = 3
CUTS, FLIPS = 200, 25  # number of tests; benchmarks.recover makes 1000 of each
ROWS_BETWEEN_FLUSHES = 12


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    return invented_rows(ROWS)


@pytest.fixture(scope="module")
def whole(rows: np.ndarray, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The bytes of a file that the recorder's main function has written."""
    path = tmp_path_factory.mktemp("real") / "recording.mcap"
    ring, control = Ring.create(3, ROWS), ControlBlock.create()
    layout = row_struct(3)
    for row in rows:
        assert ring.write(layout.unpack(row.tobytes()))
    control.task.state = TaskState.FINISHED
    before = {number: signal.getsignal(number) for number in TERMINATION}
    run_recorder(ring, control, path, HEADER, os.getppid())
    for number, handler in before.items():
        signal.signal(number, handler)
    return path.read_bytes()


@dataclass
class Damaged:
    """Write damaged bytes, repair the file, and check the conditions that every repair must
    meet.
    """

    folder: Path
    rows: np.ndarray

    def repair(self, data: bytes) -> tuple[int, int]:
        """Return the numbers of kept and of reported lost rows; (0, 0) if nothing is readable."""
        source, target = self.folder / "old.mcap", self.folder / "new.mcap"
        target.unlink(missing_ok=True)
        source.write_bytes(data)
        try:
            repair = repair_journal(source, target)
        except RecordingError:
            assert not target.exists()
            return 0, 0
        assert source.read_bytes() == data
        journal = read_journal(target)
        kept = journal.rows["cycle"].astype(int)
        assert journal.rows.tobytes() == self.rows[kept].tobytes()
        assert journal.header == HEADER
        assert journal.damage.finished
        assert len(kept) == repair.kept_rows
        # a row is kept, reported as lost, or follows the last row of a truncated file
        assert len(kept) + repair.lost_rows == ROWS or not repair.damage.finished
        assert repair.whole == (len(kept) == ROWS and repair.damage.finished)
        return len(kept), repair.lost_rows


@pytest.fixture
def repairer(tmp_path: Path, rows: np.ndarray) -> Damaged:
    return Damaged(tmp_path, rows)


def read_only(path: Path, data: bytes) -> int:
    """Return the number of readable rows of a damaged file; 0 if the file is refused."""
    path.write_bytes(data)
    try:
        return examine_journal(path).kept_rows
    except RecordingError:
        return 0


@pytest.mark.fault(25)
def test_a_truncated_file_gives_every_row_before_the_cut(
    repairer: Damaged, whole: bytes, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    ends = [whole.index(row.tobytes()) + row.nbytes for row in repairer.rows]
    cuts = random.Random(3).sample(range(len(whole)), CUTS)
    expected = kept = 0
    for number, cut in enumerate(cuts):
        written = int(np.searchsorted(ends, cut, side="right"))
        if number % 25:
            found = read_only(tmp_path / "cut.mcap", whole[:cut])
        else:
            found, _ = repairer.repair(whole[:cut])
        assert found <= written
        expected, kept = expected + written, kept + found
    assert kept >= 0.99 * expected
    measured(f"{kept / expected:.2%} of the rows before the cut read in {CUTS} cut files, 0 wrong")


@pytest.mark.fault(25)
def test_a_flipped_bit_changes_no_number_and_hides_no_loss(
    repairer: Damaged, whole: bytes, measured: Callable[[str], None]
) -> None:
    fewest = ROWS
    for bit in random.Random(4).sample(range(8 * len(whole)), FLIPS):
        data = bytearray(whole)
        data[bit // 8] ^= 1 << bit % 8
        kept, _ = repairer.repair(bytes(data))
        fewest = min(fewest, kept)
    assert fewest >= 0.99 * ROWS
    measured(f"at least {fewest / ROWS:.2%} of the rows read after a flipped bit, 0 wrong")


@pytest.mark.fault(25)
@pytest.mark.parametrize("kill", range(KILLS))
def test_a_killed_writer_loses_no_flushed_row(
    kill: int, tmp_path: Path, measured: Callable[[str], None]
) -> None:
    path = tmp_path / "killed.mcap"
    words = [sys.executable, "-c", KILLED, str(path), HEADER.model_dump_json()]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as writer:
        assert writer.stdout is not None
        for _ in range(7 + 11 * kill):
            flushed = int(writer.stdout.readline())
        assert is_being_written(path)
        writer.kill()
        flushed = int([flushed, *writer.stdout][-1])
    assert not is_being_written(path)
    repair = repair_journal(path, tmp_path / "new.mcap")
    rows = read_journal(tmp_path / "new.mcap").rows
    assert rows["cycle"].tolist() == list(range(repair.kept_rows))
    assert (rows["position"] == rows["cycle"][:, np.newaxis] + 0.25).all()
    assert repair.kept_rows >= flushed
    assert repair.lost_rows == 0
    assert not repair.damage.finished
    measured("0 flushed rows lost by kill -9 while writing")


def test_lost_rows_stay_visible_in_the_new_file(
    whole: bytes, rows: np.ndarray, tmp_path: Path
) -> None:
    data = bytearray(whole)
    data[whole.index(rows[1000].tobytes()) + 30] ^= 1
    (tmp_path / "old.mcap").write_bytes(data)
    repair = repair_journal(tmp_path / "old.mcap", tmp_path / "new.mcap", "01NEW")
    assert repair.lost_rows > 1
    assert repair.lost_s == pytest.approx(repair.lost_rows * 0.008)
    assert f"lost {repair.lost_rows} rows" in repair.sentences[0]
    again = read_journal(tmp_path / "new.mcap")
    assert again.header.run_id == "01NEW"
    assert again.damage.gaps == repair.damage.gaps
    assert again.damage.finished
    with (tmp_path / "new.mcap").open("rb") as file:
        messages = [m for _, _, m in make_reader(file, validate_crcs=True).iter_messages()]
    assert len(messages) == repair.kept_rows


def test_a_file_of_the_drive_monitor_is_repaired(tmp_path: Path) -> None:
    header = MonitorHeader(joint_names=("a", "b"), period_s=1.0)
    with MonitorWriter(tmp_path / "old.mcap", header) as writer:
        for second in range(20):
            kelvin = np.array([300.0 + second, 301.0])
            writer.append(float(second), MonitorReading(kelvin, np.array([1.0, 2.0]), ()))
        writer.abandon()
    data = (tmp_path / "old.mcap").read_bytes()
    (tmp_path / "old.mcap").write_bytes(data[:-30])
    repair = repair_journal(tmp_path / "old.mcap", tmp_path / "new.mcap")
    assert repair.kept_rows >= 19
    stream = read_monitor(tmp_path / "new.mcap")
    assert stream.temperature_k[:, 0].tolist() == [300.0 + i for i in range(repair.kept_rows)]
    assert stream.notes == ()


@pytest.fixture
def file_without_header(tmp_path: Path, whole: bytes) -> Path:
    """A file in which both copies of the header are damaged."""
    data = bytearray(whole)
    at = whole.index(b"axis1")
    data[at] ^= 1
    data[whole.index(b"axis1", at + 100)] ^= 1
    path = tmp_path / "unheaded.mcap"
    path.write_bytes(data)
    return path


def test_rows_without_a_header_are_refused_and_no_file_is_written(
    file_without_header: Path,
) -> None:
    target = file_without_header.with_name("new.mcap")
    with raises_code(RecordingError, "RID-RECORDING-FOREIGN"):
        repair_journal(file_without_header, target)
    assert not target.exists()


def test_a_file_is_reported_as_being_written_until_it_is_closed(tmp_path: Path) -> None:
    path = tmp_path / "open.mcap"
    with JournalWriter(path, HEADER):
        assert is_being_written(path)
    assert not is_being_written(path)


def test_the_rows_of_a_torn_end_are_named_in_separate_words() -> None:
    damage = JournalDamage(finished=False, gaps=(), bad_chunks=0, torn_bytes=900)
    repair = Repair(10, 0, 0.1, 0.0, 3.0, damage)
    assert "allrows" not in " ".join(repair.sentences)
