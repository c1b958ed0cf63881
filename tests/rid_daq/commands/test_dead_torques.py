"""A run in which a moving joint has a constant torque is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.imports.read import import_csv
from acquisition.processing.dead_torque import dead_torques
from acquisition.processing.smoothing import smooth_nonperiodic
from acquisition.recording.recording import Recording
from config.load import to_yaml
from identification.estimation.file import write_estimate
from identification.estimation.fitted_signals import fit_smoothed
from identification.estimation.options import EstimationOptions
from identification.model.options import ModelOptions
from rid_daq.app import run
from tests.builders.foreign_tables import as_lines, sound_table, two_joint_map, two_joint_robot

ROBOT, MAP = two_joint_robot(), two_joint_map(robot="robot.yaml")
SOUND = sound_table(1200)


def imported_recording(folder: Path, table: np.ndarray) -> Recording:
    """Return the recording of a table, and write the files that `import` needs into a folder."""
    (folder / "rec.csv").write_text("\n".join(as_lines(table)))
    (folder / "robot.yaml").write_text(to_yaml(ROBOT))
    (folder / "map.yaml").write_text(to_yaml(MAP))
    return import_csv(folder / "rec.csv", MAP, ROBOT)[0]


def with_constant_torque(column: int, value: float = 0.0) -> np.ndarray:
    table = SOUND.copy()
    table[:, column] = value
    return table


@pytest.mark.parametrize(("column", "dead"), [(5, {"a": 6.0}), (6, {"b": 3.0})])
def test_a_constant_torque_of_a_moving_joint_is_dead(
    column: int, dead: dict[str, float], tmp_path: Path
) -> None:
    assert dead_torques(imported_recording(tmp_path, with_constant_torque(column, 3.0))) == dead


def test_a_constant_torque_of_a_joint_at_rest_is_not_dead(tmp_path: Path) -> None:
    table = with_constant_torque(6)
    table[:, [2, 4]] = 0.5, 0.0
    assert dead_torques(imported_recording(tmp_path, table)) == {}
    assert dead_torques(imported_recording(tmp_path, SOUND)) == {}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with a run whose torque column is constant, and a model of another run."""
    folder = tmp_path_factory.mktemp("dead")
    sound = imported_recording(folder, SOUND)
    options = EstimationOptions(ModelOptions(friction_terms=("viscous",)))
    estimate = fit_smoothed(ROBOT, [smooth_nonperiodic(sound, 5.0)], options).estimate()
    write_estimate(folder / "model.json", estimate)
    imported_recording(folder, with_constant_torque(6))
    words = [str(folder / "rec.csv"), "--map", str(folder / "map.yaml"), "--label", "dead"]
    assert run(["import", *words, "--runs", str(folder / "runs")]) == 0
    return folder


@pytest.mark.parametrize(
    "command",
    [
        ["identify", "dead"],
        ["identify", "dead", "--choose"],
        ["validate", "MODEL", "dead"],
        ["compare", "MODEL", "MODEL", "--on", "dead"],
        ["payload", "identify", "--loaded", "dead", "--model", "MODEL"],
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_every_command_refuses_a_run_with_a_dead_torque(
    folder: Path, command: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    words = [str(folder / "model.json") if word == "MODEL" else word for word in command]
    capsys.readouterr()
    assert run([*words, "--runs", str(folder / "runs")]) == 6
    output = " ".join(capsys.readouterr().err.split())
    assert "the torque of moving joints was not measured: b (always 0)." in output
    assert output.endswith("[RID-RUN-NO-TORQUE]")
