"""Recordings can be read as PlotJuggler and Foxglove read them: with the plain mcap reader and the
schemas in the file.

The decoder below knows CDR and ros2msg definitions, and nothing of this project.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter, write_imported
from acquisition.journal.header import JournalHeader
from acquisition.recording.recording import Recording
from config.cell.torque_filter import ButterworthFilter

CODES = {
    "float64": "d", "float32": "f", "int64": "q", "uint64": "Q", "int32": "i", "uint32": "I",
    "int16": "h", "uint16": "H", "int8": "b", "uint8": "B", "bool": "?",
}  # fmt: skip


def decode(definition: str, data: bytes) -> dict[str, Any]:
    """Decode a message: little-endian CDR, every primitive aligned to its size."""
    assert data[:2] == b"\x00\x01", "CDR, little endian"
    body, place, values = data[4:], 0, {}
    for line in definition.splitlines():
        text = line.split("#")[0].strip()
        if not text or "=" in text:
            continue
        match = re.fullmatch(r"(\w+)(?:\[(\d+)\])?\s+(\w+)", text)
        assert match is not None, f"not a field: {line}"
        kind, count, name = match.groups()
        code = CODES[kind]
        size = struct.calcsize(code)
        place += -place % size
        items = struct.unpack_from(f"<{count or 1}{code}", body, place)
        place += size * int(count or 1)
        values[name] = list(items) if count else items[0]
    assert place == len(body), "the message is longer than its definition"
    return values


def test_the_plain_reader_decodes_a_recording(tmp_path: Path) -> None:
    header = JournalHeader(
        joint_names=("axis1", "axis2", "axis3"),
        sample_period_s=0.008,
        samples_per_period=100,
        torque_filter=ButterworthFilter(order=8, cutoff_hz=40.0),
        cell_name="cell",
        robot_name="arm",
        run_id="01J",
    )
    rows = np.zeros(50, dtype=row_dtype(3))
    rng = np.random.default_rng(2)
    for name in rows.dtype.names or ():
        field = rows[name]
        field[...] = rng.integers(0, 100, field.shape)
    rows["time_s"] = 0.008 * np.arange(50)
    path = tmp_path / "recording.mcap"
    with JournalWriter(path, header) as writer:
        writer.append(rows.tobytes())
    with path.open("rb") as file:
        messages = list(make_reader(file, validate_crcs=True).iter_messages())
    assert len(messages) == 50
    for row, (schema, channel, message) in zip(rows, messages, strict=True):
        assert schema is not None
        assert (schema.encoding, channel.message_encoding) == ("ros2msg", "cdr")
        values = decode(schema.data.decode(), message.data)
        assert set(values) == set(rows.dtype.names or ())
        for name, value in values.items():
            np.testing.assert_array_equal(value, row[name], err_msg=name)
        assert message.log_time == round(float(row["time_s"]) * 1e9)


@pytest.mark.parametrize("joints", [1, 2, 3])
@pytest.mark.parametrize("has_commands", [False, True])
def test_the_plain_reader_decodes_an_imported_recording(
    tmp_path: Path, joints: int, has_commands: bool
) -> None:
    random = np.random.default_rng(4)
    recording = Recording(
        joint_names=tuple("abc"[:joints]),
        time_s=0.01 * np.arange(20.0),
        position=random.standard_normal((20, joints)),
        torque_nm=random.standard_normal((20, joints)),
        valid=np.ones(20, dtype=np.bool_),
        phase=np.full(20, 3, dtype=np.uint8),
        sample_index=np.arange(20) - 1,
        source="import",
        sample_period_s=0.01,
        velocity_command=random.standard_normal((20, joints)) if has_commands else None,
    )
    path = tmp_path / "recording.mcap"
    write_imported(path, recording)
    names = ["time_s", "position", "torque_nm", "sample_index", "valid", "phase"]
    if has_commands:
        names.append("velocity_command")
    with path.open("rb") as file:
        messages = list(make_reader(file, validate_crcs=True).iter_messages())
    assert len(messages) == 20
    for row, (schema, _, message) in enumerate(messages):
        assert schema is not None
        values = decode(schema.data.decode(), message.data)
        for name in names:
            expected = np.squeeze(getattr(recording, name)[row])
            np.testing.assert_array_equal(np.squeeze(values[name]), expected, err_msg=name)
