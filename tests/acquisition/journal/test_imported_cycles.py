"""Imported recordings are stored without loss, with and without velocity commands."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal, write_imported
from acquisition.recording.recording import Recording

ROWS = 30


@pytest.fixture
def recording() -> Recording:
    random = np.random.default_rng(5)
    return Recording(
        joint_names=("a", "b"),
        time_s=0.01 * np.arange(ROWS, dtype=np.float64),
        position=random.standard_normal((ROWS, 2)),
        torque_nm=random.standard_normal((ROWS, 2)),
        valid=np.ones(ROWS, dtype=np.bool_),
        phase=np.full(ROWS, 3, dtype=np.uint8),
        sample_index=np.arange(ROWS),
        source="import",
        sample_period_s=0.01,
        samples_per_period=10,
        velocity_command=random.standard_normal((ROWS, 2)),
        run_id="01J",
    )


def test_velocity_commands_are_read_as_written(tmp_path: Path, recording: Recording) -> None:
    write_imported(tmp_path / "cycles.mcap", recording)
    read = read_journal(tmp_path / "cycles.mcap").recording()
    for name in ("time_s", "position", "torque_nm", "velocity_command"):
        assert np.array_equal(getattr(read, name), getattr(recording, name)), name


def test_rows_without_commands_have_none(tmp_path: Path, recording: Recording) -> None:
    write_imported(tmp_path / "cycles.mcap", replace(recording, velocity_command=None))
    journal = read_journal(tmp_path / "cycles.mcap")
    assert "velocity_command" not in (journal.rows.dtype.names or ())
    assert journal.recording().velocity_command is None
