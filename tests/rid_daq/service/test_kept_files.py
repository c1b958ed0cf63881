"""Refused paths in requests: hidden files, files outside the folder, and files of a cell as
outputs.
"""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from config.errors import ConfigError
from config.load import load_cell
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Identity, Role
from rid_daq.service.request_check import check_request, refuse_table_outside
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from tests.builders.raised_codes import raises_code

ANNA = Identity(name="Anna", role=Role.OPERATOR, person=True, token="a")


def export_to(output: str) -> dict[str, object]:
    return {"what": "model.json", "to": "json", "output": output, "overwrite": True}


@pytest.mark.parametrize("path", ["~/secret.yaml", "./~/secret.yaml", "~root/m.yaml", "~"])
def test_a_path_into_a_home_folder_is_refused(path: str, tmp_path: Path) -> None:
    with raises_code(ConfigError, "RID-PATH-OUTSIDE"):
        check_request(JobKind("record"), {"motion": path}, tmp_path)


@pytest.mark.parametrize("path", [".rid-daq-service/service.db", "a/../.rid-daq-service", ".env"])
def test_a_hidden_file_is_refused(path: str, tmp_path: Path) -> None:
    with raises_code(ConfigError, "RID-PATH-HIDDEN", "hidden"):
        check_request(JobKind("export"), export_to(path), tmp_path)


def test_a_link_to_a_file_outside_the_folder_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / "link.yaml").symlink_to(tmp_path / "secret.yaml")
    with raises_code(ConfigError, "RID-PATH-OUTSIDE"):
        check_request(JobKind("record"), {"motion": "link.yaml"}, folder)


def test_a_number_that_starts_with_a_point_is_not_a_hidden_file(tmp_path: Path) -> None:
    request = {"model": "m.json", "run": "latest", "limits": ".5,.5,.5"}
    check_request(JobKind("validate"), request, tmp_path)


def test_load_data_of_a_controller_are_not_checked_as_a_path(tmp_path: Path) -> None:
    request = {"payload": "payload.json", "form": "fanuc", "text": "/PROG  LOAD\n/MN\n"}
    check_request(JobKind("payload_read_back"), request, tmp_path)


def test_the_files_of_a_served_cell_cannot_be_overwritten(tmp_path: Path) -> None:
    (tmp_path / "cell.yaml").write_bytes(load_cell("ir361").files["cell.yaml"])
    cell = ServedCell(str(tmp_path / "cell.yaml"), 1.0)
    service = CellService(tmp_path, [cell])
    with raises_code(ConfigError, "RID-OUTPUT-CELL", "cell.yaml"):
        asyncio.run(service.begin(cell, JobKind("export"), export_to("cell.yaml"), ANNA))


@pytest.mark.parametrize("file", ["../../table.csv", "/etc/table.csv", "~/table.csv"])
@pytest.mark.parametrize(
    "form", ["kind: joint_table\nfile: {}\n", '{{"kind": "joint_t\\u0061ble", "file": "{}"}}']
)
def test_a_motion_with_a_table_outside_the_folder_is_refused_in_yaml_and_json(
    form: str, file: str, tmp_path: Path
) -> None:
    motion = tmp_path / "motions" / "a.yaml"
    with raises_code(ConfigError, "RID-PATH-OUTSIDE"):
        refuse_table_outside(motion, form.format(file).encode(), tmp_path)
    refuse_table_outside(motion, form.format("../tables/a.csv").encode(), tmp_path)


def test_a_file_that_is_not_a_motion_is_not_searched_for_a_table(tmp_path: Path) -> None:
    for content in (b"\xff joint_table", b"[joint_table", b"[joint_table]", b'{"file": "/x\\n"}'):
        refuse_table_outside(tmp_path / "a.yaml", content, tmp_path)
