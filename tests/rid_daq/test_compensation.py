"""The path error cut through the commands: loops, feedforward, refinement, before and after."""

from __future__ import annotations

import json
import shutil
from pathlib import Path
from typing import Any

import pytest

from config.load import load_cell, to_yaml
from rid_daq.app import run

# One cell is held by one session at a time, so these tests share a worker.
CIRCLE = """
kind: circle
robot: ir361
centre_m: [0.575, -0.078, -1.724]
radius_m: 0.2
speed_m_s: 0.6
near: [0.1, -0.1, 0.4]
periods: 4
transient_periods: 1
ramp_s: 1.0
"""
MULTISINE = """
kind: multisine
robot: ir361
period_s: 4.0
lowest_hz: 0.75
highest_hz: 15.0
realisations: 2
periods: 2
ramp_s: 1.0
joints:
- {joint: axis1, velocity: 0.05, slow_amplitude: 0.1}
- {joint: axis2, velocity: 0.04, slow_amplitude: 0.1}
- {joint: axis3, velocity: 0.06, slow_amplitude: 0.1}
"""


@pytest.fixture(scope="module")
def workshop(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of the simulated arm, its velocity loops, and a circle without compensation."""
    folder = tmp_path_factory.mktemp("compensation")
    # The bundled cell without its force plate, which takes as long as all the rest.
    bundled = load_cell("ir361").config
    arm = bundled.model_copy(update={"plate": None, "name": "arm"})
    (folder / "arm.yaml").write_text(to_yaml(arm))
    cell = str(folder / "arm.yaml")
    runs = ["--runs", str(folder / "runs")]
    (folder / "circle.yaml").write_text(CIRCLE)
    (folder / "multisine.yaml").write_text(MULTISINE)
    excitation = str(folder / "excitation.yaml")
    words = ["design", cell, "-o", excitation, "--method", "two-harmonic", "--periods", "3"]
    assert run(words) == 0
    assert run(["record", cell, excitation, "--label", "excitation", *runs]) == 0
    assert run(["identify", "excitation", "-o", str(folder / "model.json"), *runs]) == 0
    for label in ("multisine", "circle"):
        motion = str(folder / f"{label}.yaml")
        assert run(["record", cell, motion, "--label", label, *runs]) == 0
    words = ["loop", "multisine", "-o", str(folder / "loops.json"), *runs]
    assert run(words) == 0
    return folder


def document(capsys: pytest.CaptureFixture[str]) -> dict[str, Any]:
    found = json.loads(capsys.readouterr().out)
    assert isinstance(found, dict)
    return found


def by(workshop: Path) -> list[str]:
    """The options that say model and loops."""
    return ["--model", str(workshop / "model.json"), "--loop", str(workshop / "loops.json")]


@pytest.fixture(scope="module")
def compensated(workshop: Path) -> Path:
    """The feedforward of the circle, tuned by the plain circle, and a run with it."""
    cell, runs = str(workshop / "arm.yaml"), ["--runs", str(workshop / "runs")]
    circle, ahead = str(workshop / "circle.yaml"), str(workshop / "ahead.json")
    words = ["compensate", cell, circle, *by(workshop), "-o", ahead]
    assert run([*words, "--reference", "circle", *runs]) == 0
    words = ["record", cell, circle, "--feedforward", ahead, "--label", "compensated", *runs]
    assert run(words) == 0
    return workshop / "ahead.json"


def test_the_circle_comes_an_order_of_magnitude_closer(
    workshop: Path, compensated: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nothing is taken from the plant; the thesis went from 1.42 mm to 0.25 mm."""
    loops = json.loads((workshop / "loops.json").read_text())["loops"]
    for axis, gain in zip(loops, (900.0, 1300.0, 250.0), strict=True):
        assert axis["gain"] == pytest.approx(gain, rel=0.02)
    tuning = json.loads(compensated.read_text())["origin"]["tuning"]
    assert tuning["same_motion"]
    assert tuning["used"] == [True, True, True]
    assert tuning["scale"] == pytest.approx([1.0, 1.0, 1.0], abs=0.1)
    runs = ["--runs", str(workshop / "runs")]
    capsys.readouterr()
    assert run(["tracking", "compensated", "--against", "circle", "--json", *runs]) == 0
    found = document(capsys)
    (motion,) = found["motions"]
    assert motion["use"] == "tuned on it"
    assert 1e-3 < motion["against"]["mean_m"] < 3e-3
    assert motion["mean_ratio"] > 10.0
    assert motion["max_ratio"] > 6.0
    page = Path(found["report"]).read_text()
    assert "deviation drawn 10 times as large" in page
    assert "times closer than before" in page
    assert "tuned on it" in page


def test_one_refinement_makes_it_twenty_times_and_a_lie_about_the_last_is_noticed(
    workshop: Path, compensated: Path, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    cell, runs = str(workshop / "arm.yaml"), ["--runs", str(workshop / "runs")]
    better = str(workshop / "better.json")
    capsys.readouterr()
    assert run(["refine", "compensated", *by(workshop), "-o", better, "--json", *runs]) == 0
    found = document(capsys)
    assert not found["finished"]
    assert all(axis["bound"] < 0.5 for axis in found["axes"])
    circle = str(workshop / "circle.yaml")
    words = ["record", cell, circle, "--feedforward", better, "--label", "refined", *runs]
    assert run(words) == 0
    capsys.readouterr()
    assert run(["tracking", "refined", "--against", "circle", "--json", *runs]) == 0
    (motion,) = document(capsys)["motions"]
    assert motion["use"] == "refined 1 time"
    assert motion["mean_ratio"] > 20.0
    assert motion["max_ratio"] > 10.0

    # The same run, once as if it had been as good before, once as if it had been far better.
    (recorded,) = (
        path.parent
        for path in (workshop / "runs").glob("*/feedforward.json")
        if path.read_text() == (workshop / "better.json").read_text()
    )
    for factor, code, words in ((1.0, 0, "no longer shrinks"), (0.5, 6, "has grown since")):
        changed = tmp_path / str(factor) / recorded.name
        shutil.copytree(recorded, changed)
        file = json.loads((changed / "feedforward.json").read_text())
        capsys.readouterr()
        again = ["refine", str(recorded), *by(workshop), "-o", str(tmp_path / "x.json"), "--json"]
        assert run(again) == 0
        rms = [factor * axis["rms"] for axis in document(capsys)["axes"]]
        file["origin"]["refinements"][-1]["rms"] = rms
        (changed / "feedforward.json").write_text(json.dumps(file))
        again[1], again[-2:] = str(changed), [str(tmp_path / "y.json")]
        assert run(again) == code
        output = capsys.readouterr()
        assert words in output.out + output.err
    kept = json.loads((tmp_path / "y.json").read_text())
    assert kept["feedforward"] == json.loads((workshop / "better.json").read_text())["feedforward"]


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["loop", "circle"], "is of a circle motion"),
        (["compensate", "arm.yaml", "circle.yaml", "--model", "model.json"], "Missing option"),
        (
            ["record", "arm.yaml", "circle.yaml", "--feedforward", "model.json"],
            "is no feedforward file",
        ),
        (["tracking", "circle", "--against", "multisine"], "is of none of the motions given"),
        (
            ["refine", "circle", "multisine", "--model", "model.json", "--loop", "loops.json"],
            "differ in motion or feedforward",
        ),
    ],
)
def test_what_cannot_be_meant_is_one_clear_message(
    workshop: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    words: list[str],
    message: str,
) -> None:
    monkeypatch.chdir(workshop)
    capsys.readouterr()
    more = ["-o", "x.json"] if words[0] in ("compensate", "refine") else []
    assert run([*words, *more, *(["--runs", "runs"] if words[0] != "compensate" else [])]) == 2
    assert message in capsys.readouterr().err
