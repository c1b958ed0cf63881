"""`rid-daq drives`: backup and restore of the drives' objects, and rollback of writes."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from config.load import load_cell
from drivers.canopen.nmt import NmtCommand, nmt_frame
from drivers.cell import open_cell
from drivers.settings.saved_drive import DriveBackup, SavedDrive
from drivers.settings.write_log import DRIVE_WRITES
from rid_daq.app import run
from rid_daq.operations.cell.mock import MockRequest
from rid_daq.operations.cell.served_devices import serve_cell

pytestmark = pytest.mark.slow

KILLED_IN_SET_UP = """
import os, signal, sys
from config.load import load_cell
from drivers.cell import open_cell
from drivers.settings.write_log import WriteLog
from pathlib import Path

class Killed(WriteLog):
    changes = 0
    def add_change(self, *words):
        super().add_change(*words)
        self.changes += words[-1] is not None
        if self.changes == 40:
            os.kill(os.getpid(), signal.SIGKILL)

loaded = load_cell(sys.argv[1])
with open_cell(loaded.config, loaded.robot, Killed(Path(sys.argv[2]))) as cell:
    cell.axes.bring_up()
"""


class Workplace:
    """A cell whose simulated drives stay on between commands, and its runs."""

    def __init__(self, served: Path, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
        self.cell = str(served / "cell.yaml")
        self.motion = str(served / "validation.yaml")
        self.runs = folder / "runs"
        self._folder = folder
        self._capsys = capsys
        self._backups = 0

    def run(self, *words: str) -> tuple[int, dict[str, Any]]:
        """Run a command; return its exit status and its document."""
        self._capsys.readouterr()
        code = run([*words, "--runs", str(self.runs), "--json"])
        return code, json.loads(self._capsys.readouterr().out)

    def backup(self) -> Path:
        self._backups += 1
        path = self._folder / f"backup{self._backups}.json"
        assert run(["drives", "backup", self.cell, "-o", str(path)]) == 0
        return path

    def read_drives(self) -> tuple[SavedDrive, ...]:
        """Return the current objects of every drive."""
        return DriveBackup.read(self.backup()).drives

    def set(self, node: int, name: str, value: str) -> None:
        """Write an object of a drive, as another tool would."""
        assert (
            run(["drives", "restore", self.cell, str(self.edited_backup(node, name, value))]) == 0
        )

    def edited_backup(self, node: int, name: str, value: str) -> Path:
        """Return a backup of the drives in which one object has another value."""
        path = self.backup()
        document = json.loads(path.read_text())
        (drive,) = (each for each in document["drives"] if each["node_id"] == node)
        (setting,) = (each for each in drive["settings"] if each["object"] == name)
        setting["value"] = value
        path.write_text(json.dumps(document))
        return path


@pytest.fixture(scope="module")
def served(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    folder = tmp_path_factory.mktemp("drives")
    assert run(["init", str(folder)]) == 0
    cell, motion = folder / "cell.yaml", folder / "validation.yaml"
    cell.write_text(cell.read_text().replace("channel: my_cell", "channel: test_drives"))
    motion.write_text(motion.read_text().replace("points: 20", "points: 2"))
    with serve_cell(MockRequest(cell=str(cell), lockstep=True)):
        yield folder


@pytest.fixture
def workplace(
    served: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> Iterator[Workplace]:
    """Return the served cell; its drives are restored after the test."""
    place = Workplace(served, tmp_path, capsys)
    before = place.backup()
    yield place
    run(["drives", "restore", place.cell, str(before), "--runs", str(tmp_path)])


def test_rollback_restores_every_object_that_record_changed(
    workplace: Workplace,
) -> None:
    workplace.set(2, "1017h:00", "f401")  # objects that the reset of the communication restores
    before = workplace.read_drives()
    code, recorded = workplace.run("record", workplace.cell, workplace.motion)
    assert code == 0
    after = workplace.read_drives()
    assert before != after
    code, looked = workplace.run("drives", "rollback", workplace.cell, "latest", "--dry-run")
    assert code == 0
    assert {each["object"] for each in looked["settings"]} >= {"6007h:00", "6065h:00", "6085h:00"}
    assert workplace.read_drives() == after  # a backup changes nothing
    code, done = workplace.run("drives", "rollback", workplace.cell, recorded["folder"])
    assert code == 0
    assert all(each["restored"] for each in done["settings"])
    assert workplace.read_drives() == before
    assert json.loads((Path(recorded["folder"]) / "manifest.json").read_text())["files"][
        DRIVE_WRITES
    ]
    # A rollback also writes, and can be undone like other writes.
    assert workplace.run("drives", "rollback", workplace.cell, done["write_log"])[0] == 0
    assert workplace.read_drives() == after


def test_rollback_undoes_the_writes_of_a_killed_set_up(workplace: Workplace) -> None:
    before = workplace.read_drives()
    write_log = workplace.runs / "killed.jsonl"
    words = [sys.executable, "-c", KILLED_IN_SET_UP, workplace.cell, str(write_log)]
    assert subprocess.run(words, check=False).returncode == -signal.SIGKILL
    assert workplace.read_drives() != before
    code, _ = workplace.run("drives", "rollback", workplace.cell, str(write_log))
    assert code == 0
    assert workplace.read_drives() == before


def test_rollback_undoes_the_writes_of_a_check_by_its_write_log(workplace: Workplace) -> None:
    before = workplace.read_drives()
    code, checked = workplace.run("check", workplace.cell, "--seconds", "0.2")
    assert code == 0
    assert workplace.read_drives() != before
    rollback = ["drives", "rollback", workplace.cell, checked["drive_writes"]]
    assert workplace.run(*rollback)[0] == 0
    assert workplace.read_drives() == before


def test_restore_writes_a_backup(workplace: Workplace) -> None:
    path = workplace.backup()
    assert workplace.run("check", workplace.cell, "--seconds", "0.2")[0] == 0
    code, done = workplace.run("drives", "restore", workplace.cell, str(path))
    assert code == 0
    assert {each["node"] for each in done["settings"]} == {1, 2, 3}
    assert workplace.read_drives() == DriveBackup.read(path).drives


def test_restored_values_survive_a_reset_only_with_store(workplace: Workplace) -> None:
    path = workplace.edited_backup(3, "1017h:00", "e803")
    assert workplace.run("drives", "restore", workplace.cell, str(path))[0] == 0
    assert heartbeat_after_reset(workplace) == 0
    code, done = workplace.run("drives", "restore", workplace.cell, str(path), "--store")
    assert code == 0
    assert heartbeat_after_reset(workplace) == 1000
    assert workplace.run("drives", "rollback", workplace.cell, done["write_log"])[0] == 0
    assert heartbeat_after_reset(workplace) == 1000  # nothing is stored by default


def heartbeat_after_reset(workplace: Workplace) -> int:
    """Return the heartbeat time (1017h) of node 3 after a reset of the communication [ms]."""
    loaded = load_cell(workplace.cell)
    with open_cell(loaded.config, loaded.robot) as cell:
        cell.link.send(nmt_frame(NmtCommand.RESET_COMMUNICATION, 3))
        cell.clock.sleep_until(cell.clock.now_s() + 0.1)
        return cell.axes.service.ports()[2].read_int(0x1017, 0)


def test_restore_refuses_a_drive_with_another_serial_number(
    workplace: Workplace, capsys: pytest.CaptureFixture[str]
) -> None:
    path = workplace.backup()
    document = json.loads(path.read_text())
    document["drives"][1]["identity"]["serial"] = 4711
    path.write_text(json.dumps(document))
    assert workplace.run("check", workplace.cell, "--seconds", "0.2")[0] == 0
    before = workplace.read_drives()
    assert run(["drives", "restore", workplace.cell, str(path)]) == 3
    assert "RID-DRIVE-OTHER" in capsys.readouterr().err
    assert workplace.read_drives() == before


def test_an_object_that_a_drive_does_not_accept_is_named(
    workplace: Workplace, capsys: pytest.CaptureFixture[str]
) -> None:
    path = workplace.edited_backup(
        1, "608Fh:01", "00100000"
    )  # the drive does not accept this object
    assert run(["drives", "restore", workplace.cell, str(path)]) == 3
    output = capsys.readouterr().err
    assert all(part in output for part in ("axis1", "608Fh:01", "00004000h", "00001000h"))
    assert "RID-DRIVE-SETTINGS" in output


def test_a_backup_with_another_node_is_refused(
    workplace: Workplace, capsys: pytest.CaptureFixture[str]
) -> None:
    path = workplace.backup()
    document = json.loads(path.read_text())
    document["drives"][0]["node_id"] = 9
    path.write_text(json.dumps(document))
    assert run(["drives", "restore", workplace.cell, str(path)]) == 2
    assert "RID-CELL-JOINTS" in capsys.readouterr().err
