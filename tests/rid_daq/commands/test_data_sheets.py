"""Data sheets (EDS) of the drives on the command line: written, checked, and stored in runs."""

from __future__ import annotations

import hashlib
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import canopen
import pytest
from canopen.objectdictionary import ODRecord
from pydantic import ValidationError

from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from config.cell.servo_profile import ServoProfile
from config.load import load_cell
from rid_daq.app import run
from rid_daq.preflight.eds_check import eds_lines, refuse_unfit_eds
from tests.builders.console_blocks import assert_shown
from tests.builders.json_output import document

pytestmark = pytest.mark.slow

AXES = {1: "    node_id: 1\n", 2: "node_id: 2}", 3: "node_id: 3}"}


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder made by init, with the data sheets of its simulated drives."""
    folder = tmp_path_factory.mktemp("workshop")
    assert run(["init", str(folder)]) == 0
    assert run(["mock", str(folder / "cell.yaml"), "--eds", str(folder / "sheets")]) == 0
    validation = folder / "validation.yaml"
    validation.write_text(validation.read_text().replace("points: 20", "points: 2"))
    return folder


@pytest.fixture
def cell(workshop: Path, tmp_path: Path) -> Callable[..., str]:
    """Return a function that writes a cell with two data sheets and changes the second one."""

    def write_cell(old: str = "", new: str = "") -> str:
        folder = tmp_path / "cell"
        shutil.copytree(workshop, folder)
        sheet = folder / "sheets" / "node2.eds"
        text = sheet.read_text()
        assert old in text
        sheet.write_text(text.replace(old, new, 1))
        cell = (folder / "cell.yaml").read_text()
        cell = cell.replace(AXES[1], f"{AXES[1]}    eds: sheets/node1.eds\n")
        cell = cell.replace(AXES[2], "node_id: 2, eds: sheets/node2.eds}")
        assert cell.count("eds: sheets") == 2
        (folder / "cell.yaml").write_text(cell)
        return str(folder / "cell.yaml")

    return write_cell


def preflight_lines(
    cell: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], code: int
) -> list[dict[str, Any]]:
    capsys.readouterr()
    words = ["check", cell, "--seconds", "0.1", "--json", "--runs", str(tmp_path / "runs")]
    assert run(words) == code
    result = document(capsys)
    assert result["passed"] is (code == 0)
    lines: list[dict[str, Any]] = result["lines"]
    return lines


def test_sheets_are_written_once_and_are_readable_by_other_tools(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    names = [path.name for path in sorted((workshop / "sheets").iterdir())]
    assert names == ["node1.eds", "node2.eds", "node3.eds"]
    dictionary = canopen.import_od(str(workshop / "sheets" / "node2.eds"), node_id=2)
    receiving = dictionary[0x1400]
    assert isinstance(receiving, ODRecord)
    assert receiving[1].default == 0x202
    assert dictionary.device_information.product_number == 0x361
    assert run(["mock", str(workshop / "cell.yaml"), "--eds", str(workshop / "sheets")]) == 2
    assert "RID-FILE-EXISTS" in capsys.readouterr().err


def test_the_preflight_shows_matching_sheets(
    cell: Callable[..., str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = cell("[6084]\n", "[6084]\nHighLimit=10LL\n")
    lines = preflight_lines(path, tmp_path, capsys, 0)
    text = (Path(path).parent / "sheets" / "node2.eds").read_text()
    line = text.splitlines().index("HighLimit=10LL") + 1
    sheets = [line for line in lines if line["what"] == "data sheet (EDS)"]
    assert [(line["where"], line["found"], line["verdict"]) for line in sheets] == [
        ("axis1, node 1", "as required", "ok"),
        ("axis2, node 2", f"as required; values that cannot be read in lines {line}", "ok"),
    ]
    hashes = {line["where"]: line["found"] for line in lines if line["what"][:4] == "SHA-"}
    files = [Path(path).parent / "sheets" / f"node{n}.eds" for n in (1, 2)]
    assert hashes == {str(file): hashlib.sha256(file.read_bytes()).hexdigest() for file in files}
    products = [line for line in lines if line["what"] == "1018h:02 product"]
    assert [line["required"] for line in products] == ["361h", "361h", ""]
    assert [line["verdict"] for line in products] == ["ok", "ok", "shown"]


def test_the_preflight_of_a_cell_without_sheets_has_no_lines_about_them() -> None:
    loaded = load_cell("ir361")
    assert eds_lines(loaded) == []
    refuse_unfit_eds(loaded)


def test_a_drive_that_differs_from_its_sheet_is_red_and_not_written_to(
    cell: Callable[..., str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = cell("VendorNumber=0x00000000", "VendorNumber=0x000000FB")
    lines = preflight_lines(path, tmp_path, capsys, 3)
    (red,) = [line for line in lines if line["verdict"] == "red"]
    assert (red["where"], red["what"]) == ("axis2, node 2", "1018h:01 vendor")
    assert (red["required"], red["found"]) == ("FBh", "0h")
    assert "differs from the data sheet" in red["next_action"]
    assert "name the EDS of this drive" in red["next_action"]
    of_second = [line["what"][:5] for line in lines if line["where"] == "axis2, node 2"]
    assert "1016h" not in of_second
    assert "1600h" not in of_second
    assert "1016h" in [line["what"][:5] for line in lines if line["where"] == "axis3, node 3"]


def test_a_missing_object_in_a_sheet_is_red_before_any_drive_is_read(
    cell: Callable[..., str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = cell("[6077]", "[2077]")
    lines = preflight_lines(path, tmp_path, capsys, 3)
    reds = [line for line in lines if line["verdict"] == "red"]
    assert [(line["where"], line["what"], line["found"]) for line in reds] == [
        ("axis2, node 2", "data sheet (EDS)", "deviating objects: 1"),
        ("axis2, node 2", "data sheet: 6077h:00 in TPDO 1", "not in the EDS"),
    ]
    assert not [line for line in lines if line["what"][:5] in ("1000h", "1018h", "1016h")]
    capsys.readouterr()
    motion = str(Path(path).parent / "validation.yaml")
    assert run(["record", path, motion, "--runs", str(tmp_path / "runs")]) == 3
    output = capsys.readouterr().err
    assert "RID-EDS-UNFIT" in output
    assert all(part in output for part in ("axis2", "node 2", "6077h:00", "TPDO 1", "16 bit"))
    assert not (tmp_path / "runs").exists()


def test_a_faulty_line_of_a_sheet_is_refused_with_its_position(
    cell: Callable[..., str], capsys: pytest.CaptureFixture[str]
) -> None:
    path = cell("[6077]\nParameterName=torque [0.1 %]\n", "[6077\nParameterName=torque\n")
    assert run(["check", path]) == 2
    sheet = Path(path).parent / "sheets" / "node2.eds"
    line = sheet.read_text().splitlines().index("[6077") + 1
    message = capsys.readouterr().err
    assert f"{sheet}:{line}:" in "".join(message.split())
    assert "RID-EDS-INVALID" in message


def test_a_run_contains_the_sheets_and_its_cell_file_loads(
    cell: Callable[..., str], tmp_path: Path
) -> None:
    path = Path(cell())
    runs = ["--runs", str(tmp_path / "runs")]
    words = ["record", str(path), str(path.parent / "validation.yaml"), "--label", "kept", *runs]
    assert run(words) == 0
    folder = find_run(tmp_path / "runs", "kept")
    files = folder.manifest().files
    for number in (1, 2):
        original = (path.parent / "sheets" / f"node{number}.eds").read_bytes()
        assert folder.read(f"drive{number}.eds") == original
        assert files[f"drive{number}.eds"].sha256 == hashlib.sha256(original).hexdigest()
    first = load_cell(str(path))
    shutil.copytree(folder.path, tmp_path / "copy")
    shutil.rmtree(path.parent)
    again = load_cell(str(tmp_path / "copy" / "cell.yaml"))
    plant = {"plant.yaml": folder.read("plant.yaml")}  # as in the run: without an attached payload
    assert again.files == first.files | plant
    assert again.config == first.config
    assert RunFolder.open(tmp_path / "copy").verify() == ()
    assert run(["check", str(tmp_path / "copy" / "cell.yaml"), "--seconds", "0.1", *runs]) == 0


class TestFit:
    """`drives fit SHEET`: keys for the cell file, with placeholders for unknown numbers."""

    def test_the_sheet_of_a_simulated_drive_needs_no_keys(
        self, workshop: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        sheet = workshop / "sheets" / "node1.eds"
        assert run(["drives", "fit", str(sheet), "--json"]) == 0
        result = document(capsys)
        assert result["accepted"]
        assert result["servo"] == {}

    def test_unknown_numbers_become_placeholders_that_a_cell_file_refuses(
        self,
        workshop: Path,
        tmp_path: Path,
        capsys: pytest.CaptureFixture[str],
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.chdir(tmp_path)
        sheet = Path("drive.eds")
        text = (workshop / "sheets" / "node1.eds").read_text()
        for gone, other in (("6076", "2FF0"), ("608F", "2FF1")):
            text = text.replace(f"0x{gone}", f"0x{other}").replace(f"[{gone}", f"[{other}")
        sheet.write_text(text)
        assert run(["drives", "fit", str(sheet), "--json"]) == 0
        result = document(capsys)
        assert result["servo"] == {"encoder_increments": "?", "rated_torque_nm": "?"}
        assert run(["drives", "fit", str(sheet)]) == 0
        output = capsys.readouterr().out
        assert_shown("your-own-drives", "rid-daq drives fit drive.eds", output)
        servo = "\n".join(output.splitlines()[: 1 + len(result["servo"])])
        cell = tmp_path / "cell.yaml"
        cell.write_text((workshop / "cell.yaml").read_text() + servo + "\n")
        assert run(["check", str(cell), "--json"]) == 2
        assert document(capsys)["error"]["code"] == "RID-FILE-PLACEHOLDER"

    def test_a_sheet_without_the_controlword_is_refused_for_safety(
        self, workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        sheet = tmp_path / "drive.eds"
        text = (workshop / "sheets" / "node1.eds").read_text()
        sheet.write_text(text.replace("0x6040", "0x2FF0").replace("[6040", "[2FF0"))
        assert run(["drives", "fit", str(sheet), "--json"]) == 1
        result = document(capsys)
        assert result["concerns_safety"]
        assert {"object": "6040h:00", "safety": True} in [
            {key: each[key] for key in ("object", "safety")} for each in result["lacks"]
        ]

    @pytest.mark.parametrize("content", [None, b"", b"\x00\xff", b"[1000]\nDataType=9999\n"])
    def test_a_missing_or_invalid_sheet_is_refused(
        self, tmp_path: Path, content: bytes | None
    ) -> None:
        sheet = tmp_path / "drive.eds"
        if content is not None:
            sheet.write_bytes(content)
        assert run(["drives", "fit", str(sheet)]) == 2


def test_contradictory_motor_ratings_are_refused() -> None:
    with pytest.raises(ValidationError):
        ServoProfile(rated_torque_nm=1.0, rated_current_a=1.0, torque_constant_nm_per_a=0.1)
    ServoProfile(rated_torque_nm=1.0, rated_current_a=5.0, torque_constant_nm_per_a=0.18)
