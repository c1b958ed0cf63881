"""A job receives the hashes of its accepted files, and refuses to move with other files."""

from __future__ import annotations

import asyncio
import hashlib
import json
import os
from pathlib import Path
from typing import Any

import pytest

from config.formats.approved_files import approve_files
from rid_daq.service.job_kinds import JobKind
from rid_daq.service.records import Identity, Role
from rid_daq.service.request_check import hash_named_files
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService
from rid_daq.service.workers.running_job import RunningJob
from rid_daq.worker.worker import WorkOrder, work
from tests.rid_daq.service.conftest import Worker

pytestmark = pytest.mark.promise("driven-as-approved")

ANNA = Identity(name="anna", role=Role.OPERATOR, person=True, token="")


def sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()


def test_the_files_of_a_request_and_their_tables_are_hashed(tmp_path: Path) -> None:
    motion = b"kind: joint_table\nrobot: ir361\nfile: rows.csv\n"
    (tmp_path / "motions").mkdir()
    (tmp_path / "motions" / "m.yaml").write_bytes(motion)
    (tmp_path / "motions" / "rows.csv").write_bytes(b"time_s,axis1\n")
    (tmp_path / "f.json").write_bytes(b"{}")
    request = {"motion": "motions/m.yaml", "feedforward": "f.json", "label": "no file", "n": 3}
    assert hash_named_files(request, tmp_path) == {
        str(tmp_path / "motions" / "m.yaml"): sha256(motion),
        str(tmp_path / "motions" / "rows.csv"): sha256(b"time_s,axis1\n"),
        str(tmp_path / "f.json"): sha256(b"{}"),
    }


def cell_folder(folder: Path) -> Path:
    from config.load import load_cell

    for name, content in load_cell("ir361").files.items():
        (folder / name).write_bytes(content)
    cell = folder / "cell.yaml"
    text = cell.read_text().replace("\nrobot: ir361", "\nrobot: ./robot.yaml")
    cell.write_text(text.replace("\nplant: ir361", "\nplant: ./plant.yaml"))
    return cell


def test_the_order_of_a_motion_contains_the_hashes_of_all_its_files(
    tmp_path: Path, worker: Worker, monkeypatch: pytest.MonkeyPatch
) -> None:
    orders: list[dict[str, Any]] = []
    monkeypatch.setattr(RunningJob, "send_order", lambda _job, **order: orders.append(order))
    cell_file = cell_folder(tmp_path)
    served = ServedCell(str(cell_file), 20.0)
    service = CellService(tmp_path, [served])
    (tmp_path / "m.yaml").write_bytes(b"kind: fourier\n")

    async def begun() -> None:
        key = service.leases.take(served.name, ANNA, "", 60.0, confirmed=served.name).key
        checked = {"passed": True, "lines": [], "files_hash": served.loaded.files_hash}
        service.readiness.note_check(served, checked)
        await service.begin(served, JobKind("record"), {"motion": "m.yaml"}, ANNA, lease=key)

    asyncio.run(begun())
    (order,) = orders
    files = (cell_file, tmp_path / "robot.yaml", tmp_path / "plant.yaml", tmp_path / "m.yaml")
    assert order["approved"] == {str(path): sha256(path.read_bytes()) for path in files}


@pytest.mark.parametrize("changed", ["cell.yaml", "robot.yaml", "m.yaml"])
def test_a_worker_refuses_files_that_changed_after_the_order(tmp_path: Path, changed: str) -> None:
    cell_file = cell_folder(tmp_path)
    (tmp_path / "m.yaml").write_bytes(b"kind: fourier\n")
    files = [cell_file, tmp_path / "robot.yaml", tmp_path / "m.yaml"]
    order = WorkOrder(
        kind=JobKind("record"),
        request={"motion": "m.yaml"},
        cell=str(cell_file),
        runs=tmp_path / "runs",
        folder=tmp_path,
        events=tmp_path / "events.jsonl",
        cleared=False,
        service=os.getpid(),
        approved={str(path): sha256(path.read_bytes()) for path in files},
    )
    path = tmp_path / changed
    path.write_bytes(path.read_bytes() + b"# edited meanwhile\n")
    orders, _kept_open = os.pipe()  # a closed pipe would mean that the service has ended
    try:
        assert work(order, os.fdopen(orders)) == 2
    finally:
        approve_files({})
    last = json.loads((tmp_path / "events.jsonl").read_text().splitlines()[-1])
    assert last["code"] == "RID-JOB-FILES"
    assert not (tmp_path / "runs").exists()
