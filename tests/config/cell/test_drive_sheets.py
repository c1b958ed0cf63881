"""Data sheets that a cell file names: they are found and read, kept with a run, and read again from
the run.
"""

from __future__ import annotations

import os
from pathlib import Path

import pytest

from config.cell.cell import DeviceIdentity
from config.errors import ConfigError
from config.formats.eds_text import MAX_BYTES
from config.load import load_cell
from tests.builders.raised_codes import raises_code

SHEET = "[DeviceInfo]\nVendorNumber=0xFB\nProductNumber=7\nRevisionNumber=0x10000\n[1000]\n"


def cell(folder: Path, *axes: str) -> str:
    """Write a cell file of three axes with the given additional keys, and return its path."""
    text = load_cell("ir361").files["cell.yaml"].decode()
    for number, keys in enumerate(axes, start=1):
        old = f"{{joint: axis{number}, node_id: {number}}}"
        assert old in text
        text = text.replace(old, f"{{joint: axis{number}, node_id: {number}{keys}}}")
    folder.mkdir(exist_ok=True)
    (folder / "cell.yaml").write_text(text)
    return str(folder / "cell.yaml")


def test_a_cell_without_sheets_is_unchanged() -> None:
    loaded = load_cell("ir361")
    assert loaded.eds_files == (None, None, None)
    assert {axis.identity for axis in loaded.config.axes} == {None}
    assert not any(name.endswith((".eds", ".dcf")) for name in loaded.files)


def test_sheets_are_found_from_the_cell_file_and_identify_the_drives(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(os.sep)
    (tmp_path / "sheets").mkdir()
    (tmp_path / "sheets" / "one.eds").write_text(SHEET)
    (tmp_path / "sheets" / "two.DCF").write_text(SHEET.replace("=7", "="))
    path = cell(tmp_path, ", eds: sheets/one.eds", "", f", eds: {tmp_path}/sheets/two.DCF")
    loaded = load_cell(path)
    first, second, third = loaded.eds_files
    assert first is not None
    assert second is None
    assert third is not None
    assert (first.product, third.product) == (7, None)
    assert [axis.identity for axis in loaded.config.axes] == [
        DeviceIdentity(vendor=0xFB, product=7, revision=0x10000),
        None,
        DeviceIdentity(vendor=0xFB, product=None, revision=0x10000),
    ]
    assert loaded.files["drive1.eds"] == SHEET.encode()
    assert b"ProductNumber=\n" in loaded.files["drive2.dcf"]


def test_one_sheet_of_all_drives_is_stored_once(tmp_path: Path) -> None:
    (tmp_path / "drive.eds").write_text(SHEET)
    loaded = load_cell(cell(tmp_path, *[", eds: drive.eds"] * 3))
    assert [name for name in loaded.files if "drive" in name] == ["drive1.eds"]
    assert len({id(sheet) for sheet in loaded.eds_files}) == 1


def test_the_identity_in_the_cell_file_overrides_the_sheet(tmp_path: Path) -> None:
    (tmp_path / "drive.eds").write_text(SHEET)
    loaded = load_cell(cell(tmp_path, ", eds: drive.eds, identity: {vendor: 251}"))
    assert loaded.config.axes[0].identity == DeviceIdentity(vendor=251)
    assert loaded.eds_files[0] is not None


def test_a_stored_cell_is_loaded_with_the_files_stored_with_it(tmp_path: Path) -> None:
    (tmp_path / "a.eds").write_text(SHEET)
    (tmp_path / "b.dcf").write_text(SHEET.replace("=7", "=8"))
    first = load_cell(cell(tmp_path, ", eds: a.eds", ", eds: b.dcf", ", eds: a.eds"))
    folder = tmp_path / "elsewhere" / "run"
    folder.mkdir(parents=True)
    for name, content in first.files.items():
        (folder / name).write_bytes(content)
    path = str(folder / "cell.yaml")
    with raises_code(ConfigError, "RID-FILE-READ", "a.eds"):
        load_cell(path)
    (folder / "manifest.json").write_text('{"name": "of some other program"}')
    with raises_code(ConfigError, "RID-FILE-READ", "a.eds"):
        load_cell(path)
    (folder / "manifest.json").write_text('{"run_id": "01", "files": {}}')
    robot = first.files["robot.yaml"].replace(b"name: ir361", b"name: kept")
    (folder / "robot.yaml").write_bytes(robot)
    again = load_cell(path)
    assert again.files == first.files | {"robot.yaml": robot}
    assert again.robot.name == "kept"
    assert again.config == first.config
    assert [s and s.sha256 for s in again.eds_files] == [s and s.sha256 for s in first.eds_files]


@pytest.mark.parametrize(
    ("content", "code", "details"),
    [
        (None, "RID-FILE-READ", ("cell.yaml:11:", "axes.1.eds:", "drive.eds:", os.strerror(2))),
        (SHEET + "ObjectType=x\n", "RID-EDS-INVALID", ("drive.eds:6: ObjectType", "'x'")),
        ("name: ir361\n", "RID-FILE-TYPE", ("drive.eds:1: 'name: ir361'",)),
        ("", "RID-FILE-TYPE", ("drive.eds: ", "[DeviceInfo]")),
        (" " * (MAX_BYTES + 1), "RID-FILE-READ", ("axes.1.eds:", "drive.eds:", "4 MB")),
    ],
)
def test_an_unreadable_sheet_is_refused(
    tmp_path: Path, content: str | None, code: str, details: tuple[str, ...]
) -> None:
    if content is not None:
        (tmp_path / "drive.eds").write_text(content)
    with raises_code(ConfigError, code, *details):
        load_cell(cell(tmp_path, "", ", eds: drive.eds"))


def test_a_sheet_that_is_not_a_file_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "folder").mkdir()
    for name in ("pipe", "folder", "/dev/zero"):
        with raises_code(ConfigError, "RID-FILE-READ"):
            load_cell(cell(tmp_path, f", eds: {name}"))
    with raises_code(ConfigError, "RID-FILE-READ"):
        load_cell(cell(tmp_path, ', eds: "a\\0b"'))
    with raises_code(ConfigError, "RID-FILE-VALUE", "axes.0.eds:"):
        load_cell(cell(tmp_path, ', eds: ""'))
