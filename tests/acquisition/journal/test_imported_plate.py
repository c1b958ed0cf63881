"""Readings of an imported force plate are stored without loss."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.imported_plate import read_imported_plate, write_imported_plate
from acquisition.recording.plate_geometry import WRENCH_NAMES
from acquisition.recording.reaction import Reaction
from config.cell.torque_filter import ButterworthFilter
from config.errors import RecordingError
from tests.builders.raised_codes import raises_code

RUN = "01M8FBPNY744RHWHGCP4CFPHBD"
ROWS = 50


@pytest.fixture
def reaction() -> Reaction:
    random = np.random.default_rng(1)
    return Reaction(
        channel_names=WRENCH_NAMES,
        channels_n=random.standard_normal((ROWS, 6)),
        valid=random.uniform(size=(ROWS, 6)) > 0.2,
        base_wrench_matrix=random.standard_normal((6, 6)),
        low_pass=ButterworthFilter(order=2, cutoff_hz=200.0),
        drift_limit_n_s=0.5,
    )


@pytest.fixture
def path(tmp_path: Path, reaction: Reaction) -> Path:
    file = tmp_path / "plate.mcap"
    write_imported_plate(file, reaction, 0.008 * np.arange(ROWS, dtype=np.float64), RUN)
    return file


def test_reading_returns_the_same_bits(path: Path, reaction: Reaction) -> None:
    read = read_imported_plate(path, ROWS, RUN)
    for name in ("channels_n", "valid", "base_wrench_matrix"):
        assert np.array_equal(getattr(read, name), getattr(reaction, name)), name
    for name in ("channel_names", "low_pass", "drift_limit_n_s"):
        assert getattr(read, name) == getattr(reaction, name), name


def test_the_plate_of_another_run_is_refused(path: Path) -> None:
    with raises_code(RecordingError, "RID-RUN-MIXED"):
        read_imported_plate(path, ROWS, "another")


def test_a_plate_with_another_number_of_rows_is_refused(path: Path) -> None:
    with raises_code(RecordingError, "RID-RECORDING-DAMAGED", f"{ROWS} rows for {ROWS + 1}"):
        read_imported_plate(path, ROWS + 1, RUN)


def test_a_recording_of_another_kind_is_refused(tmp_path: Path) -> None:
    other = tmp_path / "plate.mcap"
    other.write_bytes(b"\x89MCAP0\r\n" + bytes(100))
    with raises_code(RecordingError, "RID-RECORDING-EMPTY"):
        read_imported_plate(other, ROWS, RUN)
