"""Files approved with a job: every reader gets exactly the approved bytes or an error."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path

import pytest

from acquisition.motion.motion_file import load_motion
from config.errors import ConfigError
from config.formats.approved_files import approve_files
from config.formats.bounded_file import read_file, read_pieces
from config.load import load_cell
from identification.estimation.file import read_estimate

pytestmark = pytest.mark.promise("driven-as-approved")


@pytest.fixture(autouse=True)
def nothing_approved() -> Iterator[None]:
    yield
    approve_files({})


def approve_file(path: Path) -> Path:
    approve_files({str(path): hashlib.sha256(path.read_bytes()).hexdigest()})
    return path


def test_an_approved_file_is_read(tmp_path: Path) -> None:
    path = tmp_path / "a.yaml"
    path.write_bytes(b"a: 1\n")
    approve_file(path)
    (tmp_path / "other").write_bytes(b"anything")
    assert read_file(path, 100) == b"a: 1\n"
    assert read_file(tmp_path / "other", 100) == b"anything"


@pytest.mark.parametrize("relative", [True, False])
def test_changed_bytes_are_refused_under_any_path_of_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, relative: bool
) -> None:
    monkeypatch.chdir(tmp_path)
    path = tmp_path / "a.yaml"
    (tmp_path / "x").mkdir()
    path.write_bytes(b"a: 1\n")
    approve_file(path)
    path.write_bytes(b"a: 2\n")
    with pytest.raises(ConfigError) as caught:
        read_file(Path("x/../a.yaml") if relative else path, 100)
    assert caught.value.refusal == "RID-JOB-FILES"
    with pytest.raises(ConfigError) as caught:
        b"".join(read_pieces(Path("x/../a.yaml") if relative else path, 100))
    assert caught.value.refusal == "RID-JOB-FILES"


def test_a_link_to_another_file_since_the_approval_is_refused(tmp_path: Path) -> None:
    (tmp_path / "one").write_bytes(b"1")
    (tmp_path / "two").write_bytes(b"2")
    link = tmp_path / "link"
    link.symlink_to("one")
    approve_file(link)
    link.unlink()
    link.symlink_to("two")
    with pytest.raises(ConfigError) as caught:
        read_file(link, 10)
    assert caught.value.refusal == "RID-JOB-FILES"


def test_every_file_of_a_cell_is_checked(tmp_path: Path) -> None:
    for name, content in load_cell("ir361").files.items():
        (tmp_path / name).write_bytes(content)
    cell = tmp_path / "cell.yaml"
    text = cell.read_text().replace("\nrobot: ir361", "\nrobot: ./robot.yaml")
    cell.write_text(text.replace("\nplant: ir361", "\nplant: ./plant.yaml"))
    loaded = load_cell(str(cell))
    assert {path.name for path in loaded.hashes} == {"cell.yaml", "robot.yaml", "plant.yaml"}
    for path in loaded.paths:
        content = path.read_bytes()
        path.write_bytes(content + b"# changed\n")
        approve_files({str(each): found for each, found in loaded.hashes.items()})
        with pytest.raises(ConfigError) as caught:
            load_cell(str(cell))
        assert caught.value.refusal == "RID-JOB-FILES"
        approve_files({})
        path.write_bytes(content)


@pytest.mark.parametrize("name", ["motion.yaml", "rows.csv", "model.json"])
def test_motions_tables_and_models_are_checked(tmp_path: Path, name: str) -> None:
    (tmp_path / "motion.yaml").write_text("kind: joint_table\nrobot: ir361\nfile: rows.csv\n")
    (tmp_path / "rows.csv").write_text("time_s,axis1\n0,0\n0.5,0\n1,0\n")
    (tmp_path / "model.json").write_text("{}")
    path = approve_file(tmp_path / name)
    path.write_bytes(path.read_bytes() + b" ")
    read = read_estimate if name == "model.json" else load_motion
    with pytest.raises(ConfigError) as caught:
        read(path if name == "model.json" else tmp_path / "motion.yaml")
    assert caught.value.refusal == "RID-JOB-FILES"
