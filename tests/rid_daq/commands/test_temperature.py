"""`compensate`, `retime`, `refine` and `stream` with temperature-dependent friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from acquisition.motion.motion_file import load_motion
from compensation.compensated_motion import compensated_motion, refuse_torque
from compensation.feedforward.file import read_feedforward
from compensation.loops.loop_file import read_loops, write_loops
from compensation.loops.velocity_loop import VelocityLoop
from compensation.operating_temperature import at_operating_temperature
from config.errors import ConfigError, LimitError
from config.load import LoadedCell, load_cell
from identification.elasticity.limit_torque import limit_temperature_note
from identification.estimation.estimate import predict
from identification.estimation.file import read_estimate, write_estimate
from rid_daq.app import run
from rid_daq.workbench.motion_blocks import motion_blocks
from tests.builders.json_output import document
from tests.builders.raised_codes import raises_code
from tests.builders.warm_model import FALL, by_temperature

PATH = """
kind: joint_path
robot: ir361
speed_fraction: 0.4
points:
- [0.0, 0.0, 0.0]
- [0.5, 0.3, -0.4]
- [0.9, 0.1, 0.3]
"""


@pytest.fixture(scope="module")
def cell() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture
def folder(tmp_path: Path, cell: LoadedCell) -> Path:
    for name, measured in (("measured", True), ("followed", False)):
        write_estimate(tmp_path / f"{name}.json", by_temperature(cell, measured=measured))
    loops = [
        VelocityLoop(joint, 500.0, 0.08, 0.0, 0.002, ("gain",), np.eye(1), 1.0, ())
        for joint in cell.robot.joint_names
    ]
    write_loops(tmp_path / "loops.json", loops, "ir361", "a run")
    (tmp_path / "path.yaml").write_text(PATH)
    return tmp_path


def command_words(folder: Path, command: str, model: str, *more: str) -> list[str]:
    loop = [] if command == "retime" else ["--loop", str(folder / "loops.json")]
    out = [] if command == "stream" else ["-o", str(folder / "out"), "--overwrite"]
    path, file = str(folder / "path.yaml"), str(folder / f"{model}.json")
    return [command, "ir361", path, "--model", file, *loop, *out, *more]


@pytest.mark.parametrize(
    ("model", "temperature"), [("followed", "warm"), ("followed", "cold"), ("measured", "55,40,30")]
)
def test_the_feedforward_uses_the_friction_at_the_stated_temperature(
    folder: Path,
    cell: LoadedCell,
    capsys: pytest.CaptureFixture[str],
    model: str,
    temperature: str,
) -> None:
    more = ("--temperature", temperature, "--runs", str(folder / "runs"), "--json")
    assert run(command_words(folder, "compensate", model, *more)) == 0
    samples = load_motion(folder / "path.yaml").plan(cell.robot, cell.config.cycle_time_s)
    estimate = read_estimate(folder / f"{model}.json")
    warm = at_operating_temperature(estimate, temperature, samples.whole().velocity)
    assert document(capsys)["notes"] == warm.notes
    file = read_feedforward(folder / "out")
    assert file.origin.temperature == temperature
    with raises_code(ConfigError, "RID-FEEDFORWARD-OTHER-MOTION", f"{len(samples)} rows"):
        file.onto(replace(samples, sample_period_s=2.0 * samples.sample_period_s))
    written = file.onto(samples).feedforward
    loops = read_loops(folder / "loops.json")[1]
    expected = compensated_motion(samples, warm.estimate, loops).feedforward
    assert written is not None
    assert expected is not None
    np.testing.assert_allclose(written, expected, atol=1e-9)


def test_retime_warm_uses_the_temperature_that_the_path_causes(
    folder: Path, cell: LoadedCell, capsys: pytest.CaptureFixture[str]
) -> None:
    peaks = {}
    for temperature in ("cold", "warm"):
        more = ("--temperature", temperature, "--confidence", "0", "--json")
        assert run(command_words(folder, "retime", "followed", *more)) == 0
        result = document(capsys)
        peaks[temperature] = result["joints"][0]["torque_peak"]
    estimate = read_estimate(folder / "followed.json")
    driven = load_motion(folder / "out").plan(cell.robot, cell.config.cycle_time_s).whole()
    assert estimate.warming is not None
    rise = estimate.warming.steady_temperatures(estimate.robot, driven.velocity)[0] - 298.15
    power_w = float(result["notes"][0].split(" W in axis1")[0].rsplit(" ", 1)[1])
    assert power_w == pytest.approx(rise, rel=0.05)
    # Friction falls with temperature. Gravity has no effect on axis 1, so its peak torque falls
    # by the same amount.
    coulomb = estimate.values[estimate.base.names.index("fc_axis1")]
    assert peaks["warm"] < peaks["cold"] - 0.9 * FALL * rise * coulomb


@pytest.mark.parametrize("command", ["compensate", "retime", "stream"])
def test_a_missing_temperature_option_is_refused(
    folder: Path, capsys: pytest.CaptureFixture[str], command: str
) -> None:
    assert run(command_words(folder, command, "followed")) == 2
    output = " ".join(capsys.readouterr().err.split())
    assert "axis1, axis2" in output
    assert "RID-MODEL-TEMPERATURE" in output
    assert "--temperature warm" in output
    assert not (folder / "out").exists()


@pytest.mark.parametrize("model", ["followed", "measured"])
def test_torque_limits_are_checked_at_a_default_temperature_which_is_noted(
    folder: Path, cell: LoadedCell, capsys: pytest.CaptureFixture[str], model: str
) -> None:
    file = folder / f"{model}.json"
    note = limit_temperature_note(read_estimate(file))
    assert note
    path = folder / "path.yaml"
    assert run(["record", "ir361", str(path), "--model", str(file), "--runs", str(folder)]) == 0
    assert note in " ".join(capsys.readouterr().out.split())
    multisine = ["design", "ir361", "--kind", "multisine", "--period", "4", "--realisations", "1"]
    assert run([*multisine, "--model", str(file), "-o", str(folder / "sines.yaml")]) == 0
    assert note in " ".join(capsys.readouterr().out.split())
    drawn = " ".join(map(repr, motion_blocks(cell, path, file)))
    assert {"followed": "cold or the warm", "measured": "reference temperature"}[model] in drawn


def test_a_motion_beyond_the_torque_limit_of_a_cold_joint_is_refused(
    folder: Path, cell: LoadedCell
) -> None:
    motion = load_motion(folder / "path.yaml")
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    estimate = read_estimate(folder / "followed.json")
    way = (samples.position, samples.velocity, samples.acceleration)
    peaks = [
        np.abs(predict(at_operating_temperature(estimate, temperature, way[1]).estimate, *way)).max(
            axis=0
        )[0]
        for temperature in ("cold", "warm")
    ]
    between = 0.5 * sum(peaks)
    assert peaks[0] > between > peaks[1]
    first, *rest = cell.robot.joints
    limits = first.limits.model_copy(update={"torque": between})
    robot = cell.robot.model_copy(
        update={"joints": (first.model_copy(update={"limits": limits}), *rest)}
    )
    with raises_code(LimitError, "RID-MOTION-LIMIT", "'axis1'"):
        refuse_torque(motion, samples, estimate, robot)
