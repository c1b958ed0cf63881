"""`rid-daq payload` by its commands: recordings of a real robot, exports, refusals."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from acquisition.processing.torque_channel import TorqueChannel
from acquisition.runs.catalogue import find_run
from config.errors import ConfigError
from config.load import load_cell
from identification.choices import LoadFormat
from identification.estimation.file import write_estimate
from identification.estimation.options import EstimationOptions
from identification.payload.file import read_payload
from rid_daq.app import run
from rid_daq.operations.estimation.run_estimation import EstimationJob, estimate_runs
from rid_daq.runs.run_data import RunData
from tests.builders.console_blocks import assert_shown
from tests.builders.known_model import known_estimate

pytestmark = pytest.mark.usefixtures("plain_reports")

FILES = {
    "unloaded": ("ur-20_01_31-unload.csv", "300-2623"),
    "loaded": ("ur-20_01_31-load.csv", "370-2881"),
    "other motion": ("ur-20_02_10-30sec_12harm.csv", "635-3510"),
}
WEIGHED_KG = 2.805


@pytest.fixture(scope="module")
def workshop(real_robot: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    place = tmp_path_factory.mktemp("payload")
    for label, (name, rows) in FILES.items():
        words = ["import", str(real_robot / name), "--map", "ur10e_31", "--rows", rows]
        assert run([*words, "--label", label, "--runs", str(place / "runs")]) == 0
    words = ["payload", "identify", "--unloaded", "unloaded", "--loaded", "loaded"]
    words += ["--band", "9.4", "--runs", str(place / "runs")]
    assert run([*words, "-o", str(place / "payload.json")]) == 0
    return place


@pytest.fixture(scope="module")
def robot_model(workshop: Path) -> Callable[[str], Path]:
    """Return a function that identifies the robot from a run, once, and returns the model file."""

    @cache
    def identified(label: str) -> Path:
        model = workshop / f"{label}.json"
        words = ["identify", label, "-o", str(model), "--band", "9.4"]
        assert run([*words, "--runs", str(workshop / "runs")]) == 0
        return model

    return identified


def identify(place: Path, *words: str) -> list[str]:
    return ["payload", "identify", "--band", "9.4", "--runs", str(place / "runs"), *words]


@pytest.mark.usefixtures("drawn_reports")
def test_a_real_payload_is_identified_within_two_percent_and_its_interval(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    words = identify(workshop, "--unloaded", "unloaded", "--loaded", "loaded", "--json")
    assert run(words) == 0
    document = json.loads(capsys.readouterr().out)
    mass = document["payload"]["parameters"][0]
    assert mass["name"] == "m"
    assert abs(mass["value"] - WEIGHED_KG) < 0.02 * WEIGHED_KG
    assert abs(mass["value"] - WEIGHED_KG) < 2.0 * mass["std"]
    # If the noise were assumed white, the interval would be several times too narrow.
    assert mass["std"] > 3.0 * mass["std_noise"]
    assert document["verdict"]["passed"] is True
    command = "rid-daq payload identify --unloaded empty --loaded gripper"
    assert_shown("payload", command, "\n".join(document["payload"]["findings"]), same_numbers=False)
    # The run folder and its report also contain the payload.
    report = Path(document["report"]).read_text(encoding="utf-8")
    assert "Torque" in report or "torque of the payload" in report
    assert report.count("<svg") > 0
    assert 'alt="ur10e, flange' in report
    assert (Path(document["report"]).parent / "payload.json").exists()


@pytest.mark.parametrize(
    ("procedure", "trained"),
    [
        ("together", None),
        ("difference", None),
        ("apart", None),
        ("model", "unloaded"),
        ("model", "other motion"),
        ("apart", "other motion"),
    ],
)
def test_every_procedure_identifies_a_real_payload_within_its_interval(
    workshop: Path,
    robot_model: Callable[[str], Path],
    procedure: str,
    trained: str | None,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = identify(workshop, "--loaded", "loaded", "--procedure", procedure, "--json")
    if trained is None:
        words += ["--unloaded", "unloaded"]
    else:
        words += ["--model", str(robot_model(trained))]
    capsys.readouterr()
    assert run([*words, "-o", str(workshop / "procedure.json"), "--overwrite"]) == 0
    section = json.loads(capsys.readouterr().out)["payload"]
    mass = section["parameters"][0]
    assert abs(mass["value"] - WEIGHED_KG) < 2.0 * mass["std"] < 0.05 * WEIGHED_KG
    # Torque due to the payload, and change of mass per 1 % of an axis's torque (none for `apart`).
    felt = [(axis["payload"], axis["mass_per_percent"]) for axis in section["axes"]]
    assert felt[1][0] == pytest.approx(25.0, rel=0.1)
    assert all((change is None) is (procedure == "apart") for _, change in felt)


def test_a_model_with_its_own_friction_terms_identifies_a_payload(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The model has load-dependent friction in two joints, as `identify --choose` can write it."""
    data = RunData.load(find_run(workshop / "runs", "other motion"))
    joints = tuple(
        joint.model_copy(update={"friction": (*joint.friction, "load")})
        if joint.name in ("joint2", "joint3")
        else joint
        for joint in data.robot.joints
    )
    chosen = data.robot.model_copy(update={"joints": joints})
    how = EstimationJob(EstimationOptions(band_hz=9.4))
    model = workshop / "chosen.json"
    write_estimate(model, estimate_runs([data], how, robot=chosen).estimate)
    for procedure in ("model", "apart"):
        words = identify(workshop, "--loaded", "loaded", "--model", str(model), "--json")
        words += ["--procedure", procedure, "-o", str(workshop / f"{procedure}_chosen.json")]
        capsys.readouterr()
        assert run(words) == 0
        mass = json.loads(capsys.readouterr().out)["payload"]["parameters"][0]
        assert abs(mass["value"] - WEIGHED_KG) < 0.025 * WEIGHED_KG
        assert abs(mass["value"] - WEIGHED_KG) < 3.0 * mass["std"]  # of another day


