"""`--load-changes`: a payload that is taken up or put down during a motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.load_changes import (
    LoadChange,
    LoadChanges,
    SimulatedChange,
    read_load_changes,
)
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from compensation.feedforward.file import FeedforwardFile, read_feedforward
from config.errors import ConfigError
from config.load import load_cell, to_yaml
from config.simulation.plant import MountedBody
from identification.estimation.file import write_estimate
from rid_daq.app import run
from rid_daq.runs.changed_load import LOAD_CHANGES, load_changes_bytes
from rid_daq.runs.run_data import RunData
from rid_daq.session.scenario import Scenario, constant_load_notes, load_transfers
from tests.builders.certified import MEDIUM, write_payload_file
from tests.builders.identified_run import arm_in_motion, identified_run
from tests.builders.json_output import document
from tests.builders.known_model import joint_path, write_path_files
from tests.builders.raised_codes import raises_code, raises_invalid

PATH = joint_path([0.0, 0.0, 0.0], [0.4, 0.3, -0.4], [0.0, 0.2, 0.3])
CHANGES = """
changes:
- {at_s: 1.0, payload: payload.json, ramp_s: 0.1, simulated: {payload: tool}}
- {at_s: 2.0, payload: none, ramp_s: 0.2}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a path, models, loops, a payload and a load-change file."""
    folder = tmp_path_factory.mktemp("loads")
    write_path_files(folder, PATH)
    (folder / "loads.yaml").write_text(CHANGES)
    return folder


def compensate(folder: Path, *words: str, model: str = "alone") -> int:
    files = [f"{folder}/path.yaml", "--model", f"{folder}/{model}.json"]
    more = ["--loop", f"{folder}/loops.json", "-o", f"{folder}/ff.json", "--overwrite"]
    return run(["compensate", "ir361", *files, *more, *words])


def feedforward(folder: Path, *words: str, model: str = "alone") -> FeedforwardFile:
    assert compensate(folder, *words, model=model) == 0
    return read_feedforward(folder / "ff.json")


def test_the_feedforward_contains_the_changes_and_names_their_payloads(folder: Path) -> None:
    changing = feedforward(folder, "--load-changes", f"{folder}/loads.yaml")
    empty = np.array(feedforward(folder).feedforward)
    loaded = np.array(feedforward(folder, "--payload", f"{folder}/payload.json").feedforward)
    found = np.array(changing.feedforward)
    time_s = np.arange(len(found)) * 0.008
    most = np.abs(loaded - empty).max()
    assert np.abs(found - empty)[(time_s > 0.1) & (time_s < 0.8)].max() < 0.03 * most
    assert np.abs(found - empty)[(time_s > 1.0) & (time_s < 1.1)].max() > 0.1 * most
    changes = changing.origin.load_changes
    assert changes is not None
    assert [len(each.payload) for each in changes.changes] == [64, 4]


def test_the_payload_of_the_model_can_be_taken_up(folder: Path) -> None:
    by_file = feedforward(folder, "--load-changes", f"{folder}/loads.yaml")
    (folder / "by model.yaml").write_text(CHANGES.replace("payload.json", "model"))
    words = ("--load-changes", f"{folder}/by model.yaml", "--payload", "none")
    by_model = feedforward(folder, *words, model="both")
    np.testing.assert_allclose(by_file.feedforward, by_model.feedforward, rtol=1e-6, atol=1e-8)


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ("at_s: 2.0", "at_s: 1.05", "RID-FILE-VALUE"),
        ("at_s: 2.0", "at_s: 600.0", "RID-LOAD-CHANGE-TIME"),
        ("payload: payload.json", "payload: ../payload.json", "RID-FILE-VALUE"),
        ("payload: payload.json", "payload: nowhere.json", "RID-FILE-READ"),
        ("payload: payload.json", "payload: loops.json", "RID-FILE-TYPE"),
        ("payload: payload.json", "payload: model", "RID-PAYLOAD-UNSTATED"),
        ("ramp_s: 0.1", "ramp_s: 100", "RID-FILE-VALUE"),
    ],
)
def test_unusable_changes_are_refused(
    folder: Path, old: str, new: str, code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "wrong.yaml").write_text(CHANGES.replace(old, new))
    assert compensate(folder, "--load-changes", f"{folder}/wrong.yaml") == 2
    assert code in capsys.readouterr().err


def test_a_torque_beyond_its_limit_after_a_change_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The limits hold for the load at each time, not only for that at the beginning."""
    write_payload_file(folder / "heavy.json", 20.0 * MEDIUM.parameters)
    (folder / "heavy.yaml").write_text(CHANGES.replace("payload.json", "heavy.json"))
    words = ["record", "ir361", f"{folder}/path.yaml", "--model", f"{folder}/alone.json"]
    words += ["--load-changes", f"{folder}/heavy.yaml", "--runs", f"{folder}/heavy runs"]
    assert run(words) == 3
    assert "RID-MOTION-LIMIT" in capsys.readouterr().err


