"""`identify`, `validate`, `average` and `retime` on a cell with a force plate."""

from __future__ import annotations

import re
import shutil
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.motion.motion_file import load_motion
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from config.arrays import FloatArray
from config.errors import EstimationError
from config.load import load_cell
from mock_hw.plant.rigid_bodies import BaseWrench
from rid_daq.api import Model
from rid_daq.app import run
from tests.builders.json_output import document
from tests.builders.raised_codes import raises_code
from tests.builders.screens import both_outputs

pytestmark = pytest.mark.slow

LIMITS = "  limits: {force_n: [300.0, 300.0, 2000.0], moment_nm: [900.0, 900.0, 200.0]}\n"


@dataclass(frozen=True)
class Prepared:
    """A folder with two runs on a force plate, and outputs of `identify` for the first run.

    Attributes:
        folder: The folder.
        internal: Text of the identification from the torques.
        combined: Document and text of the identification from torques and plate, made afterwards.
    """

    folder: Path
    internal: str
    combined: tuple[dict[str, Any], str]


@pytest.fixture(scope="module")
def prepared(tmp_path_factory: pytest.TempPathFactory) -> Prepared:
    """Record an excitation and a validation run on a force plate, and identify the first one."""
    folder = tmp_path_factory.mktemp("workshop")
    assert run(["init", str(folder)]) == 0
    cell = folder / "cell.yaml"
    bundled = files("config").joinpath("bundled/cells/ir361.yaml").read_text()
    plate = bundled[bundled.index("\nplate:") :]
    cell.write_text(cell.read_text() + re.sub(r"  limits: .*\n", LIMITS, plate))
    for name, old, new in (
        ("motion.yaml", "periods: 8", "periods: 4"),
        ("validation.yaml", "points: 20", "points: 6"),
    ):
        (folder / name).write_text((folder / name).read_text().replace(old, new))
    runs = ["--runs", str(folder / "runs")]
    for label, name in (("excitation", "motion.yaml"), ("validation", "validation.yaml")):
        assert run(["record", str(cell), str(folder / name), "--label", label, *runs]) == 0
        assert find_run(folder / "runs", label).file("plate.mcap").exists()
    words = ["identify", "excitation", *runs]
    _, internal = both_outputs([*words, "-o", str(folder / "internal.json")])
    model = ["--model", "combined", "-o", str(folder / "combined.json")]
    return Prepared(folder, internal, both_outputs([*words, *model]))


@pytest.fixture(scope="module")
def workshop(prepared: Prepared) -> Path:
    return prepared.folder


def test_the_combined_model_reports_the_improvement_by_the_plate(
    prepared: Prepared, workshop: Path
) -> None:
    plate = prepared.combined[0]["plate"]
    assert plate["improvement"]["determinant_ratio"] > 3.0
    assert [axis["joint"] for axis in plate["torque_constants"]["axes"]] == [
        "axis1",
        "axis2",
        "axis3",
    ]
    assert len(plate["components"]) == 6
    report = find_run(workshop / "runs", "excitation").file("report.html").read_text()
    assert "The force plate" in report
    assert "σ from both" in report


def test_the_output_states_the_improvement_by_the_plate(prepared: Prepared) -> None:
    text = " ".join(prepared.combined[1].split())
    assert "The force plate divides the standard deviations" in text
    assert "measured over expected torque" in text or "Compared with the force plate" in text
    assert "m1 + m2 + m3: identifiable only from the robot's weight" in text


def test_average_reports_the_drift_of_the_plate_channels(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["average", "excitation", "--json", *runs]) == 0
    assert "channels drifted by up to" in document(capsys)["average"]["sentence"]


def test_the_internal_model_mentions_the_unused_plate(prepared: Prepared) -> None:
    assert "combined" in prepared.internal


