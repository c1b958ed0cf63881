"""Commands that read a run refuse foreign and missing files in its folder."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import JournalWriter, read_journal
from acquisition.journal.header import JournalHeader
from acquisition.motion.samples import Phase
from acquisition.processing.periods import average_periods
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RECORDING, RunStatus
from config.errors import RecordingError
from config.load import load_cell, to_yaml
from dynamics.model.robot_model import RobotModel, torque
from dynamics.model.true_parameters import true_parameters
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.file import write_estimate
from identification.estimation.fitted_periods import fit_periodic
from rid_daq.app import run
from rid_daq.runs.run_data import RunData
from tests.builders.told import document

CYCLE_S = 0.008
PERIODS = 4
TORN_ROWS = 137
READERS = (
    "average RUN",
    "identify RUN",
    "validate MODEL RUN",
    "payload identify --loaded RUN --unloaded OTHER",
    "friction RUN",
    "loop RUN",
    "tracking RUN",
    "refine RUN --model MODEL --loop MODEL -o NEW",
    "compare RUN MODEL",
    "export RUN --to csv -o NEW",
)

Made = Callable[..., RunFolder]
Measured = Callable[[str], None]


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("workshop")


@pytest.fixture(scope="module")
def make(workshop: Path) -> Made:
    """Return a function that writes a run of the bundled arm like `record` and `identify`."""
    cell = load_cell("ir361")
    model = RobotModel.from_description(cell.robot)
    assert cell.plant is not None
    truth = true_parameters(model, cell.robot, cell.plant)

    def made(label: str, seed: int, status: RunStatus | None = RunStatus.COMPLETE) -> RunFolder:
        motion = design_two_harmonic(
            cell.robot,
            TwoHarmonicOptions(5.0, highest_harmonic=6, tries=5, periods=PERIODS, seed=seed),
            CYCLE_S,
        )
        path = motion.trajectory(cell.robot, CYCLE_S)
        times = path.sample_times_s
        q, v, a = path.position(times), path.velocity(times), path.acceleration(times)
        count = PERIODS * len(times)
        rows = np.zeros(count, dtype=row_dtype(3))
        rows["time_s"] = np.arange(count) * CYCLE_S
        rows["cycle"] = rows["sample_index"] = np.arange(count)
        rows["position"] = np.tile(q, (PERIODS, 1))
        rows["torque_nm"] = np.tile(torque(model, q, v, a, truth), (PERIODS, 1))
        rows["torque_nm"] += np.random.default_rng(seed).standard_normal((count, 3))
        rows["valid"], rows["phase"] = 1, Phase.MAIN
        folder = RunFolder.create(workshop / "runs", label)
        for name, content in cell.files.items():
            folder.write(name, content)
        folder.write("motion.yaml", to_yaml(motion).encode())
        header = JournalHeader(
            joint_names=cell.robot.joint_names,
            sample_period_s=CYCLE_S,
            samples_per_period=len(times),
            robot_name=cell.robot.name,
            run_id=folder.run_id,
        )
        with JournalWriter(folder.file(RECORDING), header) as writer:
            for start in range(0, count, 10):
                writer.append(rows[start : start + 10].tobytes())
            if status is None:
                writer.flush()
                writer.abandon()
        if status is not None:
            average = average_periods(read_journal(folder.file(RECORDING)).recording())
            write_estimate(
                folder.path / "model.json", fit_periodic(cell.robot, [average]).estimate()
            )
            folder.finish(status, {"rows": count})
        return folder

    return made


@pytest.fixture(scope="module")
def good(make: Made) -> RunFolder:
    return make("good", 1)


@pytest.fixture(scope="module")
def other(make: Made) -> RunFolder:
    """Return a run of another motion."""
    return make("other", 2)


@pytest.fixture(scope="module")
def killed(make: Made) -> RunFolder:
    """Return the unfinished run of a killed program."""
    return make("killed", 3, None)


@pytest.fixture
def copy(good: RunFolder, workshop: Path, tmp_path: Path) -> RunFolder:
    """Return a copy of the good run, for tests that damage it."""
    place = workshop / "runs" / tmp_path.name
    shutil.copytree(good.path, place)
    return RunFolder.open(place)


def words(reader: str, folder: RunFolder, other: RunFolder, tmp_path: Path) -> list[str]:
    """Return the command line of a command that reads a run."""
    meant = {
        "RUN": str(folder.path),
        "OTHER": str(other.path),
        "MODEL": str(other.path / "model.json"),
        "NEW": str(tmp_path / "new"),
    }
    return [meant.get(word, word) for word in reader.split()]


def snapshot(folder: RunFolder) -> dict[str, bytes]:
    return {str(p.relative_to(folder.path)): p.read_bytes() for p in folder.path.rglob("*.*")}


def another_recording(folder: RunFolder, other: RunFolder) -> str:
    shutil.copy(other.path / RECORDING, folder.path)
    return RECORDING


def another_gear(folder: RunFolder, _other: RunFolder) -> str:
    path = folder.path / "robot.yaml"
    text = path.read_text()
    assert text.count("gear_ratio: 121") == 1
    path.write_text(text.replace("gear_ratio: 121", "gear_ratio: 60"))
    return "robot.yaml"


def another_motion(folder: RunFolder, other: RunFolder) -> str:
    shutil.copy(other.path / "motion.yaml", folder.path)
    return "motion.yaml"


def no_cell(folder: RunFolder, _other: RunFolder) -> str:
    (folder.path / "cell.yaml").unlink()
    return "cell.yaml"


def a_feedforward(folder: RunFolder, _other: RunFolder) -> str:
    (folder.path / "feedforward.json").write_text("{}")
    return "feedforward.json"


@pytest.mark.fault(42)
@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (another_recording, "; it is the file of run {other} (other)"),
        (another_gear, "is not the file of run {good} (its SHA-256 differs)"),
        (another_motion, "; it is the file of run {other} (other)"),
        (no_cell, "is missing. Restore the original file"),
        (a_feedforward, "was put into the folder after the run had ended. Remove it"),
    ],
)
def test_every_reader_refuses_and_names_a_foreign_file_in_a_run(
    copy: RunFolder,
    good: RunFolder,
    other: RunFolder,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Measured,
    spoil: Callable[[RunFolder, RunFolder], str],
    why: str,
) -> None:
    name = spoil(copy, other)
    before = snapshot(copy)
    refused = []
    for reader in READERS:
        code = run(words(reader, copy, other, tmp_path))
        said = capsys.readouterr().err
        assert code == 7, (reader, said)
        assert f"{copy.path / name}: " in said, reader
        assert why.format(good=good.run_id, other=other.run_id) in said, reader
        refused.append(reader)
    assert snapshot(copy) == before
    assert not (tmp_path / "new").exists()
    measured(f"{name}: refused and named by {len(refused)} of {len(refused)} readers")


@pytest.mark.fault(42)
def test_a_recording_with_another_run_id_is_refused_without_a_hash(
    killed: RunFolder,
    other: RunFolder,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Measured,
) -> None:
    shutil.copytree(killed.path, tmp_path / "copy")
    shutil.copy(other.path / RECORDING, tmp_path / "copy")
    for command in ("average", "recover"):
        options = ["--unfinished"] if command == "average" else []
        assert run([command, str(tmp_path / "copy"), *options]) == 7
        said = capsys.readouterr().err
        assert f"belongs to run {other.run_id}, not to {killed.run_id}" in said
    assert [path.name for path in tmp_path.iterdir()] == ["copy"]
    measured("by the recording's header: refused by average and recover, nothing written")


@pytest.mark.fault(42)
def test_no_report_is_made_from_an_edited_result(
    copy: RunFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["average", str(copy.path)]) == 0
    path = copy.path / "result.json"
    path.write_text(path.read_text().replace("Run good", "Run better"))
    capsys.readouterr()
    for command in ("report", "average"):
        assert run([command, str(copy.path)]) == 7
        assert "RID-RUN-CHANGED" in capsys.readouterr().err
    path.unlink()
    assert run(["average", str(copy.path)]) == 0


def test_a_run_whose_manifest_names_no_files_is_refused(copy: RunFolder) -> None:
    path = copy.path / "manifest.json"
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps({**manifest, "files": {}}))
    assert run(["average", str(copy.path)]) == 7


@pytest.mark.fault(47)
def test_an_unfinished_run_is_used_only_with_unfinished_and_is_noted(
    killed: RunFolder,
    other: RunFolder,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Measured,
) -> None:
    folder = RunFolder.open(Path(shutil.copytree(killed.path, tmp_path / "copy")))
    folder.write("model.json", (other.path / "model.json").read_bytes())
    before = snapshot(folder)
    for reader in READERS:
        assert run(words(reader, folder, other, tmp_path)) == 6, reader
        said = capsys.readouterr().err
        assert "was never finished, because the program ended first. Write its" in said
        assert f"`rid-daq recover {folder.path}`" in said
        assert "use it as it is: --unfinished" in said
    assert snapshot(folder) == before
    note = "killed: the run was never finished, so its end is missing"
    assert run(["average", str(folder.path), "--unfinished"]) == 0
    assert f"note: {note}\n" in capsys.readouterr().out
    assert run(["identify", str(folder.path), "--unfinished", "--json"]) == 0
    assert note in document(capsys)["notes"]
    assert note in json.loads((folder.path / "result.json").read_text())["notes"]
    assert f"Note: {note}" in (folder.path / "report.html").read_text()
    measured(
        f"refused by {len(READERS)} of {len(READERS)} readers; with --unfinished used and said"
    )


@pytest.mark.fault(45)
def test_a_truncated_run_is_recovered_without_results_and_lost_rows_are_counted(
    copy: RunFolder, capsys: pytest.CaptureFixture[str], measured: Measured
) -> None:
    assert run(["average", str(copy.path)]) == 0
    whole = read_journal(copy.path / RECORDING).rows
    size = (copy.path / RECORDING).stat().st_size
    os.truncate(copy.path / RECORDING, size - size // 3)
    kept = read_journal(copy.path / RECORDING).rows
    capsys.readouterr()
    assert run(["average", str(copy.path)]) == 7
    assert "RID-RUN-CHANGED" in capsys.readouterr().err
    assert run(["recover", str(copy.path), "--json"]) == 1
    told = document(capsys)
    assert told["rows_lost"] == len(whole) - len(kept) > 500
    new = RunFolder.open(Path(told["recovered"]))
    assert new.manifest().facts["rows_lost"] == told["rows_lost"]
    assert new.manifest().facts["rows"] == len(kept)
    assert {path.name for path in new.path.iterdir()}.isdisjoint(
        {"result.json", "report.html", "model.json"}
    )
    assert new.verify() == ()
    assert run(["average", str(new.path)]) == 0
    said = capsys.readouterr().out
    assert (
        f"note: good: the run was recovered; {told['rows_lost']} rows are known to be lost\n"
        in said
    )
    measured(f"{told['rows_lost']} of {len(whole)} rows lost, counted exactly; no result copied")


@pytest.mark.fault(45)
def test_all_rows_of_a_missing_recording_count_as_lost(
    copy: RunFolder, good: RunFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = len(read_journal(good.path / RECORDING).rows)
    (copy.path / RECORDING).rename(copy.path / "second.mcap")
    assert run(["recover", str(copy.path), "--json"]) == 1
    assert document(capsys)["rows_lost"] == rows


def test_a_file_omitted_by_recover_can_only_be_replaced_by_the_original(
    copy: RunFolder, good: RunFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    another_gear(copy, copy)
    assert run(["recover", str(copy.path), "--json"]) == 0
    told = document(capsys)
    assert any(
        note.startswith("left out: robot.yaml: its SHA-256 differs") for note in told["notes"]
    )
    new = Path(told["recovered"])
    assert run(["average", str(new)]) == 7
    assert "RID-RUN-CHANGED" in capsys.readouterr().err
    shutil.copy(copy.path / "robot.yaml", new)
    assert run(["average", str(new)]) == 7
    shutil.copy(good.path / "robot.yaml", new)
    assert run(["average", str(new)]) == 0


@pytest.mark.parametrize("named", ["", "01ABCDEFGHJKMNPQRSTVWXYZ00"])
def test_a_recording_without_a_run_id_is_refused(
    named: str, killed: RunFolder, tmp_path: Path
) -> None:
    folder = RunFolder.open(shutil.copytree(killed.path, tmp_path / "copy"))
    journal = folder.file(RECORDING)
    journal.unlink()
    header = JournalHeader(
        joint_names=("axis1", "axis2", "axis3"), sample_period_s=CYCLE_S, run_id=named
    )
    rows = np.zeros(10, dtype=row_dtype(3))
    rows["time_s"] = CYCLE_S * np.arange(10)
    with JournalWriter(journal, header) as writer:
        writer.append(rows.tobytes())
    with pytest.raises(RecordingError) as refused:
        RunData.load(folder, unfinished=True)
    assert refused.value.refusal == "RID-RUN-MIXED", refused.value
