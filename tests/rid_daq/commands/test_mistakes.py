"""`identify` names mistakes in a map with the lines to change, and ends with exit code 6."""

from __future__ import annotations

import contextlib
import io
import json
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from benchmarks.mistakes import diagnose
from benchmarks.mistakes_made import UserFiles, mistakes
from benchmarks.sound_robots import SoundRecording, sound_run
from config.load import load_robot, to_yaml
from rid_daq.app import run
from tests.builders.console_blocks import assert_shown

MAP = """\
name: arm
robot: ir361
columns: 7
time: {{column: 0}}
joints:
  - {{joint: axis1, position: {0}, torque: {3}}}
  - {{joint: axis2, position: {1}, torque: {4}}}
  - {{joint: axis3, position: {2}, torque: {5}}}
"""
RIGHT = (1, 2, 3, 4, 5, 6)
MEANING = "torques: motor_torque\n"


class Identified(NamedTuple):
    """Outcome of `import` and `identify`: exit code, document, and the folder of their files."""

    code: int
    document: dict[str, Any]
    folder: Path


Identify = Callable[..., Identified]


@pytest.fixture(scope="module")
def sound() -> SoundRecording:
    return sound_run(load_robot("ir361"), np.random.default_rng(1))


@pytest.fixture(scope="module")
def identify(sound: SoundRecording, tmp_path_factory: pytest.TempPathFactory) -> Identify:
    """Return a function that imports a valid recording with the given columns and identifies it.

    Tests that use the same columns share the result.
    """

    @cache
    def run_identify(
        columns: tuple[int, ...],
        *rows: str,
        options: tuple[str, ...] = (),
        keys: str = MEANING,
        late_s: float = 0.0,
    ) -> Identified:
        then_s = sound.time_s - late_s
        late = [np.interp(then_s, sound.time_s, column) for column in sound.torque_nm.T]
        table = np.column_stack([sound.time_s, sound.position, *late])
        folder = tmp_path_factory.mktemp("mistakes")
        np.savetxt(folder / "rec.csv", table, delimiter=",", fmt="%.9g")
        (folder / "map.yaml").write_text(MAP.format(*columns) + keys)
        runs = ["--runs", str(folder / "runs"), "--json"]
        files = [str(folder / "rec.csv"), "--map", str(folder / "map.yaml")]
        code, imported = run_document(["import", *files, *rows, *runs])
        assert code == 0
        return Identified(*run_document(["identify", imported["folder"], *runs, *options]), folder)

    return run_identify


def run_document(words: list[str]) -> tuple[int, dict[str, Any]]:
    """Run a command with `--json`; return its exit code and its document."""
    with contextlib.redirect_stdout(io.StringIO()) as output:
        code = run(words)
    found: dict[str, Any] = json.loads(output.getvalue())
    return code, found


def test_a_valid_recording_is_graded_good_without_findings(identify: Identify) -> None:
    code, document, _ = identify(RIGHT)
    assert code == 0
    assert document["estimate"]["mistakes"] == []
    assert [axis["grade"] for axis in document["estimate"]["axes"]] == ["good"] * 3
    assert all(axis["percent"] < 10.0 for axis in document["estimate"]["axes"])


def test_torques_with_gravity_contradict_a_map_that_states_none(identify: Identify) -> None:
    _, document, _ = identify(RIGHT, keys="torques: gravity_compensated\n")
    assert document["estimate"]["mistakes"] == []
    findings = [each for each in document["estimate"]["findings"] if "gravity_compensated" in each]
    assert len(findings) == 1
    assert not any("torques:" in each for each in identify(RIGHT).document["estimate"]["findings"])


def test_late_torques_are_named_or_reported_if_a_bus_can_explain_the_delay(
    identify: Identify,
) -> None:
    code, document, _ = identify(RIGHT, late_s=0.02)
    assert (code, document["estimate"]["mistakes"]) == (0, [])
    assert sum("20 ms late" in each for each in document["estimate"]["findings"]) == 1
    code, document, _ = identify(RIGHT, late_s=0.06)
    assert code == 6
    (mistake,) = document["estimate"]["mistakes"]
    assert (mistake["kind"], mistake["factor"]) == ("time of torques", 0.06)
    assert not any("bus can explain" in each for each in document["estimate"]["findings"])


