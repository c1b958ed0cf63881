"""Recordings of a real robot with the documented commands: import, identify, validate."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from acquisition.maps.import_map import load_import_map
from acquisition.runs.catalogue import find_run
from config.load import load_robot, to_yaml
from config.robot.robot import RobotDescription
from rid_daq.app import run
from rid_daq.report.model_file import ModelFile
from rid_daq.report.result_file import read_result
from tests.builders.console_blocks import assert_shown

FILES = {
    "long": ("ur-20_02_12-50sec_12harm.csv", "355-5090"),
    "short": ("ur-20_02_10-30sec_12harm.csv", "635-3510"),
    "points": ("ur-20_01_17-ptp_10_points.csv", "700-4200"),
    "unloaded": ("ur-20_01_31-unload.csv", "300-2623"),
    "loaded": ("ur-20_01_31-load.csv", "370-2881"),
}
LIMITS_PERCENT = (6.9, 2.2, 2.4, 4.1, 6.7, 6.8)


@pytest.fixture(scope="module")
def workshop(real_robot: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("ur10e")
    for label, (name, rows) in FILES.items():
        words = ["import", str(real_robot / name), "--map", "ur10e_31", "--rows", rows]
        assert run([*words, "--label", label, "--runs", str(place / "runs")]) == 0
    return place


@pytest.mark.slow
@pytest.mark.usefixtures("drawn_reports")
def test_a_model_selected_on_training_runs_predicts_another_motion(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs, model = ["--runs", str(workshop / "runs")], str(workshop / "model.json")
    words = ["identify", "long", "short", "--choose", "--band", "9.4", "-o", model, *runs]
    words += ["--no-diagnose"]  # tests/identification/wiring diagnoses these recordings
    capsys.readouterr()
    assert run([*words, "--json"]) == 0
    chosen = json.loads(capsys.readouterr().out)["comparison"]["chosen"]
    # The gears are harmonic drives: in the two joints that carry the arm, friction depends on load.
    assert "load" in chosen["joint2"]
    assert "load" in chosen["joint3"]
    limits = ",".join(map(str, LIMITS_PERCENT))
    words = ["validate", model, "points", "--band", "9.4", "--limits", limits, *runs]
    assert run([*words, "--json"]) == 0
    axes = json.loads(capsys.readouterr().out)["validation"]["axes"]
    # Joint 6 is at rest for half of the time, in the presliding range.
    assert [axis["all_samples_percent"] < 9.5 for axis in axes] == [True] * 5 + [False]
    assert axes[5]["all_samples_percent"] < 22.0
    for label in ("long", "points"):
        report = find_run(workshop / "runs", label).file("report.html")
        assert report.stat().st_size < 3_000_000


def test_a_parameter_at_its_bound_is_marked_in_every_output(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    # Joint 6 carries no load. Its load-dependent friction is therefore estimated as zero, which is
    # the lower bound.
    words = ["identify", "short", "--band", "9.4", "--no-diagnose"]
    words += ["--runs", str(workshop / "runs")]
    words += ["--friction-terms", "coulomb,viscous,offset,load", "-o", str(workshop / "load.json")]
    capsys.readouterr()
    assert run(words) in (0, 6)  # the grade of the fit does not matter here
    lines, bound = capsys.readouterr().out.splitlines(), ["cl_joint6"]
    assert [line.split()[1] for line in lines if "at its bound" in line] == bound
    report = next(Path(line.split()[1]) for line in lines if line.startswith("Report:"))
    assert "at its bound" in report.read_text()
    estimate = json.loads(report.with_name("result.json").read_text())["estimate"]
    assert {p["name"] for p in estimate["parameters"] if p.get("at_bound")} == set(bound)
    assert "cl_joint6 = 0 is at a bound of its range (0 to 0.5)" in " ".join(estimate["findings"])


def test_validate_uses_the_band_of_the_model(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    runs, model = ["--runs", str(workshop / "runs")], str(workshop / "band.json")
    assert run(["identify", "short", "--band", "6", "-o", model, *runs, "--no-diagnose"]) == 0
    for options, band_hz in (([], 6.0), (["--band", "9"], 9.0)):
        capsys.readouterr()
        run(["validate", model, "long", *options, "--json", *runs])
        validation = json.loads(capsys.readouterr().out)["validation"]
        assert validation["cutoff_hz"] == band_hz


def test_identify_suggests_load_dependent_friction_by_cross_validation(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["identify", "short", "--json", "-o", str(workshop / "asked.json")]
    capsys.readouterr()
    assert run([*words, "--runs", str(workshop / "runs")]) == 0
    findings = json.loads(capsys.readouterr().out)["estimate"]["findings"]
    (suggestions,) = [each for each in findings if "joint2: load" in each]
    assert "load" in suggestions.partition("joint3: ")[2].partition(";")[0]


def test_a_payload_is_identified_from_runs_with_and_without_it(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["identify", "unloaded", "loaded", "--loaded", "loaded", "--band", "9.4", "--json"]
    words += ["-o", str(workshop / "payload.json"), "--runs", str(workshop / "runs")]
    words += ["--no-diagnose"]
    capsys.readouterr()
    assert run(words) == 0
    parameters = json.loads(capsys.readouterr().out)["estimate"]["parameters"]
    mass = next(p for p in parameters if p["name"] == "mL")
    assert abs(mass["value"] - 2.805) < 0.025 * 2.805
    assert abs(mass["value"] - 2.805) < 2.0 * mass["std"]


@pytest.mark.slow
def test_a_report_contains_only_sections_of_the_latest_model(workshop: Path) -> None:
    runs, of_it = ["--runs", str(workshop / "runs")], find_run(workshop / "runs", "unloaded")
    other, latest = workshop / "other.json", workshop / "own.json"
    graded = (0, 6)  # the grade of these fits does not matter here
    plain = ["--no-diagnose", *runs]
    assert run(["identify", "loaded", "-o", str(other), *plain]) in graded
    assert run(["identify", "unloaded", "-o", str(latest), *plain]) in graded
    assert run(["validate", str(other), "unloaded", "--limits", "900", *runs]) == 0
    result = read_result(of_it)
    assert result.model == ModelFile.of(other)
    assert result.verdict.passed
    words = ["identify", "unloaded", "--band", "8", "-o", str(latest), "--overwrite"]
    assert run([*words, *plain]) in graded
    result = read_result(of_it)
    assert result.model == ModelFile.of(latest)
    assert result.validation is None
    assert result.verdict.passed is None
    assert any("the sections of other.json" in note for note in result.notes or ())


@pytest.mark.parametrize(
    ("mass", "code", "message"),
    [
        ("2805", 2, "2805 g would be 2.805 kg"),
        ("2400", 6, "grams were given as kilograms"),
        ("1.4", 6, "has twice the stated mass"),
    ],
)
def test_a_load_mass_that_needs_an_implausible_drive_gain_is_refused(
    workshop: Path, mass: str, code: int, message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    model = workshop / f"{mass}.json"
    words = ["identify", "unloaded", "loaded", "--loaded", "loaded", "--band", "9.4"]
    words += [
        "--no-diagnose",
        "-o",
        str(model),
        "--runs",
        str(workshop / "runs"),
        "--load-mass",
        mass,
    ]
    capsys.readouterr()
    assert run(words) == code
    assert message in " ".join(capsys.readouterr().err.split())
    assert not model.exists()


@pytest.mark.long
def test_drive_gains_from_a_weighed_payload_pass_three_cross_checks(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["identify", "unloaded", "loaded", "--loaded", "loaded", "--band", "9.4", "--json"]
    words += ["-o", str(workshop / "gains.json"), "--runs", str(workshop / "runs")]
    capsys.readouterr()
    assert run([*words, "--load-mass", "2.805", "--cross-check"]) == 0
    document = json.loads(capsys.readouterr().out)
    gains = document["drive_gains"]
    assert len(gains) == 6
    for gain in gains.values():
        assert abs(gain["value"] - 1.0) < 0.08
        assert 0.0 < gain["std"] < 0.1
    findings = " ".join(document["estimate"]["findings"])
    for words_of_method in ("Energies:", "Joint after joint:", "Kalman filter:"):
        assert words_of_method in findings
    assert "possible robot" in findings
    assert run([*words[:3], *words[5:], "--load-mass", "2.805", "--overwrite"]) == 2
    assert "RID-REQUEST-INVALID" in capsys.readouterr().err


def identified_with(
    robot: RobotDescription, source: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> str:
    """Import rows of the UR10e with the file of another robot, and return the output of
    `identify`.
    """
    (folder / "robot.yaml").write_text(to_yaml(robot))
    import_map, _ = load_import_map("ur10e_31")
    changed = import_map.model_copy(update={"robot": "robot.yaml"})
    (folder / "map.yaml").write_text(to_yaml(changed))
    words = ["import", str(source), "--map", str(folder / "map.yaml"), "--rows", "700-4200"]
    runs = ["--runs", str(folder / "runs")]
    assert run([*words, *runs]) == 0
    capsys.readouterr()
    assert run(["identify", "latest", *runs]) == 6
    return capsys.readouterr().out


@pytest.mark.slow
def test_a_robot_file_with_wrong_lengths_is_named(
    real_robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = load_robot("ur10e")
    rows = tuple(
        row.model_copy(update={"a_m": 0.6 * row.a_m, "d_m": 0.6 * row.d_m})
        for row in robot.kinematics.rows
    )
    table = robot.kinematics.model_copy(update={"rows": rows})
    short = robot.model_copy(update={"kinematics": table, "cad": None})
    output = identified_with(short, real_robot / FILES["points"][0], tmp_path, capsys)
    assert_shown("find-a-mistake", "rid-daq identify latest", output, same_numbers=False)


@pytest.mark.slow
def test_the_file_of_another_robot_is_named(
    real_robot: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    other = {"kinematics": load_robot("kr15").kinematics, "cad": None}
    robot = load_robot("ur10e").model_copy(update=other)
    output = identified_with(robot, real_robot / FILES["long"][0], tmp_path, capsys)
    assert_shown("find-a-mistake", "rid-daq identify latest", output, same_numbers=False)