def test_friction_terms_are_an_option_if_no_model_contains_them(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = identify(workshop, "--unloaded", "unloaded", "--loaded", "loaded", "--json")
    words += ["-o", str(workshop / "terms.json")]
    std = []
    for terms in ("coulomb,viscous,offset", "coulomb,viscous,offset,load"):
        capsys.readouterr()
        assert run([*words, "--friction-terms", terms, "--overwrite"]) == 0
        mass = json.loads(capsys.readouterr().out)["payload"]["parameters"][0]
        assert abs(mass["value"] - WEIGHED_KG) < 0.02 * WEIGHED_KG
        std.append(mass["std"])
    assert std[1] < 0.6 * std[0]
    model = str(workshop / "chosen.json")
    words = identify(workshop, "--loaded", "loaded", "--model", model, "--friction-terms", "load")
    assert run(words) == 2
    error = capsys.readouterr().err
    assert "[RID-OPTION-EXCLUSIVE]" in error
    assert "--model" in error


def test_a_weighed_mass_is_fixed(workshop: Path, capsys: pytest.CaptureFixture[str]) -> None:
    capsys.readouterr()
    words = identify(workshop, "--unloaded", "unloaded", "--loaded", "loaded", "--json")
    words += ["-o", str(workshop / "held.json"), "--known", "m=2.805+-0.002"]
    assert run(words) == 0
    mass = json.loads(capsys.readouterr().out)["payload"]["parameters"][0]
    assert mass["known"] is True
    assert mass["value"] == pytest.approx(WEIGHED_KG, abs=0.002)
    assert mass["std"] <= 0.002


def test_a_mass_in_grams_is_refused_before_any_file_is_read(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = identify(workshop, "--unloaded", "unloaded", "--loaded", "loaded", "--known", "m=2805")
    assert run(words) == 2
    output = capsys.readouterr().err
    assert output.startswith("rid-daq: --known m: 2805 kg")
    assert output.endswith("[RID-OPTION-RANGE]\n")


def test_the_mass_of_another_payload_fails_the_verdict(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = identify(workshop, "--unloaded", "unloaded", "--loaded", "loaded", "--json")
    words += ["-o", str(workshop / "other.json"), "--known", "m=280.5"]
    capsys.readouterr()
    assert run(words) == 6
    document = json.loads(capsys.readouterr().out)
    assert document["payload"]["parameters"][0]["value"] == 280.5
    assert "280.5" in document["verdict"]["headline"]
    assert "grams given as kilograms" in " ".join(document["payload"]["findings"])


def test_a_session_with_swapped_currents_of_two_axes_fails(
    workshop: Path, real_robot: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    second, third = 14, 15  # the columns of the currents of joints 2 and 3
    for label in ("unloaded", "loaded"):
        name, rows = FILES[label]
        with (real_robot / name).open(newline="") as file:
            table = list(csv.reader(file))
        for row in table:
            row[second], row[third] = row[third], row[second]
        with (workshop / name).open("w", newline="") as file:
            csv.writer(file).writerows(table)
        words = ["import", str(workshop / name), "--map", "ur10e_31", "--rows", rows]
        words += ["--label", f"{label} swapped", "--runs", str(workshop / "runs")]
        assert run(words) == 0
    words = identify(workshop, "--unloaded", "unloaded swapped", "--loaded", "loaded swapped")
    capsys.readouterr()
    assert run([*words, "-o", str(workshop / "swapped.json")]) == 6
    output = " ".join(capsys.readouterr().out.split())
    assert "Failed: residual of joint2 (RMS, relative to its torque); residual of joint3" in output
    assert "look for swapped torques of two axes" in output


@pytest.mark.fault(34)
@pytest.mark.parametrize("form", LoadFormat)
def test_every_export_is_read_back_and_a_changed_one_is_detected(
    workshop: Path,
    form: LoadFormat,
    capsys: pytest.CaptureFixture[str],
    measured: Callable[[str], None],
) -> None:
    payload, file = str(workshop / "payload.json"), workshop / f"load.{form.value}"
    assert run(["payload", "export", payload, "--to", form.value, "-o", str(file)]) == 0
    assert run(["payload", "read-back", payload, str(file), "--from", form.value]) == 0
    # An existing file is replaced only on request.
    assert run(["payload", "export", payload, "--to", form.value, "-o", str(file)]) == 2
    text = file.read_text(encoding="utf-8")
    mass_kg = read_payload(workshop / "payload.json").estimate.body.mass_kg
    mass = next(m for n in range(12, 2, -1) if (m := f"{mass_kg:.{n}g}") in text)
    assert len(mass) <= 7  # only digits that the uncertainty justifies
    assert text.count(mass) == 1
    file.write_text(text.replace(mass, f"{float(mass) * 1.01:.6g}"), encoding="utf-8")
    capsys.readouterr()
    assert run(["payload", "read-back", payload, str(file), "--from", form.value]) == 1
    output = re.search(r"differs from the payload by ([\d.]+) %", capsys.readouterr().out)
    assert output is not None
    assert float(output[1]) == pytest.approx(1.0, abs=0.05)  # after rounding
    measured("a mass changed by 1 % is red in every format")


@pytest.mark.fault(33)
def test_a_failed_payload_is_not_exported(
    workshop: Path, capsys: pytest.CaptureFixture[str], measured: Callable[[str], None]
) -> None:
    payload = workshop / "unsure.json"
    words = identify(workshop, "--unloaded", "unloaded", "--loaded", "loaded")
    assert run([*words, "--mass-limit", "0.5", "-o", str(payload)]) == 1
    capsys.readouterr()
    out = workshop / "unsure.script"
    assert run(["payload", "export", str(payload), "--to", "ur", "-o", str(out)]) == 6
    assert "[RID-PAYLOAD-FAILED]" in capsys.readouterr().err
    assert not out.exists()
    # A payload file with an edited verdict is not exported either.
    edited = payload.read_text(encoding="utf-8").replace('"passed": false', '"passed": true')
    payload.write_text(edited, encoding="utf-8")
    assert run(["payload", "export", str(payload), "--to", "ur", "-o", str(out)]) == 2
    assert "[RID-PAYLOAD-UNSOUND]" in capsys.readouterr().err
    measured("exit code 6, no file written")


def test_an_inertia_that_fails_in_percent_is_exported_by_its_limit_in_kg_m2(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    payload, out = str(workshop / "absolute.json"), str(workshop / "absolute.script")
    words = identify(workshop, "--unloaded", "unloaded", "--loaded", "loaded", "-o", payload)
    assert run([*words, "--inertia-limit", "20"]) == 1
    capsys.readouterr()
    limits = ["--inertia-limit", "20", "--inertia-limit-kg-m2", "0.12", "--json"]
    assert run([*words, "--overwrite", *limits]) == 0
    checks = json.loads(capsys.readouterr().out)["verdict"]["checks"]
    (inertia,) = (each for each in checks if "interval of the inertia" in each["text"])
    assert (inertia["limit"], inertia["unit"]) == (0.12, "kg m²")
    assert 0.05 < inertia["value"] < 0.12
    assert run(["payload", "export", payload, "--to", "ur", "-o", out]) == 0


def test_a_payload_file_with_an_edited_mass_is_refused(workshop: Path) -> None:
    document = json.loads((workshop / "payload.json").read_text(encoding="utf-8"))
    document["values"][0] *= 0.5
    edited = workshop / "edited.json"
    edited.write_text(json.dumps(document), encoding="utf-8")
    out = str(workshop / "edited.out")
    assert run(["payload", "export", str(edited), "--to", "kuka", "-o", out]) == 2


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--unloaded", "loaded", "--loaded", "loaded"], "named twice"),
        (["--loaded", "loaded"], "cannot be distinguished from the robot"),
        (["--loaded", "loaded", "--procedure", "model"], "--model MODEL"),
        (
            ["--unloaded", "other motion", "--loaded", "loaded", "--procedure", "difference"],
            "torques cannot be subtracted: use the procedure `together`",
        ),
        (
            ["--unloaded", "unloaded", "--loaded", "loaded", "--known", "mass=1"],
            "not a payload quantity",
        ),
        (["--unloaded", "unloaded", "--loaded", "loaded", "--known", "m"], "NAME=VALUE"),
        (["--unloaded", "loaded", "--loaded", "unloaded"], "check which runs carried"),
    ],
)
def test_contradictory_options_are_refused(
    workshop: Path, words: list[str], message: str, capsys: pytest.CaptureFixture[str]
) -> None:
    capsys.readouterr()
    assert run(identify(workshop, *words)) in (2, 6)
    assert message in capsys.readouterr().err


def test_a_model_of_another_robot_is_refused_with_any_torque_channel(
    workshop: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    late = TorqueChannel.of_delays(np.full(3, 0.004), np.full(3, 1e-4))
    model = workshop / "three_axes.json"
    write_estimate(model, replace(known_estimate(load_cell("ir361"), {}), channel=late))
    assert run(identify(workshop, "--loaded", "loaded", "--model", str(model))) == 2
    error = capsys.readouterr().err
    assert "[RID-ROBOT-OTHER]" in error
    assert "three_axes.json: " in error
    assert "'ir361'" in error


def test_a_payload_file_of_another_format_is_refused(workshop: Path, tmp_path: Path) -> None:
    document = json.loads((workshop / "payload.json").read_text())
    other = tmp_path / "other.json"
    other.write_text(json.dumps({**document, "format": 1}))
    with pytest.raises(ConfigError) as refused:
        read_payload(other)
    assert refused.value.refusal == "RID-FILE-FORMAT"
    assert run(["payload", "export", str(other), "--to", "ur", "-o", str(tmp_path / "l.txt")]) == 2
