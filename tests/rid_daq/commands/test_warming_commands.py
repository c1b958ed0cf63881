"""Import, identification and validation of a robot that warms up."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from config.load import to_yaml
from identification.estimation.file import read_estimate
from rid_daq.app import run
from tests.builders.foreign_tables import as_lines, two_joint_map
from tests.builders.presliding_arm import arm
from tests.builders.warming_arm import CUTOFF_HZ, recording

JOINTS = [
    {"joint": f"axis{j}", "position": j, "torque": 3 + j} for j in (1, 2, 3)
]  # time, positions, torques
PLAUSIBLE = {"position": 10.0, "speed": 50.0, "torque": 5000.0}


def import_recording(folder: Path, label: str, seconds: float, seed: int) -> None:
    signals = recording(seconds, (60.0, None, 120.0), seed=seed, cutoff_hz=3.0 * CUTOFF_HZ)
    table = np.column_stack([signals.time_s, signals.position, signals.torque_nm])
    (folder / f"{label}.csv").write_text("\n".join(as_lines(table)))
    (folder / "robot.yaml").write_text(to_yaml(arm()))
    map_text = two_joint_map(robot="robot.yaml", joints=JOINTS, plausible=PLAUSIBLE)
    (folder / "map.yaml").write_text(to_yaml(map_text))
    words = ["import", str(folder / f"{label}.csv"), "--map", str(folder / "map.yaml")]
    assert run([*words, "--label", label, "--runs", str(folder / "runs")]) == 0


@pytest.mark.slow
def test_identify_selects_warming_and_validate_applies_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import_recording(tmp_path, "long", 300.0, 0)
    import_recording(tmp_path, "other", 120.0, 1)
    runs, model = ["--runs", str(tmp_path / "runs")], tmp_path / "model.json"
    band = ["--band", f"{CUTOFF_HZ:g}"]
    capsys.readouterr()
    code = run(["identify", "long", "--choose", *band, "-o", str(model), *runs])
    output = capsys.readouterr().out
    assert code == 0, output
    assert "The friction of axis1 changes as it warms up, with a time constant of" in output
    assert "friction of axis2 changes" not in output
    warming = read_estimate(model).warming
    assert warming is not None
    assert warming.joints.tolist() == [True, False, True]
    assert run(["validate", str(model), "other", *runs, "--json"]) == 0
    followed = json.loads(capsys.readouterr().out)
    plain_model = str(tmp_path / "plain.json")
    assert run(["identify", "long", *band, "-o", plain_model, *runs]) in (0, 6)
    capsys.readouterr()
    run(["validate", plain_model, "other", *runs, "--json"])
    plain = json.loads(capsys.readouterr().out)
    errors = [
        {axis["joint"]: axis["rms_error"] for axis in each["validation"]["axes"]}
        for each in (followed, plain)
    ]
    for joint in ("axis1", "axis3"):
        assert errors[0][joint] < 0.75 * errors[1][joint]
