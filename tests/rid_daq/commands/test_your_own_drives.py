"""Drives of other manufacturers on the command line, and their lines in the preflight."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from acquisition.journal.cycles import read_journal
from acquisition.runs.catalogue import find_run
from config.load import read_named
from rid_daq.app import run
from tests.builders.json_output import document

EPOS = "servo: {base: epos4, encoder_increments: 4096.0, lacks: [6007h, 6072h, 608Fh, 6091h]}\n"


def preflight_lines(
    folder: Path, servo: str, capsys: pytest.CaptureFixture[str], code: int
) -> list[dict[str, Any]]:
    """Run a preflight of the bundled cell with other drives, and return its lines."""
    cell = folder / "cell.yaml"
    cell.write_text(read_named("ir361", "cells", None)[0].decode() + servo)
    words = ["check", str(cell), "--seconds", "0.1", "--json", "--runs", str(folder / "runs")]
    assert run(words) == code
    lines: list[dict[str, Any]] = document(capsys)["lines"]
    return lines


@pytest.mark.slow
def test_a_drive_without_6007h_is_accepted_after_its_watchdog_trial(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = preflight_lines(tmp_path, EPOS, capsys, 0)
    left = [line for line in lines if line["what"] == "6007h:00 abort connection"]
    assert {(line["found"], line["verdict"]) for line in left} == {
        ("not in this drive: the watchdog test must show the reaction", "shown")
    }
    trials = [line for line in lines if ", powered" in line["what"]]
    assert {line["verdict"] for line in trials} == {"ok"}
    assert {line["found"] for line in trials} == {"80 ms, fault"}


@pytest.mark.slow
def test_a_drive_that_is_not_homed_fails_check_and_record(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["init", str(tmp_path / "mine")]) == 0
    cell, plant = tmp_path / "mine" / "cell.yaml", tmp_path / "mine" / "plant.yaml"
    plant_text = read_named("ir361", "plants", None)[0].decode()
    first = plant_text.index("initial_position")
    plant.write_text(plant_text[:first] + "referenced: false\n    " + plant_text[first:])
    bits = "servo: {referenced: {object: 6041h:00, mask: 32768}}\n"
    cell.write_text(cell.read_text().replace("plant: ir361", "plant: plant.yaml") + bits)
    capsys.readouterr()
    words = [str(cell), "--json", "--runs", str(tmp_path / "runs")]
    assert run(["check", *words, "--seconds", "0.1"]) == 3
    lines = [line for line in document(capsys)["lines"] if "position reference" in line["what"]]
    assert [(line["verdict"], line["code"]) for line in lines] == [
        ("red", "RID-DRIVE-NOT-REFERENCED"),
        ("ok", ""),
        ("ok", ""),
    ]
    motion = tmp_path / "mine" / "validation.yaml"
    assert run(["record", str(cell), str(motion), *words[1:]]) == 3
    assert "RID-DRIVE-NOT-REFERENCED" in capsys.readouterr().out


@pytest.mark.slow
def test_drives_with_life_guarding_are_accepted_after_their_watchdog_trial(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    guarded = "servo: {watch: life_guarding, lacks: [1016h, 1017h, 1400h:05]}\n"
    lines = preflight_lines(tmp_path, guarded, capsys, 0)
    held = {line["what"]: line["found"] for line in lines if line["what"].startswith("100")}
    assert held["100Ch:00 guard time [ms]"] == "25"
    assert held["100Dh:00 life time [guard times]"] == "3"
    trials = [line for line in lines if ", powered" in line["what"]]
    assert {line["verdict"] for line in trials} == {"ok"}


@pytest.mark.slow
def test_the_key_that_replaces_a_missing_standard_object_is_named(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    lines = preflight_lines(tmp_path, "servo: {lacks: [608Fh, 60C2h]}\n", capsys, 3)
    red = [line for line in lines if line["verdict"] == "red"]
    assert {line["next_action"] for line in red} == {
        "set encoder_increments (of the motor's encoder) in the axis's servo"
    }


@pytest.mark.slow
def test_drives_with_fixed_pdos_or_polled_torque_record_the_same_torques(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """One axis keeps its standard drive, and each other axis has another kind of drive."""
    assert run(["init", str(tmp_path)]) == 0
    motion = tmp_path / "validation.yaml"
    motion.write_text(motion.read_text().replace("points: 20", "points: 3"))
    cell = (tmp_path / "cell.yaml").read_text()
    servo_keys = "encoder_increments: 16384.0, torque_constant_nm_per_a: 0.1"
    for joint, node, name in (("axis2", 2, "faulhaber_mc3000"), ("axis3", 3, "trinamic_tmcm16xx")):
        plain = f"  - {{joint: {joint}, node_id: {node}}}"
        assert plain in cell
        cell = cell.replace(plain, f"{plain[:-1]}, servo: {{base: {name}, {servo_keys}}}}}")
    (tmp_path / "others.yaml").write_text(cell)
    torques = []
    for label in ("cell", "others"):
        words = [str(tmp_path / f"{label}.yaml"), str(motion), "--label", label]
        assert run(["record", *words, "--runs", str(tmp_path / "runs")]) == 0
        rows = read_journal(find_run(tmp_path / "runs", label).path / "recording.mcap").rows
        moving = rows["sample_index"] >= 0
        assert rows["valid"][moving].all()
        torques.append(rows["torque_nm"][moving])
    capsys.readouterr()
    standard, other = (np.array(each) for each in torques)
    length = min(len(standard), len(other))
    standard, other = standard[:length], other[:length]
    power = np.mean(standard**2, axis=0)
    assert np.mean(standard * other, axis=0) / power == pytest.approx(np.ones(3), abs=0.03)
    # some drives round commands to whole rpm and follow a ramp: their motion is less smooth
    assert np.all(np.mean((standard - other) ** 2, axis=0) < 0.2**2 * power)