def test_a_short_recording_gives_wide_intervals_and_a_finding(
    identify: Identify, sound: SoundRecording
) -> None:
    rate = 1.0 / float(np.median(np.diff(sound.time_s)))
    code, document, _ = identify(RIGHT, "--rows", f"1-{round(8.5 * rate)}")
    assert code in (0, 6)
    findings = [
        each for each in document["estimate"]["findings"] if "only 9 seconds of motion" in each
    ]
    assert findings == [
        "The intervals are inaccurate, because they are computed from only 9 seconds of motion."
        " They were made 1.2 times wider to allow for this. Record longer (30 are enough)."
    ]


def test_swapped_columns_are_reported_with_the_keys_and_lines_to_change(
    identify: Identify, capsys: pytest.CaptureFixture[str]
) -> None:
    code, document, folder = identify((1, 2, 3, 4, 6, 5))
    assert code == 6
    (mistake,) = document["estimate"]["mistakes"]
    assert mistake["kind"] == "order of torques"
    assert mistake["joints"] == ["axis2", "axis3"]
    assert mistake["change"] == [
        "map: `torque` or `current` of joints[1] (axis2), joints[2] (axis3)"
    ]
    assert "axis2 and axis3 are swapped" in mistake["sentence"]
    lines = (folder / "map.yaml").read_text().splitlines()
    assert [(each["file"], each["line"]) for each in mistake["places"]] == [
        (str(folder / "map.yaml"), number)
        for number, line in enumerate(lines, 1)
        if "axis2" in line or "axis3" in line
    ]
    assert mistake["places"][0]["text"] == "- {joint: axis2, position: 2, torque: 6}"
    runs = ["--runs", str(folder / "runs")]
    assert run(["identify", str(Path(document["model"]).parent), *runs, "--overwrite"]) == 6
    output = capsys.readouterr().out
    assert_shown("find-a-mistake", "rid-daq identify latest", output, same_numbers=False)
    page = Path(document["report"]).read_text(encoding="utf-8")
    assert mistake["sentence"] in page
    assert "Failed: a file of this run is probably wrong" in page
    assert "Change map: `torque` or `current` of joints[1] (axis2)" in page


