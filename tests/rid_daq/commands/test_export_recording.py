"""A run's recording as CSV, Parquet, MAT and MDF 4, each read by code other than rid-daq's."""

from __future__ import annotations

import csv
import io
import json
import shutil
import struct
from pathlib import Path

import fastparquet
import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter
from acquisition.journal.header import JournalHeader
from acquisition.recording.files import RecordingFormat, encode_recording
from acquisition.recording.table import recording_table
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import ConfigError, RecordingError
from config.load import load_cell
from rid_daq.app import run
from rid_daq.runs.run_data import RunData
from tests.builders.raised_codes import raises_code

ROWS = 500
JOINTS = ("axis1", "axis2", "axis3")


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    folder = RunFolder.create(tmp_path_factory.mktemp("export") / "runs", "swing")
    for name, content in load_cell("ir361").files.items():
        folder.write(name, content)
    rng = np.random.default_rng(3)
    rows = np.zeros(ROWS, dtype=row_dtype(3))
    rows["time_s"] = 100.0 + np.arange(ROWS) * 0.008
    rows["cycle"] = rows["sample_index"] = np.arange(ROWS)
    for field in ("position", "torque_nm", "target_position", "velocity_command"):
        rows[field] = rng.normal(size=(ROWS, 3)) * 10.0 ** rng.integers(-9, 9, size=(ROWS, 3))
    rows["valid"] = 1
    rows["valid"][4, 1] = 0
    header = JournalHeader(joint_names=JOINTS, sample_period_s=0.008, run_id=folder.run_id)
    with JournalWriter(folder.file("recording.mcap"), header) as writer:
        writer.append(rows.tobytes())
    folder.finish(RunStatus.COMPLETE)
    return folder


@pytest.fixture(scope="module")
def data(folder: RunFolder) -> RunData:
    return RunData.load(folder)


def export(folder: RunFolder, form: str, out: Path) -> Path:
    words = ["export", "swing", "--runs", str(folder.path.parent), "--to", form, "-o", str(out)]
    assert run(words) == 0
    return out


def test_the_csv_module_reads_an_exported_csv_exactly(
    folder: RunFolder, data: RunData, tmp_path: Path
) -> None:
    with export(folder, "csv", tmp_path / "r.csv").open(newline="") as file:
        head, *rows = list(csv.reader(file))
    assert head[:5] == [
        "time_s", "position_axis1_rad", "position_axis2_rad", "position_axis3_rad",
        "torque_axis1_nm",
    ]  # fmt: skip
    assert {"target_position_axis2_rad", "velocity_command_axis3_rad_s"} <= set(head)
    assert not any(name.startswith(("=", "+", "-", "@", "\t", "\r")) for name in head)
    table = np.array(rows, dtype=float)
    np.testing.assert_array_equal(table[:, 0], data.recording.time_s)
    np.testing.assert_array_equal(table[:, 4:7], data.recording.torque_nm)
    assert np.flatnonzero(table[:, head.index("valid")] == 0).tolist() == [4]


def test_fastparquet_reads_an_exported_parquet_file_exactly(
    folder: RunFolder, data: RunData, tmp_path: Path
) -> None:
    written = export(folder, "parquet", tmp_path / "r.parquet").read_bytes()
    file = fastparquet.ParquetFile(io.BytesIO(written))
    frame = file.to_pandas()
    np.testing.assert_array_equal(frame["time_s"], data.recording.time_s)
    for joint, name in enumerate(JOINTS):
        np.testing.assert_array_equal(
            frame[f"position_{name}_rad"], data.recording.position[:, joint]
        )
    np.testing.assert_array_equal(frame["sample_index"], np.arange(ROWS))
    origin = json.loads(dict(file.key_value_metadata)["rid-daq"])
    assert origin["run"] == folder.run_id


def mat_matrices(data: bytes) -> dict[str, np.ndarray]:
    """Return the real matrices of a MAT file, parsed by the published layout of version 5."""
    assert data[124:128] == struct.pack("<HH", 0x0100, 0x4D49)
    found, position = {}, 128
    kinds = {9: "<f8", 5: "<i4", 6: "<u4", 12: "<i8", 3: "<i2", 2: "u1", 1: "i1", 4: "<u2"}

    def element(at: int) -> tuple[int, bytes, int]:
        kind, size = struct.unpack_from("<II", data, at)
        if kind >> 16:  # packed into four bytes
            return kind & 0xFFFF, data[at + 4 : at + 4 + (kind >> 16)], at + 8
        return kind, data[at + 8 : at + 8 + size], at + 8 + (size + 7) // 8 * 8

    while position < len(data):
        kind, body, following = element(position)
        assert kind == 14
        _, flags, at = element(position + 8)
        if flags[0] not in (1, 2):  # neither cell nor structure
            _, shape, at = element(at)
            _, name, at = element(at)
            stored, values, _ = element(at)
            array = np.frombuffer(values, dtype=kinds[stored])
            found[name.decode()] = array.reshape(np.frombuffer(shape, "<i4"), order="F")
        assert body
        position = following
    return found


