"""Import: repeated rows are removed and wrong time stamps rebuilt, and both are reported."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.clock.report import ClockState
from acquisition.imports.read import import_csv
from acquisition.imports.report import ImportReport
from acquisition.maps.import_map import ImportMap, load_import_map
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from config.errors import DataQualityError
from tests.builders.foreign_tables import as_lines, sound_table, two_joint_map

TENTH = np.where(np.arange(1200) % 10 == 9, 2, 1)


def import_table(
    folder: Path, table: FloatArray, import_map: ImportMap | None = None
) -> tuple[Recording, ImportReport]:
    path = folder / "recording.csv"
    path.write_text("\n".join(as_lines(table)))
    return import_csv(path, import_map or two_joint_map())


def repeat_rows(table: FloatArray) -> FloatArray:
    """Return the arm's samples with every tenth row repeated, and with evenly spaced time
    stamps.
    """
    table = np.repeat(table, TENTH, axis=0)
    table[:, 0] = 5.0 + 0.011 * np.arange(len(table))
    return table


def even_table() -> FloatArray:
    table = sound_table(1200)
    turn = np.pi * 0.011 * np.arange(1200)
    motion = np.stack(
        [
            *(np.sin(turn), 0.5 * np.cos(0.7 * turn), np.pi * np.cos(turn)),
            *(-0.35 * np.pi * np.sin(0.7 * turn), 3.0 * np.sin(turn), 4.0 * np.cos(turn)),
        ],
        axis=1,
    )
    table[:, 1:] = motion
    return table


def test_repeated_rows_are_counted_and_removed_and_the_times_rebuilt(tmp_path: Path) -> None:
    table = repeat_rows(even_table())
    recording, report = import_table(tmp_path, table)
    assert report.clock is not None
    assert report.clock.clock is ClockState.REBUILT
    assert report.clock.repeated_rows == 120
    assert report.clock.repeated_share == pytest.approx(1 / 11)
    assert report.rows_used == len(recording) == 1200
    assert report.rows_damaged == 0
    assert "no damaged rows" not in report.lines()
    assert "(9.1 %)" in report.findings[0]
    np.testing.assert_allclose(np.diff(recording.time_s), 0.011, atol=1e-6)


def test_a_sound_recording_keeps_its_stamps_and_has_no_finding(tmp_path: Path) -> None:
    table = even_table()
    table[:, 0] = 5.0 + 0.011 * np.arange(1200)
    recording, report = import_table(tmp_path, table)
    assert report.clock is not None
    assert report.clock.clock is ClockState.CONFIRMED
    assert report.findings == ()
    np.testing.assert_array_equal(recording.time_s, np.round(table[:, 0], 6))


def test_a_row_written_twice_with_its_stamp_is_a_repeat_and_not_damage(
    tmp_path: Path,
) -> None:
    table = even_table()
    table[:, 0] = 5.0 + 0.011 * np.arange(1200)
    recording, report = import_table(tmp_path, np.repeat(table, TENTH, axis=0))
    assert report.clock is not None
    assert report.clock.repeated_rows == 120
    assert report.rows_damaged == 0
    np.testing.assert_array_equal(recording.time_s, np.round(table[:, 0], 6))


def test_jumps_of_a_source_read_four_times_are_plausible(tmp_path: Path) -> None:
    table = np.repeat(even_table()[:400], 4, axis=0)
    table[:, 0] = 0.011 / 4 * np.arange(len(table))  # 0.035 rad within 2.75 ms
    _, report = import_table(tmp_path, table)
    assert report.clock is not None
    assert report.clock.repeated_share == pytest.approx(0.75, abs=0.003)
    assert report.rows_damaged == 0


def test_too_few_updated_rows_are_refused(tmp_path: Path) -> None:
    table = np.repeat(even_table()[:90], 4, axis=0)
    table[:, 0] = 0.011 / 4 * np.arange(len(table))
    with pytest.raises(DataQualityError) as refused:
        import_table(tmp_path, table)
    assert refused.value.refusal == "RID-IMPORT-REPEATED-ROWS"


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["sound", "tenth row twice", "one of eight stale at random"])
def test_repeated_rows_of_a_real_robot_are_found(
    real_robot: Path, tmp_path: Path, kind: str
) -> None:
    file = real_robot / "ur-20_02_10-30sec_12harm.csv"
    table = np.loadtxt(file, delimiter=",")[634:3510]
    true_s, rows = table[:, 0] - table[0, 0], np.arange(len(table))
    stamps = true_s
    if kind == "tenth row twice":
        rows = np.repeat(rows, np.where(rows % 10 == 9, 2, 1))
        stamps = 0.01 * np.arange(len(rows))
    if kind == "one of eight stale at random":
        stale = np.random.default_rng(1).random(len(rows)) < 1 / 8
        rows = np.where(stale, np.maximum(rows - 1, 0), rows)
    made = np.mean(np.diff(rows) == 0)
    table = np.column_stack([stamps, table[rows, 1:]])
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", fmt="%.9g")
    import_map, robot = load_import_map("ur10e_19")
    import_map = import_map.model_copy(update={"columns": table.shape[1]})
    recording, report = import_csv(tmp_path / "run.csv", import_map, robot)
    assert report.clock is not None
    assert report.clock.repeated_share == pytest.approx(made, abs=0.002)
    if kind == "sound":
        assert report.clock.clock is ClockState.CONFIRMED
        np.testing.assert_allclose(recording.time_s, true_s, atol=1e-6)
        return
    assert report.clock.clock is ClockState.REBUILT
    assert report.clock.torque_gain is not None
    assert report.clock.torque_gain > 0.4  # the error of held-out torques falls by a third or more
