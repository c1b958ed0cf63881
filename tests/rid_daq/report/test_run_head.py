"""The head of a report: run, operator, serial numbers, files, model and software of the run."""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.load import load_cell
from rid_daq.blocks.block import Table
from rid_daq.report.model_file import ModelFile
from rid_daq.report.result import Result
from rid_daq.report_page.run_head import run_head_blocks
from rid_daq.report_page.write import write_result
from rid_daq.runs.run_data import CELL, ROBOT
from rid_daq.session.versions import program_commit, software_versions

RESULT = Result.new("Recording", "ir361")
CLONE = Path(__file__).parents[3]


@pytest.fixture
def folder(tmp_path: Path) -> RunFolder:
    """Return a complete run of the bundled cell without a log of writes to its drives."""
    loaded = load_cell("ir361")
    facts = {"cell": "ir361", "operator": "Smith <b>"}
    software = {"rid-daq": "0.1.0", "commit": "0123456789ab"}
    folder = RunFolder.create(tmp_path, "monday", software=software, facts=facts)
    for name in (CELL, ROBOT):
        folder.write(name, loaded.files[name])
    folder.finish(RunStatus.COMPLETE)
    return folder


def head(folder: RunFolder, result: Result = RESULT) -> dict[str, str]:
    (table, _) = run_head_blocks(folder, result)
    assert isinstance(table, Table)
    return {str(name): str(value) for name, value in table.rows}


def test_the_head_identifies_run_files_and_software(folder: RunFolder) -> None:
    rows = head(folder)
    assert rows["Run"] == f"monday ({folder.run_id})"
    assert rows["Operator"] == "Smith <b>"
    assert folder.manifest().files[CELL].sha256[:16] in rows[CELL]
    assert "commit 0123456789ab" in rows["Made with"]
    assert "Model" not in rows
    model = ModelFile(name="model.json", sha256="ab" * 32)
    result = RESULT.with_model_sections(model)
    assert "abababababababab" in head(folder, result)["Model"]


def test_serial_numbers_that_no_drive_has_reported_are_named_as_missing(folder: RunFolder) -> None:
    serials = {name: value for name, value in head(folder).items() if name.startswith("Serial")}
    assert len(serials) == 3
    assert set(serials.values()) == {"not recorded"}


def test_a_damaged_cell_file_does_not_prevent_the_report(folder: RunFolder) -> None:
    folder.write(CELL, b"cell: [")
    assert "cannot be read" in head(folder)["Serial numbers"]
    assert write_result(folder, RESULT).exists()


def test_the_signature_stands_between_the_head_and_the_sections(folder: RunFolder) -> None:
    page = write_result(folder, RESULT).read_text(encoding="utf-8")
    assert page.index("Smith &lt;b&gt;") < page.index("Signature") < page.index("<h2>Robot</h2>")


def test_the_commit_of_a_clone_is_that_of_git() -> None:
    if not (CLONE / ".git").exists():
        pytest.skip("the tests run outside a clone")
    words = ["git", "-C", str(CLONE), "rev-parse", "HEAD"]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    commit = program_commit().removesuffix("-changed")
    assert len(commit) >= 12
    assert done.stdout.startswith(commit)
    assert software_versions()["commit"] == program_commit()