def test_the_external_model_is_identified_from_the_plate_alone(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    model = workshop / "external.json"
    command = ["identify", "excitation", "--model", "external", "-o", str(model), "--json"]
    assert run([*command, *runs]) == 0
    assert len(document(capsys)["estimate"]["parameters"]) == 20
    assert run(["validate", str(model), "validation", "--json", *runs]) == 0
    result = document(capsys)
    with raises_code(EstimationError, "RID-MODEL-KIND"):
        Model.load(model).inverse_dynamics(*np.zeros((3, 3)))
    multisine = [
        "design",
        str(workshop / "cell.yaml"),
        "--kind",
        "multisine",
        "--model",
        str(model),
    ]
    assert run([*multisine, "-o", str(workshop / "none.yaml")]) == 6
    assert "[RID-MODEL-KIND]" in capsys.readouterr().err
    assert not (workshop / "none.yaml").exists()
    assert "torques get no verdict" in result["validation"]["sentence"]
    assert max(c["relative_error_percent"] for c in result["reaction"]["components"]) < 20.0


def test_validate_predicts_the_reaction_on_the_base(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    model = str(workshop / "combined.json")
    assert run(["validate", model, "validation", "--limits", "50", "--json", *runs]) == 0
    reaction = document(capsys)["reaction"]
    assert [c["name"] for c in reaction["components"]] == ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]
    assert max(c["relative_error_percent"] for c in reaction["components"]) < 20.0


@pytest.mark.parametrize(
    ("limits", "code"),
    [("10,10", "RID-OPTION-COUNT"), ("0", "RID-OPTION-RANGE"), ("ten", "RID-OPTION-SYNTAX")],
)
def test_limits_that_are_not_percentages_are_refused(
    limits: str, code: str, workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    model = str(workshop / "combined.json")
    assert run(["validate", model, "validation", "--limits", limits, *runs]) == 2
    assert f"[{code}]" in capsys.readouterr().err


def test_validate_compares_the_base_load_with_its_limits(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    model = str(workshop / "combined.json")
    command = ["validate", model, "validation", "--limits", "50", "--base-limits", "--json"]
    code = run([*command, "--mass", "99", *runs])
    result = document(capsys)
    load = result["base_load"]
    assert load["weight_known"]
    assert load["components"][2]["peak"] > 900.0
    assert code == (0 if all(c["held"] for c in load["components"]) else 1)
    assert any("base wrench with 2σ" in line["text"] for line in result["verdict"]["checks"])
    assert run([*command, "--mass", "250", *runs]) == 1
    broken = [c["name"] for c in document(capsys)["base_load"]["components"] if not c["held"]]
    assert "Fz" in broken


def test_validate_compares_a_planned_motion_with_the_base_limits(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    model, motion = str(workshop / "combined.json"), str(workshop / "validation.yaml")
    command = ["validate", model, motion, "--base-limits", "--json"]
    cell = ["--cell", str(workshop / "cell.yaml")]
    code = run([*command, *cell, "--mass", "99"])
    predicted = document(capsys)["base_load"]["components"]
    assert code == (0 if all(c["held"] for c in predicted) else 1)
    words = ["validate", model, "validation", "--limits", "50", "--base-limits", "--json"]
    run([*words, "--mass", "99", *runs])
    recorded = document(capsys)["base_load"]["components"]
    for before, after in zip(predicted, recorded, strict=True):
        # the recorded load contains the overshoot of the drives' loops
        assert before["peak"] == pytest.approx(after["peak"], rel=0.25)
    assert run([*command, *cell, "--mass", "250"]) == 1
    capsys.readouterr()
    bare = workshop / "bare.yaml"
    bare.write_text((workshop / "cell.yaml").read_text().replace(LIMITS, ""))
    for wrong, message in (
        (command, "needs --cell"),
        ([*command[:3], "--json", *cell], "--base-limits"),
        ([*command, "--cell", str(bare)], "RID-PLATE-NO-LIMITS"),
    ):
        assert run(wrong) == 2
        assert message in " ".join(capsys.readouterr().err.split())


def base_reaction(cell: Path, motion: Path) -> FloatArray:
    """Return the largest reaction of a motion on the base, computed by the plant: (6,) [N, N m]."""
    loaded = load_cell(str(cell))
    assert loaded.plant is not None
    samples = load_motion(motion).plan(loaded.robot, loaded.config.cycle_time_s)
    exerted = BaseWrench(loaded.robot, loaded.plant)
    rows = np.stack([samples.position, samples.velocity, samples.acceleration], axis=1)
    return np.abs([exerted(row) for row in rows]).max(axis=0)


def test_retime_keeps_the_limits_of_the_base(
    workshop: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    cell, motion = workshop / "cell.yaml", str(workshop / "validation.yaml")
    plant = load_cell(str(cell)).plant
    assert plant is not None
    command = [motion, "--model", str(workshop / "combined.json"), "--margin", "0.1", "--json"]
    free, held = tmp_path / "free.yaml", tmp_path / "held.yaml"
    assert run(["retime", str(cell), *command, "-o", str(free)]) == 0
    moving_s = document(capsys)["moving_s"]
    limits = base_reaction(cell, free) * np.array([0.8, 0.8, 1.1, 0.8, 0.8, 0.8])
    forces, moments = limits.reshape(2, 3).round(3).tolist()
    tight = workshop / "tight.yaml"
    limits_key = f"  limits: {{force_n: {forces}, moment_nm: {moments}}}\n"
    tight.write_text(cell.read_text().replace(LIMITS, limits_key))
    mass = ["--mass", str(sum(link.mass_kg for link in plant.links))]
    assert run(["retime", str(tight), *command, "--base-limits", *mass, "-o", str(held)]) == 0
    result = document(capsys)
    assert result["moving_s"] > moving_s
    assert [base["component"] for base in result["base"]] == ["Fx", "Fy", "Fz", "Mx", "My", "Mz"]
    assert (base_reaction(tight, held) <= limits).all()


def test_base_limits_are_refused_for_an_internal_model(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    model = str(workshop / "internal.json")
    assert run(["validate", model, "validation", "--base-limits", *runs]) != 0
    assert "RID-MODEL-NOT-COMBINED" in capsys.readouterr().err


def test_a_damaged_plate_file_still_allows_identification_from_torques(
    workshop: Path, runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    folder = find_run(workshop / "runs", "excitation")
    kept = folder.read("plate.mcap")
    try:
        folder.write("plate.mcap", kept[:50])
        output = ["--overwrite", "-o", str(workshop / "again.json")]
        assert run(["identify", "excitation", *output, *runs]) == 0
        assert run(["identify", "excitation", "--model", "combined", *runs]) != 0
        assert "RID-PLATE-MISSING" in capsys.readouterr().err
    finally:
        folder.write("plate.mcap", kept)


def test_a_wrong_plate_rotation_is_named_rather_than_an_implausible_delay(
    workshop: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The limit is set so low that this fit's delay of 0.07 ms counts as implausibly long."""
    monkeypatch.setattr("identification.estimation.fitted_periods.LONGEST_DELAY_S", 1e-6)
    copy = tmp_path / "runs" / "excitation"
    shutil.copytree(find_run(workshop / "runs", "excitation").path, copy)
    folder = RunFolder.open(copy)
    text = folder.read("cell.yaml").decode()
    turned = text.replace("rotation_rad: [0.0, 0.0, 0.0]", "rotation_rad: [0.0, 0.0, 1.5]")
    folder.write("cell.yaml", turned.encode())
    words = ["identify", str(copy), "--model", "external", "-o", str(tmp_path / "model.json")]
    assert run(words) == 6
    output = capsys.readouterr().err
    assert "RID-PLATE-MISTAKEN" in output
    assert "rotation_rad" in output


def test_periodic_and_nonperiodic_runs_are_not_identified_together(
    runs: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["identify", "excitation", "validation", *runs]) == 2
    assert "RID-RUN-KINDS-MIXED" in capsys.readouterr().err
