"""Import: rows with a stuck position, or without a torque, are removed."""

from __future__ import annotations

import numpy as np
import pytest

from acquisition.imports.columns import ImportRows
from acquisition.imports.report import DamagedRow
from acquisition.imports.soundness import drop_unsound_rows
from config.arrays import FloatArray
from tests.builders.foreign_tables import two_joint_map

ROWS = 2000


def moving_rows(second: FloatArray) -> ImportRows:
    """Return rows every 4 ms: the first joint moves, the second has the given positions (rad)."""
    time_s = 0.004 * np.arange(ROWS, dtype=np.float64)
    first = 0.5 * np.sin(2.0 * time_s)
    torque = np.column_stack([np.cos(3.0 * time_s), np.cos(5.0 * time_s)])
    nothing = np.zeros((ROWS, 0))
    position = np.column_stack([first, second])
    speed = np.zeros_like(position)
    return ImportRows(np.arange(ROWS), time_s, position, speed, torque, nothing, nothing)


def test_rows_with_a_stuck_position_are_removed() -> None:
    second = 0.4 * np.sin(1.5 * 0.004 * np.arange(ROWS))
    second[800:950] = second[800]
    damaged: list[DamagedRow] = []
    sound, _ = drop_unsound_rows(moving_rows(second), two_joint_map(), damaged)
    assert {each.reason for each in damaged} == {"with a stuck position"}
    assert [each.row for each in damaged] == list(range(801, 950))
    assert len(sound.row) == ROWS - 149


@pytest.mark.parametrize("digits", [2, 4, 12])
def test_rows_at_rest_are_kept(digits: int) -> None:
    """A joint rests and starts again, also with rounded positions."""
    moved_s = np.clip(0.004 * np.arange(ROWS) - 3.2, 0.0, None)
    second = np.round(0.4 * (1.0 - np.cos(moved_s)), digits)
    damaged: list[DamagedRow] = []
    assert len(drop_unsound_rows(moving_rows(second), two_joint_map(), damaged)[0].row) == ROWS
    assert not damaged


def test_a_position_that_is_rounded_to_few_values_is_kept() -> None:
    second = np.round(0.4 * np.sin(0.3 * 0.004 * np.arange(ROWS)), 1)
    damaged: list[DamagedRow] = []
    drop_unsound_rows(moving_rows(second), two_joint_map(), damaged)
    assert "with a stuck position" not in {each.reason for each in damaged}


@pytest.mark.parametrize("value", [0.0, 90.0])
def test_rows_without_a_torque_are_removed(value: float) -> None:
    """A source writes a fixed number if it has no value; the torque then jumps for one row."""
    rows = moving_rows(0.4 * np.sin(1.5 * 0.004 * np.arange(ROWS)))
    missing = np.arange(37, ROWS, 100)
    missing = missing[np.abs(rows.torque[missing, 1]) > 0.5]
    rows.torque[missing, 1] = value
    damaged: list[DamagedRow] = []
    sound, _ = drop_unsound_rows(rows, two_joint_map(), damaged)
    assert [(each.row, each.reason) for each in damaged] == [
        (row, "whose torque is missing") for row in missing.tolist()
    ]
    assert len(sound.row) == ROWS - len(missing)


@pytest.mark.parametrize("resolution", [0.1, 0.03, 0.01])
def test_a_noisy_torque_and_its_reversals_are_kept(resolution: float) -> None:
    rows = moving_rows(0.4 * np.sin(1.5 * 0.004 * np.arange(ROWS)))
    noise = np.random.default_rng(1).normal(size=ROWS)
    torque = np.sign(np.sin(0.5 * rows.time_s)) + 0.3 * noise
    rows.torque[:, 1] = resolution * np.round(torque / resolution)
    damaged: list[DamagedRow] = []
    assert len(drop_unsound_rows(rows, two_joint_map(), damaged)[0].row) == ROWS
