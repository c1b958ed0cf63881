"""Scene of a cell after its files change: hash of the files, address of the triangles."""

from __future__ import annotations

from pathlib import Path

import pytest

from config.load import load_cell
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.workbench.view.scene_routes import _CellScene, _encode_scene


@pytest.fixture
def cell(tmp_path: Path) -> ServedCell:
    files = load_cell("ir361").files
    text = files["cell.yaml"].decode().replace("\nrobot: ir361", "\nrobot: ./robot.yaml")
    (tmp_path / "cell.yaml").write_text(text)
    (tmp_path / "robot.yaml").write_bytes(files["robot.yaml"])
    return ServedCell(str(tmp_path / "cell.yaml"), 20.0)


def test_status_and_scene_name_the_present_files(cell: ServedCell, tmp_path: Path) -> None:
    service = CellService(tmp_path, [cell])

    def scene() -> tuple[str, str]:
        loaded = cell.reload_if_changed()
        wanted = _CellScene(cell.name, loaded.files_hash, "small", loaded)
        document, _, version = _encode_scene(wanted)
        assert f"/{version}/" in document.geometry
        assert document.files_hash == service.status(cell).files_hash == loaded.files_hash
        return document.files_hash, version

    before = scene()
    robot = tmp_path / "robot.yaml"
    robot.write_text(robot.read_text() + "# another comment\n")
    after = scene()
    assert before[0] != after[0]
    assert before[1] == after[1]  # the shape is the same: the browser's copy is still valid