def test_a_mat_file_has_the_published_layout_and_exact_values(
    folder: RunFolder, data: RunData, tmp_path: Path
) -> None:
    found = mat_matrices(export(folder, "mat", tmp_path / "r.mat").read_bytes())
    np.testing.assert_array_equal(found["time_s"][:, 0], data.recording.time_s)
    for joint, name in enumerate(JOINTS):
        np.testing.assert_array_equal(
            found[f"torque_{name}_nm"][:, 0], data.recording.torque_nm[:, joint]
        )


def mdf_channels(data: bytes) -> dict[str, tuple[np.ndarray, str]]:
    """Return values and units of the channels of an MDF 4 file with one group."""
    assert data[:8] == b"MDF     "
    assert data[8:12].startswith(b"4.1")

    def block(at: int) -> tuple[bytes, tuple[int, ...], bytes]:
        name, size, count = struct.unpack_from("<4s4xQQ", data, at)
        links = struct.unpack_from(f"<{count}Q", data, at + 24)
        return name, links, data[at + 24 + 8 * count : at + size]

    def text(at: int) -> str:
        return block(at)[2].rstrip(b"\0").decode() if at else ""

    name, links, _ = block(64)
    assert name == b"##HD"
    name, (_, group, records, _), _ = block(links[0])
    assert name == b"##DG"
    name, links, body = block(group)
    assert name == b"##CG"
    _, cycles, _, _, _, size, _ = struct.unpack_from("<QQHHIII", body)
    name, listed, rows = block(records)
    if name == b"##DL":
        rows = b"".join(block(at)[2] for at in listed[1:])
    assert len(rows) == cycles * size
    found, at = {}, links[1]
    while at:
        _, inside, body = block(at)
        kind, _, coding, _, offset, bits = struct.unpack_from("<BBBBII", body)
        assert kind in (0, 2)
        dtype = np.dtype(("<f" if coding == 4 else "<i" if coding == 2 else "<u") + str(bits // 8))
        column = np.ndarray(cycles, dtype, rows, offset, (size,))
        found[text(inside[2])] = (column, text(inside[6]))
        at = inside[0]
    return found


def test_an_mdf_file_follows_the_standard_and_has_exact_values(
    folder: RunFolder, data: RunData, tmp_path: Path
) -> None:
    found = mdf_channels(export(folder, "mdf4", tmp_path / "r.mf4").read_bytes())
    (time_s,) = [values for name, (values, _) in found.items() if name.startswith("time")]
    np.testing.assert_array_equal(time_s, data.recording.time_s)
    for joint, name in enumerate(JOINTS):
        values, unit = found[f"torque_{name}_nm"]
        np.testing.assert_array_equal(values, data.recording.torque_nm[:, joint])
        assert unit == "N m"


def test_a_missing_library_is_named_with_its_extra(
    data: RunData, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(__import__("sys").modules, "asammdf", None)
    table = recording_table(data.recording, data.robot)
    with raises_code(ConfigError, "RID-INSTALL-LIBRARY"):
        encode_recording(table, RecordingFormat.MDF4)


@pytest.mark.parametrize("label", ["ur10 v1.2", "model.json"])
def test_a_label_with_a_dot_selects_its_run(folder: RunFolder, label: str, tmp_path: Path) -> None:
    copy = tmp_path / "runs" / folder.run_id
    shutil.copytree(folder.path, copy)
    manifest = (copy / "manifest.json").read_text()
    (copy / "manifest.json").write_text(manifest.replace('"swing"', f'"{label}"'))
    words = ["export", label, "--runs", str(copy.parent), "--to", "csv"]
    assert run([*words, "-o", str(tmp_path / "r.csv")]) == 0
    assert len((tmp_path / "r.csv").read_text().splitlines()) == 1 + ROWS


def test_a_recording_of_another_robots_joints_is_refused(data: RunData) -> None:
    with raises_code(RecordingError, "RID-ROBOT-OTHER"):
        recording_table(data.recording, load_cell("kr15").robot)


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["swing", "--to", "urdf"], "RID-EXPORT-FORMAT"),
        (["no-such-run", "--to", "csv"], "RID-RUN-UNKNOWN"),
        (["missing.json", "--to", "c"], "RID-RUN-UNKNOWN"),
        (["missing.json", "--to", "mat"], "RID-RUN-UNKNOWN"),
    ],
)
def test_an_unknown_run_and_an_unsuitable_format_are_refused(
    folder: RunFolder,
    tmp_path: Path,
    words: list[str],
    code: str,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    runs = ["--runs", str(folder.path.parent)]
    assert run(["export", *words, "-o", str(out), *runs]) == 2
    message = capsys.readouterr().err
    assert code in message
    assert f"{words[0]}" in message or words[-1] in message
    assert not out.exists()
