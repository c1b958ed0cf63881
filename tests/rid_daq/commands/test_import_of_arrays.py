"""`rid-daq import` of files of `rid-daq export` and other programs, with named columns."""

from __future__ import annotations

import json
from pathlib import Path

import h5py
import numpy as np
import pytest

from acquisition.runs.folder import RunFolder
from config.load import to_yaml
from rid_daq.api import read_recording
from rid_daq.app import run
from rid_daq.runs.run_data import MAP, RunData
from tests.builders.foreign_tables import as_lines, sound_table, two_joint_map, two_joint_robot

BY_NAME = {
    "columns": None,
    "time": {"column": "time_s"},
    "joints": [
        {"joint": name, "position": f"position_{name}_rad", "torque": f"torque_{name}_nm"}
        for name in "ab"
    ],
}


@pytest.fixture
def imported(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    """Return the folder of a run that was imported from a plain CSV file."""
    (tmp_path / "rec.csv").write_text("\n".join(as_lines(sound_table())))
    (tmp_path / "robot.yaml").write_text(to_yaml(two_joint_robot()))
    (tmp_path / "plain.yaml").write_text(to_yaml(two_joint_map(robot="robot.yaml")))
    return import_file(tmp_path / "rec.csv", tmp_path / "plain.yaml", capsys)


def import_file(file: Path, layout: Path, capsys: pytest.CaptureFixture[str]) -> Path:
    capsys.readouterr()
    code = run(
        ["import", str(file), "--map", str(layout), "--runs", str(layout.parent / "runs"), "--json"]
    )
    out, err = capsys.readouterr()
    assert code == 0, err
    return Path(json.loads(out)["folder"])


def equal(first: Path, second: Path) -> bool:
    one, two = (RunData.load(RunFolder.open(each)).recording for each in (first, second))
    return (
        np.array_equal(one.position, two.position)
        and np.array_equal(one.torque_nm, two.torque_nm)
        and np.allclose(one.time_s - one.time_s[0], two.time_s - two.time_s[0], atol=1e-12)
    )


@pytest.mark.parametrize("form", ["csv", "mat", "parquet"])
def test_an_exported_run_is_imported_again_by_the_names_of_its_columns(
    form: str, imported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    layout = tmp_path / "named.yaml"
    header = {"header_rows": 1} if form == "csv" else {}
    layout.write_text(to_yaml(two_joint_map(robot="robot.yaml", **(BY_NAME | header))))
    file = tmp_path / f"again.{form}"
    assert run(["export", str(imported), "--to", form, "--output", str(file)]) == 0
    again = import_file(file, layout, capsys)
    assert equal(imported, again)
    assert RunFolder.open(again).manifest().label == "again"


def test_the_map_in_the_run_folder_reads_the_csv_file_beside_it(
    imported: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = sound_table()
    with h5py.File(tmp_path / "rec.h5", "w") as file:
        file["log/t"], file["log/q"], file["log/tau"] = table[:, 0], table[:, 1:3].T, table[:, 5:7]
    joints = [
        {"joint": name, "position": f"log/q[{i}]", "torque": f"log/tau[{i}]"}
        for i, name in enumerate("ab")
    ]
    keys = {"columns": None, "time": {"column": "log/t"}, "joints": joints}
    (tmp_path / "named.yaml").write_text(to_yaml(two_joint_map(robot="robot.yaml", **keys)))
    folder = import_file(tmp_path / "rec.h5", tmp_path / "named.yaml", capsys)
    assert equal(folder, import_file(folder / "source.csv", folder / MAP, capsys))
    assert not list(folder.glob("*.h5"))


def test_the_python_api_reads_them_too(imported: Path, tmp_path: Path) -> None:
    table = sound_table()
    np.savez(tmp_path / "rec.npz", time_s=table[:, 0], q=table[:, 1:3], tau=table[:, 5:7])
    joints = [
        {"joint": name, "position": f"q[{i}]", "torque": f"tau[{i}]"} for i, name in enumerate("ab")
    ]
    layout = tmp_path / "named.yaml"
    layout.write_text(to_yaml(two_joint_map(robot="robot.yaml", **(BY_NAME | {"joints": joints}))))
    recording = read_recording(tmp_path / "rec.npz", map=layout)
    np.testing.assert_array_equal(recording.position, table[:, 1:3])
