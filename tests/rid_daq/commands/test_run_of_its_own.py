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
from tests.builders.json_output import document

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
def make_run(workshop: Path) -> Made:
    """Return a function that writes a run of the bundled arm as `record` and `identify` write
    it.
    """
    cell = load_cell("ir361")
    model = RobotModel.from_description(cell.robot)
    assert cell.plant is not None
    truth = true_parameters(model, cell.robot, cell.plant)

    def write_run(
        label: str, seed: int, status: RunStatus | None = RunStatus.COMPLETE
    ) -> RunFolder:
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

    return write_run


@pytest.fixture(scope="module")
def good_run(make_run: Made) -> RunFolder:
    return make_run("good", 1)


@pytest.fixture(scope="module")
def other_run(make_run: Made) -> RunFolder:
    """Return a run of another motion."""
    return make_run("other", 2)


@pytest.fixture(scope="module")
def unfinished_run(make_run: Made) -> RunFolder:
    return make_run("killed", 3, None)


@pytest.fixture
def copied_run(good_run: RunFolder, workshop: Path, tmp_path: Path) -> RunFolder:
    """Return a copy of the good run, for tests that damage it."""
    place = workshop / "runs" / tmp_path.name
    shutil.copytree(good_run.path, place)
    return RunFolder.open(place)


def reader_words(reader: str, folder: RunFolder, other_run: RunFolder, tmp_path: Path) -> list[str]:
    """Return the command line of a command that reads a run."""
    replacements = {
        "RUN": str(folder.path),
        "OTHER": str(other_run.path),
        "MODEL": str(other_run.path / "model.json"),
        "NEW": str(tmp_path / "new"),
    }
    return [replacements.get(word, word) for word in reader.split()]


def file_contents(folder: RunFolder) -> dict[str, bytes]:
    return {str(p.relative_to(folder.path)): p.read_bytes() for p in folder.path.rglob("*.*")}


def use_other_recording(folder: RunFolder, other_run: RunFolder) -> str:
    shutil.copy(other_run.path / RECORDING, folder.path)
    return RECORDING


def change_gear(folder: RunFolder, _other: RunFolder) -> str:
    path = folder.path / "robot.yaml"
    text = path.read_text()
    assert text.count("gear_ratio: 121") == 1
    path.write_text(text.replace("gear_ratio: 121", "gear_ratio: 60"))
    return "robot.yaml"


def use_other_motion(folder: RunFolder, other_run: RunFolder) -> str:
    shutil.copy(other_run.path / "motion.yaml", folder.path)
    return "motion.yaml"


def delete_cell(folder: RunFolder, _other: RunFolder) -> str:
    (folder.path / "cell.yaml").unlink()
    return "cell.yaml"


def add_feedforward(folder: RunFolder, _other: RunFolder) -> str:
    (folder.path / "feedforward.json").write_text("{}")
    return "feedforward.json"


@pytest.mark.fault(42)
@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (use_other_recording, "; it is the file of run {other} (other)"),
        (change_gear, "is not the file of run {good} (its SHA-256 differs)"),
        (use_other_motion, "; it is the file of run {other} (other)"),
        (delete_cell, "is missing. Restore the original file"),
        (add_feedforward, "was put into the folder after the run had ended. Remove it"),
    ],
)
def test_every_reader_refuses_and_names_a_foreign_file_in_a_run(
    copied_run: RunFolder,
    good_run: RunFolder,
    other_run: RunFolder,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Measured,
    spoil: Callable[[RunFolder, RunFolder], str],
    why: str,
) -> None:
    name = spoil(copied_run, other_run)
    before = file_contents(copied_run)
    refused = []
    for reader in READERS:
        code = run(reader_words(reader, copied_run, other_run, tmp_path))
        output = capsys.readouterr().err
        assert code == 7, (reader, output)
        assert f"{copied_run.path / name}: " in output, reader
        assert why.format(good=good_run.run_id, other=other_run.run_id) in output, reader
        refused.append(reader)
    assert file_contents(copied_run) == before
    assert not (tmp_path / "new").exists()
    measured(f"{name}: {len(refused)} of {len(refused)} commands refuse the run and name the file")


@pytest.mark.fault(42)
def test_a_recording_with_another_run_id_is_refused_without_a_hash(
    unfinished_run: RunFolder,
    other_run: RunFolder,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Measured,
) -> None:
    shutil.copytree(unfinished_run.path, tmp_path / "copy")
    shutil.copy(other_run.path / RECORDING, tmp_path / "copy")
    for command in ("average", "recover"):
        options = ["--unfinished"] if command == "average" else []
        assert run([command, str(tmp_path / "copy"), *options]) == 7
        output = capsys.readouterr().err
        assert f"belongs to run {other_run.run_id}, not to {unfinished_run.run_id}" in output
    assert [path.name for path in tmp_path.iterdir()] == ["copy"]
    measured("run id in the recording's header: refused by average and recover, nothing written")