RECORDINGS = {
    "points of a socket": ("stream", "--socket", "points", "--load-changes", "loads.yaml"),
    "rehearsal": ("record", "path.yaml", "--rehearse", "--load-changes", "loads.yaml"),
    "a feedforward for one load": (
        *("record", "path.yaml", "--feedforward", "constant.json"),
        *("--load-changes", "loads.yaml"),
    ),
    "a torque check for one load": (
        *("record", "path.yaml", "--feedforward", "changing.json", "--model", "alone.json"),
        *("--payload", "none"),
    ),
}


@pytest.mark.parametrize(
    ("name", "code"),
    [
        ("points of a socket", "RID-OPTION-NEEDS"),
        ("rehearsal", "RID-OPTION-EXCLUSIVE"),
        ("a feedforward for one load", "RID-LOAD-CHANGES"),
        ("a torque check for one load", "RID-LOAD-CHANGES"),
    ],
)
def test_nothing_ignores_a_change_silently(
    folder: Path, name: str, code: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for file, words in (
        ("constant", ()),
        ("changing", ("--load-changes", f"{folder}/loads.yaml")),
    ):
        feedforward(folder, *words)
        (folder / "ff.json").rename(folder / f"{file}.json")
    command, *given = RECORDINGS[name]
    full = [str(folder / word) if "." in word else word for word in given]
    if command == "stream":
        full += ["--model", f"{folder}/alone.json", "--loop", f"{folder}/loops.json"]
    assert run([command, "ir361", *full, "--runs", f"{folder}/runs"]) == 2
    assert code in capsys.readouterr().err
    assert not (folder / "runs").exists()


@pytest.fixture(scope="module")
def changed_run(tmp_path_factory: pytest.TempPathFactory) -> RunFolder:
    """Return a run with a load change; a model is next to the folder of runs."""
    root = tmp_path_factory.mktemp("changed")
    write_estimate(root / "model.json", identified_run(root / "runs", arm_in_motion(), "one", 1))
    folder = find_run(root / "runs", "one")
    change = LoadChange(at_s=2.0, payload="none", ramp_s=0.1)
    folder.write(LOAD_CHANGES, load_changes_bytes(LoadChanges(changes=(change,))))
    return folder


@pytest.mark.parametrize(
    "words",
    [
        ("identify", "one"),
        ("validate", "model.json", "one"),
        ("compare", "model.json", "model.json", "--on", "one"),
        ("payload", "identify", "--loaded", "one", "--model", "model.json"),
        ("refine", "one", "--model", "model.json", "--loop", "loops.json", "-o", "out.json"),
        ("friction", "one"),
    ],
)
def test_a_run_with_changes_is_refused_by_commands_for_one_payload(
    changed_run: RunFolder, words: tuple[str, ...], capsys: pytest.CaptureFixture[str]
) -> None:
    root = changed_run.path.parent.parent
    full = [str(root / word) if word.endswith(".json") else word for word in words]
    assert run([*full, "--runs", str(root / "runs")]) == 6
    assert "RID-LOAD-CHANGES" in capsys.readouterr().err


def test_a_table_of_a_run_is_exported_with_a_note_on_its_changes(
    changed_run: RunFolder, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = str(changed_run.path.parent)
    words = ["export", "one", "--to", "csv", "-o", str(tmp_path / "table.csv"), "--runs", runs]
    assert run([*words, "--json"]) == 0
    (note,) = document(capsys)["notes"]
    assert "at 2 s" in note


def test_simulated_changes_must_not_overlap() -> None:
    late = SimulatedChange(payload="tool", late_s=1.0)
    first = LoadChange(at_s=1.0, payload="none", ramp_s=0.1, simulated=late)
    second = LoadChange(
        at_s=1.5, payload="none", ramp_s=0.1, simulated=SimulatedChange(payload="none")
    )
    with raises_invalid("", "2.1 s"):
        LoadChanges(changes=(first, second))


TOOL = MountedBody(
    mass_kg=4.0, centre_m=(0.8, 0.02, 0.01), inertia_kg_m2=(0.02, 0.03, 0.03, 0.0, 0.0, 0.0)
)
TAKEN_UP = """
changes:
- {at_s: 1.0, payload: none, ramp_s: 0.1, simulated: {payload: tool, late_s: 0.5}}
- {at_s: 2.0, payload: none, ramp_s: 0.1}
"""


@pytest.fixture(scope="module")
def simulated(folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a cell whose robot can carry a tool, and a load-change file."""
    root = tmp_path_factory.mktemp("simulated")
    bundled = load_cell("ir361")
    assert bundled.plant is not None
    plant = bundled.plant.model_copy(update={"payloads": {"tool": TOOL}})
    (root / "plant.yaml").write_text(to_yaml(plant))
    changes = {"plate": None, "name": "gripping", "plant": str(root / "plant.yaml")}
    (root / "cell.yaml").write_text(to_yaml(bundled.config.model_copy(update=changes)))
    (root / "loads.yaml").write_text(TAKEN_UP)
    (root / "still.yaml").write_text(
        "{kind: joint_path, robot: ir361, speed_fraction: 0.05, dwell_s: 3.0,"
        " points: [[0.0, 0.0, 0.0], [0.02, 0.02, 0.02]]}"
    )
    for name in ("alone.json", "loops.json"):
        (root / name).write_bytes((folder / name).read_bytes())
    return root


@pytest.mark.slow
@pytest.mark.parametrize("command", ["record", "stream"])
def test_a_simulated_robot_takes_up_its_payload_at_its_own_time(
    simulated: Path, command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = ["--runs", str(simulated / "runs")]
    words = [command, str(simulated / "cell.yaml"), str(simulated / "still.yaml"), *runs]
    words += ["--load-changes", str(simulated / "loads.yaml"), "--label", command]
    by = ["--model", str(simulated / "alone.json"), "--loop", str(simulated / "loops.json")]
    assert run([*words, *(by if command == "stream" else ())]) == 0
    capsys.readouterr()
    data = RunData.load(find_run(simulated / "runs", command), changing_load=True)
    recording = data.recording
    time_s = recording.sample_index * load_cell("ir361").config.cycle_time_s
    torque = recording.torque_nm[:, 2]
    empty = torque[(time_s > 1.1) & (time_s < 1.4)].mean()
    carried = torque[(time_s > 1.7) & (time_s < 2.9)].mean()
    # axis 3 carries the tool on a horizontal lever of 0.8 m; static friction holds a part of it
    assert abs(abs(carried - empty) - 4.0 * 9.81 * 0.8) < 8.0
    tracking = ["tracking", command, *runs, "--model", str(simulated / "alone.json")]
    assert run(tracking) == 2
    assert "RID-LOAD-CHANGES" in capsys.readouterr().err
    assert run([*tracking, "--load-changes", str(simulated / "loads.yaml")]) == 0


def test_an_unknown_payload_of_a_simulated_robot_is_refused(
    simulated: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (simulated / "unknown.yaml").write_text(TAKEN_UP.replace("payload: tool", "payload: hammer"))
    words = ["record", str(simulated / "cell.yaml"), str(simulated / "still.yaml")]
    words += ["--load-changes", str(simulated / "unknown.yaml")]
    assert run([*words, "--runs", str(simulated / "no runs")]) == 2
    assert "RID-PLANT-UNFIT" in capsys.readouterr().err


def test_a_simulated_robot_that_ignores_a_change_is_noted(simulated: Path) -> None:
    changes = read_load_changes(simulated / "loads.yaml")
    config = load_cell("ir361").config
    assert len(constant_load_notes(changes, config)) == 1
    assert constant_load_notes(None, config) == []
    real = config.model_copy(update={"simulated": False})
    assert constant_load_notes(changes, real) == []


def test_another_process_that_simulates_the_robot_cannot_change_its_payload(
    simulated: Path,
) -> None:
    transfers = load_transfers(read_load_changes(simulated / "loads.yaml"))
    assert [(each.payload, each.begin_s) for each in transfers] == [("tool", 1.5)]
    config = load_cell("ir361").config
    with raises_code(ConfigError, "RID-CELL-NOT-OURS"):
        Scenario(load_transfers=transfers).refuse_foreign(config)
    real = config.model_copy(update={"simulated": False})
    Scenario(load_transfers=transfers).refuse_foreign(real)
