"""Snapshot of the axes in a file: a reader gets a complete snapshot or none."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np

from config.errors import TransportError
from mock_hw.plant.snapshot import SnapshotReader, SnapshotWriter
from tests.builders.raised_codes import raises_code


def test_a_snapshot_is_read_as_written(tmp_path: Path) -> None:
    writer = SnapshotWriter(tmp_path / "axes", 2)
    writer.write(1.5, [1.0, 2.0], [3.0, 4.0], [5.0, 6.0], [True, False], [300.0, 310.0])
    with SnapshotReader(tmp_path / "axes") as reader:
        snapshot = reader.read()
    assert snapshot.time_s == 1.5
    np.testing.assert_array_equal(snapshot.position, [1.0, 2.0])
    np.testing.assert_array_equal(snapshot.velocity, [3.0, 4.0])
    np.testing.assert_array_equal(snapshot.torque, [5.0, 6.0])
    np.testing.assert_array_equal(snapshot.enabled, [True, False])
    np.testing.assert_array_equal(snapshot.temperature_k, [300.0, 310.0])


def test_a_payload_can_be_set_by_another_process(tmp_path: Path) -> None:
    writer = SnapshotWriter(tmp_path / "axes", 2)
    assert writer.payload == 0
    with SnapshotReader(tmp_path / "axes") as reader:
        reader.request_payload(3)
    assert writer.payload == 3


WRITER = """
import sys
from pathlib import Path
from mock_hw.plant.snapshot import SnapshotWriter
writer = SnapshotWriter(Path(sys.argv[1]), 3)
print("ready", flush=True)
number = 0.0
while True:
    number += 1.0
    writer.write(number, *([number] * 3 for _ in range(3)), [True] * 3, [number] * 3)
"""


def test_a_snapshot_is_never_a_mixture_of_two(tmp_path: Path) -> None:
    path = tmp_path / "axes"
    words = [sys.executable, "-c", WRITER, str(path)]
    with subprocess.Popen(words, stdout=subprocess.PIPE) as writer:
        try:
            assert writer.stdout is not None
            assert writer.stdout.readline() == b"ready\n"
            with SnapshotReader(path) as reader:
                for _ in range(100_000):
                    snapshot = reader.read()
                    rows = (snapshot.position, snapshot.velocity, snapshot.torque)
                    assert {len(row) for row in rows} == {3}
                    assert {snapshot.time_s, *rows[0], *rows[1], *rows[2]} == {snapshot.time_s}
        finally:
            writer.kill()


def test_a_missing_file_is_an_error_with_its_name(tmp_path: Path) -> None:
    with raises_code(TransportError, "RID-MOCK-NOT-SERVED", "nothing-here"):
        SnapshotReader(tmp_path / "nothing-here")
