"""Files that the pages offer: selected by content and not by name."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import pytest

from acquisition.motion.motion_file import MOTION_KINDS
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from rid_daq.service.folder_files import folder_files
from rid_daq.service.served_cell import ServedCell
from rid_daq.service.service import CellService

MOTION = "# An excitation.\nkind: fourier\nrobot: ir361\n"
MODEL = '{\n "kind": "rid-daq estimate",\n "robot": {"name": "ir361"}\n}'
PAYLOAD = MODEL.replace("estimate", "payload")
LOOPS = '{"schema": "rid-daq velocity loops 3"}'


def test_files_are_listed_by_their_content(tmp_path: Path) -> None:
    service = CellService(tmp_path, [ServedCell("ir361", 20.0)])
    run = service.runs / "01A"
    run.mkdir(parents=True)
    (tmp_path / "a.yaml").write_text(MOTION)
    (tmp_path / "other.yaml").write_text(MOTION.replace("ir361", "kr15"))
    (tmp_path / "cell.yaml").write_text("name: x\nkind_of: fourier\n")
    (tmp_path / ".hidden.yaml").write_text(MOTION)
    (run / "motion.yaml").write_text(MOTION)  # part of a run: the motion with which it was recorded
    (run / "model.json").write_text(MODEL)
    (tmp_path / "other.json").write_text(MODEL.replace("ir361", "kr15"))
    (tmp_path / "torn.json").write_text(MODEL[:-1])
    (run / "loops.json").write_text(LOOPS)
    (run / "payload.json").write_text(PAYLOAD)
    (tmp_path / "other-payload.json").write_text(PAYLOAD.replace("ir361", "kr15"))
    (run / "result.json").write_text(MODEL)
    found = folder_files(service, "ir361")
    assert [(each.path, each.kind) for each in found.motions] == [("a.yaml", "fourier")]
    assert [each.path for each in found.models] == ["runs/01A/model.json"]
    assert [each.path for each in found.loops] == ["runs/01A/loops.json"]
    assert found.feedforwards == ()
    assert [each.path for each in found.payloads] == ["runs/01A/payload.json"]


def test_a_motion_on_one_line_is_listed_as_init_writes_it(tmp_path: Path) -> None:
    service = CellService(tmp_path, [ServedCell("ir361", 20.0)])
    for robot in ("ir361", "kr15"):
        line = f"{{kind: multipoint, robot: {robot}, points: 12, seed: 1}}\n"
        (tmp_path / f"{robot}.yaml").write_text("# Random points.\n" + line)
    found = folder_files(service, "ir361").motions
    assert [(each.path, each.kind) for each in found] == [("ir361.yaml", "multipoint")]


def test_the_results_of_a_run_are_named_by_the_run(tmp_path: Path) -> None:
    service = CellService(tmp_path, [ServedCell("ir361", 20.0)])
    run = RunFolder.create(service.runs, "spring")
    (run.path / "model.json").write_text(MODEL)
    (run.path / "second.json").write_text(MODEL)
    run.finish(RunStatus.COMPLETE, {"robot": "ir361"})
    (tmp_path / "kept.json").write_text(MODEL)
    models = {each.path: each for each in folder_files(service, "ir361").models}
    model, second = (models[f"runs/{run.run_id}/{name}.json"] for name in ("model", "second"))
    assert (model.words, second.words) == ("spring (ir361)", "spring (ir361, second.json)")
    assert model.made_utc == run.manifest().created_utc
    assert (models["kept.json"].words, models["kept.json"].made_utc) == ("kept.json", "")


def test_an_unchanged_run_folder_is_not_read_again(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    service = CellService(tmp_path, [ServedCell("ir361", 20.0)])
    read: list[str] = []
    scan = os.scandir

    def noted(path: str) -> Any:
        read.append(Path(path).name)
        return scan(path)

    for name in ("01A", "01B"):
        run = service.runs / name
        run.mkdir(parents=True)
        (run / "model.json").write_text(MODEL)
        os.utime(run, (1e9, 1e9))
    folder_files(service, "ir361")
    monkeypatch.setattr(os, "scandir", noted)
    (service.runs / "01B" / "loops.json").write_text(LOOPS)
    found = folder_files(service, "ir361")
    assert "01A" not in read
    assert "01B" in read
    assert len(found.models) == 2
    assert [each.path for each in found.loops] == ["runs/01B/loops.json"]


@pytest.mark.parametrize("kind", sorted(MOTION_KINDS))
def test_motions_of_every_kind_are_listed(kind: str, tmp_path: Path) -> None:
    service = CellService(tmp_path, [ServedCell("ir361", 20.0)])
    (tmp_path / "it.yaml").write_text(MOTION.replace("fourier", kind))
    assert [each.kind for each in folder_files(service, "ir361").motions] == [kind]
