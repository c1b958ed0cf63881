"""Arrays that are stored on disk are read back unchanged."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numpy as np
import pytest

from acquisition.processing.block_file import BlockFile
from config.errors import RecordingError
from tests.builders.raised_codes import raises_code


def test_arrays_are_read_by_number_and_can_be_replaced() -> None:
    blocks = BlockFile((3, 2))
    values = {number: np.random.default_rng(number + 9).normal(size=(3, 2)) for number in (4, -1)}
    for number, array in values.items():
        blocks[number] = np.zeros((3, 2))
        blocks[number] = array
    assert list(blocks) == [4, -1]
    for number, array in values.items():
        np.testing.assert_array_equal(blocks[number], array)
        np.testing.assert_array_equal(blocks.rows(number, slice(1, 9)), array[1:])
    np.testing.assert_array_equal(blocks[0], np.zeros((3, 2)))


def test_no_file_is_left_on_the_disk(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    blocks = BlockFile((3, 2))
    blocks[0] = np.ones((3, 2))
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_an_error_that_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    blocks = BlockFile((3, 2))
    monkeypatch.setattr(os, "pwrite", lambda *_: 7)
    with raises_code(RecordingError, "RID-SYSTEM-DISK-FULL"):
        blocks[0] = np.ones((3, 2))