def test_a_model_with_a_poor_fit_is_not_exported(
    identify: Identify, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    document = identify((1, 2, 3, 4, 6, 5)).document
    assert "bad" in [axis["grade"] for axis in document["estimate"]["axes"]]
    export = ["export", document["model"], "--to", "urdf", "-o", str(tmp_path / "arm.urdf")]
    assert run(export) == 6
    assert "RID-MODEL-MISFIT" in capsys.readouterr().err
    assert not (tmp_path / "arm.urdf").exists()
    assert run([*export, "--despite-misfit"]) == 0
    as_identified = ["export", document["model"], "--to", "python", "--as-identified"]
    as_identified += ["-o", str(tmp_path / "arm.py")]
    assert run(as_identified) == 6
    assert run([*as_identified, "--despite-misfit"]) == 0


def test_validation_fails_on_an_unpredicted_recording_even_without_limits(
    identify: Identify, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = identify((1, 2, 3, 6, 4, 5), options=("--no-diagnose",)).document
    right = identify(RIGHT).document
    run_of_right = str(Path(right["model"]).parent)
    assert run(["validate", wrong["model"], run_of_right, "--json"]) == 1
    axes = json.loads(capsys.readouterr().out)["validation"]["axes"]
    assert max(axis["relative_error_percent"] for axis in axes) > 30.0


def test_a_model_of_another_robot_is_refused(
    identify: Identify, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """First a robot with the same name and joint names but another length, then another robot."""
    _, document, folder = identify(RIGHT)
    robot = load_robot("ir361")
    *before, last = robot.kinematics.rows
    longer = robot.kinematics.model_copy(
        update={"rows": (*before, last.model_copy(update={"a_m": 0.58}))}
    )
    other = robot.model_copy(update={"kinematics": longer})
    (tmp_path / "other.yaml").write_text(to_yaml(other))
    text = MAP.format(*RIGHT).replace("robot: ir361", "robot: other.yaml") + MEANING
    (tmp_path / "map.yaml").write_text(text)
    runs = ["--runs", str(tmp_path / "runs"), "--json"]
    files = [str(folder / "rec.csv"), "--map", str(tmp_path / "map.yaml")]
    assert run(["import", *files, *runs]) == 0
    imported = json.loads(capsys.readouterr().out)["folder"]
    for command, keys in (
        (["validate", document["model"], imported], "kinematics"),
        (["sensitivity", "kr15", "--model", document["model"]], "name, gravity_m_s2, kinematics"),
    ):
        assert run(command) == 2
        message = capsys.readouterr().err
        assert "RID-ROBOT-OTHER" in message
        assert keys in message


def test_the_recording_without_a_mistake_has_no_findings(
    sound: SoundRecording, tmp_path: Path
) -> None:
    right = UserFiles(sound.robot, sound.time_s, sound.position, sound.torque_nm, sound.gravity_nm)
    assert diagnose(right, tmp_path) == (False, set())


@pytest.mark.slow
@pytest.mark.parametrize(
    "name",
    [
        "axis 2: position and torque backwards",
        "axis 2: position backwards",
        "axis 2: position times 2",
        "axis 3: position times 0.5",
        "axis 2: torque times 0.5",
        "axis 2: torque times 10",
        "axis 2: zero position off by 90 degrees",
        "axis 2: zero position off by 30 degrees",
        "positions: axes 2 and 3 swapped",
        "torques: axes 1 and 2 swapped",
        "columns: axes 2 and 3 swapped",
        "degrees read as radians",
        "clock: in milliseconds",
        "every row twice",
        "axis 2: torque stuck",
        "the other convention",
        "a wrist coupling that the robot does not have",
        "a link in mm",
        "gravity in cm",
        "limits in degrees",
    ],
)
def test_each_mistake_is_refused_or_named(name: str, sound: SoundRecording, tmp_path: Path) -> None:
    right = UserFiles(sound.robot, sound.time_s, sound.position, sound.torque_nm, sound.gravity_nm)
    made = next(each for each in mistakes(right) if each.name == name)
    refused, named = diagnose(made.stated, tmp_path)
    joints = tuple(sound.robot.joint_names[j] for j in made.joints)
    assert refused or any((kind, joints) in named for kind in made.kinds)


def test_a_well_fitting_model_with_negative_mass_gives_exit_code_6(
    tmp_path: Path, sound: SoundRecording, capsys: pytest.CaptureFixture[str]
) -> None:
    """With all torques reversed, an arm of negative mass and negative friction fits well."""
    table = np.column_stack([sound.time_s, sound.position, -sound.torque_nm])
    np.savetxt(tmp_path / "rec.csv", table, delimiter=",", fmt="%.9g")
    (tmp_path / "map.yaml").write_text(MAP.format(*RIGHT) + MEANING)
    runs = ["--runs", str(tmp_path / "runs"), "--json"]
    files = [str(tmp_path / "rec.csv"), "--map", str(tmp_path / "map.yaml")]
    assert run(["import", *files, *runs]) == 0
    folder = json.loads(capsys.readouterr().out)["folder"]
    for options, kinds in (([], ["torque sign"]), (["--no-diagnose"], None)):
        assert run(["identify", folder, *runs, *options]) == 6
        estimate = json.loads(capsys.readouterr().out)["estimate"]
        assert [axis["grade"] for axis in estimate["axes"]] == ["good"] * 3
        assert estimate["driving"] == ["axis1", "axis2", "axis3"]
        assert estimate["arm_weight"]["share"] < 0.0
        reported = estimate.get("mistakes")
        assert (reported and [each["kind"] for each in reported]) == kinds