@pytest.mark.fault(42)
def test_no_report_is_made_from_an_edited_result(
    copied_run: RunFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["average", str(copied_run.path)]) == 0
    path = copied_run.path / "result.json"
    path.write_text(path.read_text().replace("Run good", "Run better"))
    capsys.readouterr()
    for command in ("report", "average"):
        assert run([command, str(copied_run.path)]) == 7
        assert "RID-RUN-CHANGED" in capsys.readouterr().err
    path.unlink()
    assert run(["average", str(copied_run.path)]) == 0


def test_a_run_whose_manifest_names_no_files_is_refused(copied_run: RunFolder) -> None:
    path = copied_run.path / "manifest.json"
    manifest = json.loads(path.read_text())
    path.write_text(json.dumps({**manifest, "files": {}}))
    assert run(["average", str(copied_run.path)]) == 7


@pytest.mark.fault(47)
def test_an_unfinished_run_is_used_only_with_unfinished_and_is_noted(
    unfinished_run: RunFolder,
    other_run: RunFolder,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    measured: Measured,
) -> None:
    folder = RunFolder.open(Path(shutil.copytree(unfinished_run.path, tmp_path / "copy")))
    folder.write("model.json", (other_run.path / "model.json").read_bytes())
    before = file_contents(folder)
    for reader in READERS:
        assert run(reader_words(reader, folder, other_run, tmp_path)) == 6, reader
        output = capsys.readouterr().err
        assert "was never finished, because the program ended first. Write its" in output
        assert f"`rid-daq recover {folder.path}`" in output
        assert "use it as it is: --unfinished" in output
    assert file_contents(folder) == before
    note = "killed: the run was never finished, so its end is missing"
    assert run(["average", str(folder.path), "--unfinished"]) == 0
    assert f"note: {note}\n" in capsys.readouterr().out
    assert run(["identify", str(folder.path), "--unfinished", "--json"]) == 0
    assert note in document(capsys)["notes"]
    assert note in json.loads((folder.path / "result.json").read_text())["notes"]
    assert f"Note: {note}" in (folder.path / "report.html").read_text()
    measured(
        f"{len(READERS)} of {len(READERS)} commands refuse the run; with --unfinished they use it"
        " and report this"
    )


@pytest.mark.fault(45)
def test_a_truncated_run_is_recovered_without_results_and_lost_rows_are_counted(
    copied_run: RunFolder, capsys: pytest.CaptureFixture[str], measured: Measured
) -> None:
    assert run(["average", str(copied_run.path)]) == 0
    whole = read_journal(copied_run.path / RECORDING).rows
    size = (copied_run.path / RECORDING).stat().st_size
    os.truncate(copied_run.path / RECORDING, size - size // 3)
    kept = read_journal(copied_run.path / RECORDING).rows
    capsys.readouterr()
    assert run(["average", str(copied_run.path)]) == 7
    assert "RID-RUN-CHANGED" in capsys.readouterr().err
    assert run(["recover", str(copied_run.path), "--json"]) == 1
    result = document(capsys)
    assert result["rows_lost"] == len(whole) - len(kept) > 500
    new = RunFolder.open(Path(result["recovered"]))
    assert new.manifest().facts["rows_lost"] == result["rows_lost"]
    assert new.manifest().facts["rows"] == len(kept)
    assert {path.name for path in new.path.iterdir()}.isdisjoint(
        {"result.json", "report.html", "model.json"}
    )
    assert new.verify() == ()
    assert run(["average", str(new.path)]) == 0
    output = capsys.readouterr().out
    assert (
        f"note: good: the run was recovered; {result['rows_lost']} rows are known to be lost\n"
        in output
    )
    measured(f"{result['rows_lost']} of {len(whole)} rows lost, counted exactly; no result copied")


@pytest.mark.fault(45)
def test_all_rows_of_a_missing_recording_count_as_lost(
    copied_run: RunFolder, good_run: RunFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    rows = len(read_journal(good_run.path / RECORDING).rows)
    (copied_run.path / RECORDING).rename(copied_run.path / "second.mcap")
    assert run(["recover", str(copied_run.path), "--json"]) == 1
    assert document(capsys)["rows_lost"] == rows


def test_a_file_omitted_by_recover_can_only_be_replaced_by_the_original(
    copied_run: RunFolder, good_run: RunFolder, capsys: pytest.CaptureFixture[str]
) -> None:
    change_gear(copied_run, copied_run)
    assert run(["recover", str(copied_run.path), "--json"]) == 0
    result = document(capsys)
    assert any(
        note.startswith("left out: robot.yaml: its SHA-256 differs") for note in result["notes"]
    )
    new = Path(result["recovered"])
    assert run(["average", str(new)]) == 7
    assert "RID-RUN-CHANGED" in capsys.readouterr().err
    shutil.copy(copied_run.path / "robot.yaml", new)
    assert run(["average", str(new)]) == 7
    shutil.copy(good_run.path / "robot.yaml", new)
    assert run(["average", str(new)]) == 0


@pytest.mark.parametrize("named", ["", "01ABCDEFGHJKMNPQRSTVWXYZ00"])
def test_a_recording_without_a_run_id_is_refused(
    named: str, unfinished_run: RunFolder, tmp_path: Path
) -> None:
    folder = RunFolder.open(shutil.copytree(unfinished_run.path, tmp_path / "copy"))
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
