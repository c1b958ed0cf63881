"""`rid-daq import`: mistakes in a recording or its map, omitted rows, and sources of a run."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable
from dataclasses import fields, replace
from functools import partial
from importlib import resources
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.maps.import_map import load_import_map
from acquisition.runs.folder import RunFolder
from config.load import to_yaml
from identification.estimation.file import read_estimate
from rid_daq.app import run
from rid_daq.report.result_file import read_result
from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.runs.run_data import RunData
from tests.builders.console_blocks import assert_shown
from tests.builders.foreign_tables import as_lines, sound_table, two_joint_map, two_joint_robot
from tests.builders.screens import recorded_calls, require_fitting

Change = Callable[[np.ndarray], Any]


@pytest.fixture
def import_changed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> Callable[..., SimpleNamespace]:
    """Return a function that imports a table, with changes of the table and of its import map."""

    def imported_table(change: Change, *options: str, **map_keys: Any) -> SimpleNamespace:
        table = sound_table(800)
        change(table)
        (tmp_path / "rec.csv").write_text("\n".join(as_lines(table)))
        (tmp_path / "robot.yaml").write_text(to_yaml(two_joint_robot()))
        (tmp_path / "map.yaml").write_text(to_yaml(two_joint_map(robot="robot.yaml", **map_keys)))
        words = ["import", str(tmp_path / "rec.csv"), "--map", str(tmp_path / "map.yaml")]
        capsys.readouterr()
        with recorded_calls() as calls:
            code = run([*words, "--runs", str(tmp_path / "runs"), "--json", *options])
        if calls:
            require_fitting(["import", "rec.csv"], calls)
        out, err = capsys.readouterr()
        return SimpleNamespace(code=code, said=err, **(json.loads(out) if out else {}))

    return imported_table


def unchanged(table: np.ndarray) -> None:
    pass


def doubled(every: int) -> Change:
    def change(table: np.ndarray) -> None:
        table[1::every, 0] = table[:-1:every, 0]

    return change


def times(column: slice | int, factor: float) -> Change:
    def change(table: np.ndarray) -> None:
        table[:, column] *= factor

    return change


def stuck(table: np.ndarray) -> None:
    table[300:, 6] = 1.5


def shift_by_half_turn(table: np.ndarray) -> None:
    table[:, 2] += math.pi


@pytest.mark.parametrize(
    ("mistake", "change", "message"),
    [
        ("stamps doubled", doubled(10), r"80 with a repeated time stamp.*too coarse for the rows"),
        ("degrees", times(slice(1, 5), 57.3), r"probably in degrees: put `units: \{position: deg"),
        ("motor side", times(slice(1, 5), 100.0), r"measured at the motors: put `side: motor`"),
        ("zero elsewhere", shift_by_half_turn, r"set zero_offset of b in the map"),
        ("torque constant", times(6, 60.0), r"torques of b reach 240, but the robot file's limit"),
    ],
)  # fmt: skip
def test_a_serious_mistake_gives_exit_code_6_and_its_likely_cause(
    import_changed: Callable[..., SimpleNamespace],
    mistake: str,
    change: Change,
    message: str,
    tmp_path: Path,
) -> None:
    plausible = {"position": 10.0, "speed": 500.0, "torque": 200.0}
    imported = import_changed(
        change, plausible=plausible, implausible_on_purpose=["plausible.speed"]
    )
    assert imported.code == 6
    assert re.search(message, imported.said, re.DOTALL)
    assert not (tmp_path / "runs").exists()  # no run remains that could be used by mistake


@pytest.mark.parametrize(
    ("mistake", "change", "message"),
    [
        ("clock", times(0, 1.1), "The clock is wrong: velocities computed from positions"),
        ("one gear", times(1, 1.25), "a: its position moves 1.250 times as fast as its velocity"),
        ("stuck", stuck, "b: its torque (column 6) is constant at 1.5 from row 301 to row 800"),
    ],
)  # fmt: skip
def test_a_possible_mistake_is_a_finding_in_the_report(
    import_changed: Callable[..., SimpleNamespace], mistake: str, change: Change, message: str
) -> None:
    imported = import_changed(change)
    assert imported.code == 0
    (finding,) = imported.findings
    assert finding.startswith(message)
    page = Path(imported.report).read_text()
    assert message.replace("'", "&#39;") in page


def test_the_result_of_the_import_stays_in_the_report_if_its_verdict_changes(
    import_changed: Callable[..., SimpleNamespace],
) -> None:
    imported = import_changed(doubled(40), left_out_limit=0.1)
    folder = RunFolder.open(Path(imported.report).parent)
    before = read_result(folder)
    judged = VerdictSection.of([VerdictCheck.of("error", 1.0, "≤", 2.0, "%")], "Passed", "")
    page = write_result(folder, before.with_sections(verdict=judged)).read_text()
    assert before.runs is not None
    assert before.runs[0].imported == before.verdict.headline
    assert before.verdict.headline in page


def test_omitted_rows_are_counted_by_reason_and_the_map_sets_their_limit(
    import_changed: Callable[..., SimpleNamespace],
) -> None:
    imported = import_changed(doubled(10), left_out_limit=0.1)
    assert imported.code == 0
    assert imported.left_out == {"with a repeated time stamp": 80}
    assert "80 with a repeated time stamp" in Path(imported.report).read_text()


def test_each_range_of_rows_becomes_a_run(import_changed: Callable[..., SimpleNamespace]) -> None:
    both = import_changed(
        unchanged, "--rows", "1-400", "--rows", "401-", "--label", "a", "--label", "b"
    )
    assert [each["rows_used"] for each in both.runs] == [400, 400]
    uneven = import_changed(unchanged, "--rows", "1-400", "--rows", "401-", "--label", "a")
    assert uneven.code == 2
    assert "1 labels for 2 runs" in uneven.said


@pytest.mark.parametrize("label", ["b/c", "latest"])
def test_an_invalid_label_is_refused_before_any_run_exists(
    import_changed: Callable[..., SimpleNamespace], label: str, tmp_path: Path
) -> None:
    labels = ["--label", "a", "--label", label]
    both = import_changed(unchanged, "--rows", "1-400", "--rows", "401-", *labels)
    assert both.code == 2
    assert f"label {label!r}" in both.said
    assert not (tmp_path / "runs").exists()


@pytest.mark.parametrize(
    "keys",
    [
        {},
        {"period_s": 2.0},
        {
            "columns": 9,
            "joints": [
                {"joint": "a", "position": 1, "torque": 5, "temperature": 7},
                {"joint": "b", "position": 2, "torque": 6, "temperature": 8},
            ],
        },
    ],
    ids=["own stamps", "periods", "temperatures"],
)
def test_a_loaded_run_equals_its_imported_source_exactly(
    import_changed: Callable[..., SimpleNamespace],
    keys: dict[str, Any],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def add_temperatures(table: np.ndarray) -> None:
        if keys.get("columns") == 9:
            warmth = 25.0 + table[:, :1] * [1.0, 0.5]
            table.resize((800, 9), refcheck=False)
            table[:] = np.column_stack([sound_table(800), warmth])

    folder = RunFolder.open(Path(import_changed(add_temperatures, **keys).folder))
    import_map, robot = load_import_map(str(tmp_path / "map.yaml"))
    expected, report = import_csv(folder.file("source.csv"), import_map, robot)
    monkeypatch.setattr(
        "acquisition.imports.read.read_tables", None
    )  # the source must not be parsed again
    loaded = RunData.load(folder)
    differing = {"robot_name", "run_id", "import_report"}
    for name in {field.name for field in fields(expected)} - differing:
        left, right = getattr(loaded.recording, name), getattr(expected, name)
        assert (left is None) == (right is None), name
        if isinstance(left, np.ndarray):
            assert left.dtype == right.dtype
            assert left.tobytes() == right.tobytes(), name
        else:
            assert left == right, name
    assert loaded.import_report == replace(report, file="rec.csv", map_name="test")
    assert loaded.recording.run_id == folder.run_id
    assert "source.csv" in folder.manifest().files


def test_a_run_of_two_source_files_contains_and_reads_both(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = sound_table(400)
    joints = [
        {"joint": "a", "position": 1, "torque": 4},
        {"joint": "b", "position": 2, "torque": 5},
    ]
    np.savetxt(tmp_path / "q.csv", table[:, :3], delimiter=",")
    np.savetxt(tmp_path / "tau.csv", table[:, [0, 5, 6]], delimiter=",")
    (tmp_path / "robot.yaml").write_text(to_yaml(two_joint_robot()))
    changes = {"columns": 3, "further_files": [{"columns": 3}], "joints": joints}
    (tmp_path / "map.yaml").write_text(to_yaml(two_joint_map(robot="robot.yaml", **changes)))
    runs = ["--runs", str(tmp_path / "runs")]
    words = ["import", str(tmp_path / "q.csv"), str(tmp_path / "tau.csv")]
    assert run([*words, "--map", str(tmp_path / "map.yaml"), *runs, "--json"]) == 0
    folder = json.loads(capsys.readouterr().out)["folder"]
    recording = RunData.load(RunFolder.open(Path(folder))).recording
    np.testing.assert_array_equal(recording.position, table[:, 1:3])
    np.testing.assert_array_equal(recording.torque_nm, table[:, 5:7])


def test_import_identify_and_validate_report_the_number_of_repeated_rows(
    import_changed: Callable[..., SimpleNamespace],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def repeat_every_tenth_row(table: np.ndarray, torque_nm: float) -> None:
        row = np.repeat(np.arange(800), np.where(np.arange(800) % 10 == 9, 2, 1))[:800]
        turn = math.pi * 0.011 * row
        table[:, 0] = 0.011 * np.arange(800)
        for column, values in enumerate(
            [
                *(np.sin(turn), 0.5 * np.cos(0.7 * turn), math.pi * np.cos(turn)),
                *(
                    -0.35 * math.pi * np.sin(0.7 * turn),
                    torque_nm * np.sin(turn),
                    4.0 * np.cos(turn),
                ),
            ],
            start=1,
        ):
            table[:, column] = values

    for label, torque_nm in (("first", 3.0), ("second", 3.1)):
        found = import_changed(
            partial(repeat_every_tenth_row, torque_nm=torque_nm), "--label", label
        )
        assert found.clock["repeated_rows"] == 72
        assert found.clock["repeated_percent"] == pytest.approx(9.0)
        assert found.clock["clock"] == "rebuilt"
        report = RunData.load(RunFolder.open(Path(found.folder))).import_report
        assert report is not None
        command = "rid-daq import recording.csv --map map.yaml"
        assert_shown("someone-elses-recording", command, "\n".join(report.lines()))
    runs, model = ["--runs", str(tmp_path / "runs")], str(tmp_path / "model.json")
    run(["identify", "first", "-o", model, "--json", *runs])
    identified = json.loads(capsys.readouterr().out)
    assert [clock["repeated_rows"] for clock in identified["clocks"]] == [72]
    assert any("72 of 800 rows (9.0 %) repeat" in note for note in identified["notes"])
    run(["validate", model, "second", "--json", *runs])
    validated = json.loads(capsys.readouterr().out)
    assert [clock["repeated_rows"] for clock in validated["clocks"]] == [72]
    assert any("72 of 800 rows (9.0 %) repeat" in note for note in validated["notes"])


@pytest.mark.slow
def test_a_ros_bag_is_imported_identified_and_validated(
    real_robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    bag = real_robot.parent / "ur10" / "ur10_exciting_trajectory.db3"
    runs, model = ["--runs", str(tmp_path / "runs")], str(tmp_path / "model.json")
    halves = ["--rows", "1-1720", "--label", "first", "--rows", "1721-3441", "--label", "second"]
    assert run(["import", str(bag), "--map", "ur10_ros", *halves, *runs]) == 0
    output = capsys.readouterr().out
    assert output.startswith("ur10_exciting_trajectory.db3: 1720 of 1720 rows used, 13.752 s")
    assert "no damaged rows" in output
    assert run(["identify", "first", "--choose", "-o", model, *runs]) == 0
    channel = read_estimate(Path(model)).channel
    assert channel is not None  # all torques of this bag were smoothed at 1.8 Hz without delay
    np.testing.assert_allclose(0.5 / np.pi / channel.width_s, 1.75, rtol=0.1)
    limits = ["--limits", "8,3,3,6,8,13"]
    assert run(["validate", model, "second", *limits, *runs]) == 0
    text = (resources.files("config") / "bundled" / "maps" / "ur10_ros.yaml").read_text()
    assert len(text.splitlines()) <= 12


def test_a_static_recording_validates_the_gravity_of_a_model(
    import_changed: Callable[..., SimpleNamespace],
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    def double_torques(table: np.ndarray) -> None:
        table[:, 5:] *= 2.0

    def set_constant_pose(table: np.ndarray) -> None:
        table[:, 1:] = [0.3, 0.4, 0.0, 0.0, 1.0, 1.0]
        table[:, 5:] += 0.01 * np.sin(np.outer(np.arange(len(table)), [1.0, 2.0]))

    runs, model = ["--runs", str(tmp_path / "runs")], str(tmp_path / "model.json")
    assert import_changed(double_torques, "--label", "moving").code == 0
    assert (
        run(["identify", "moving", "-o", model, *runs]) == 6
    )  # the friction of this model would be negative
    imported = import_changed(set_constant_pose, "--label", "standing")
    assert imported.static
    assert imported.findings[0].startswith("Static: no joint moves")
    capsys.readouterr()
    assert run(["validate", model, "standing", "--standstill", "0", *runs]) == 1
    output = capsys.readouterr().out
    assert "note: standing: Static: no joint moves" in output
    assert "(100, 100 % of each axis)" in output
