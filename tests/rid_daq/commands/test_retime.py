"""`rid-daq retime`: a faster motion file and its report; invalid requests are refused."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
import pytest

from acquisition.motion.limits import verify_limits
from acquisition.motion.motion_file import load_motion
from acquisition.motion.samples import MotionSamples
from compensation.timing.timed_motion import retime_path
from config.arrays import FloatArray
from config.load import load_cell
from config.simulation.plant import MountedBody as HungBody
from dynamics.geometry.kinematics import Chain, forward
from identification.estimation.estimate import predict
from identification.estimation.file import read_estimate, write_estimate
from identification.payload.body import PayloadBody
from identification.payload.file import read_payload, write_payload
from identification.payload.verdict import PayloadCheck, PayloadResult
from mock_hw.plant.rigid_bodies import build_rigid_bodies
from rid_daq.app import run
from tests.builders.certified import estimate_of
from tests.builders.json_output import document
from tests.builders.known_model import known_estimate

PATH = """
kind: joint_path
robot: ir361
speed_fraction: 0.6
points:
- [0.0, 0.0, 0.0]
- [0.5, 0.3, -0.4]
- [0.9, 0.1, 0.3]
- [0.0, 0.2, 0.5]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    estimate = known_estimate(load_cell("ir361"), {})
    estimate = replace(estimate, covariance_jackknife=np.diag((0.01 * estimate.values) ** 2))
    write_estimate(tmp_path / "model.json", estimate)
    (tmp_path / "path.yaml").write_text(PATH)
    return tmp_path


def retime_words(folder: Path, *more: object) -> list[str]:
    model, path, fast = (str(folder / name) for name in ("model.json", "path.yaml", "fast.yaml"))
    words = ["retime", "ir361", path, "--model", model, "-o", fast]
    return [*words, *(str(word) for word in more)]


MASS_KG, CENTRE_M, INERTIA_KG_M2 = 12.0, (0.10, 0.02, -0.05), (0.3, 0.2, 0.25)
"""A tool on the flange; its inertias about its centre of gravity."""


@pytest.fixture
def tool(folder: Path) -> Path:
    body = PayloadBody(MASS_KG, np.array(CENTRE_M), np.diag(INERTIA_KG_M2))
    estimate = replace(estimate_of(load_cell("ir361"), ()), values=body.parameters)
    enough = (PayloadCheck("independent parameters that the motion determines", 10, "≥", 10),)
    write_payload(folder / "payload.json", PayloadResult(estimate, enough))
    return folder / "payload.json"


def test_a_payload_that_did_not_pass_its_verdict_is_refused(
    folder: Path, tool: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    failed = replace(read_payload(tool), checks=(PayloadCheck("mass", 2.0, "≤", 1.0, "%"),))
    write_payload(tool, failed)
    assert run(retime_words(folder, "--payload", tool)) == 6
    assert "RID-PAYLOAD-FAILED" in capsys.readouterr().err
    assert not (folder / "fast.yaml").exists()


def tool_torques(samples: MotionSamples) -> FloatArray:
    """Return the torques due to the tool [N m], shape (samples, joints).

    They are the difference of two Pinocchio models.
    """
    cell = load_cell("ir361")
    assert cell.plant is not None
    xx, yy, zz = INERTIA_KG_M2
    x, y, z = CENTRE_M
    offset_x, offset_y, offset_z = cell.robot.tool_offset_m
    hung = HungBody(
        mass_kg=MASS_KG,
        centre_m=(offset_x + x, offset_y + y, offset_z + z),
        inertia_kg_m2=(xx, yy, zz, 0.0, 0.0, 0.0),
    )
    bare = cell.plant.without_unmodelled().model_copy(update={"payloads": {"tool": hung}})
    found = []
    for plant in (bare.with_payload("tool"), bare):
        bodies = build_rigid_bodies(cell.robot, plant)
        data, gearing = bodies.model.createData(), bodies.gearing
        found.append(
            np.array(
                [
                    gearing.T @ pin.rnea(bodies.model, data, *(gearing @ row for row in rows))
                    for rows in zip(
                        samples.position, samples.velocity, samples.acceleration, strict=True
                    )
                ]
            )
        )
    carrying, alone = found
    return np.asarray(carrying - alone)


def planned_motion(file: Path) -> MotionSamples:
    cell = load_cell("ir361")
    return load_motion(file).plan(cell.robot, cell.config.cycle_time_s)


def test_the_payload_reduces_the_speed_so_that_torque_limits_hold(
    folder: Path, tool: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model = read_estimate(folder / "model.json")
    limit = np.array([joint.limits.torque for joint in model.robot.joints])
    moving_s, over = {}, {}
    for name, more in (("empty", []), ("carrying", ["--payload", tool])):
        bold = ["--confidence", "0", "--json", "--overwrite"]
        assert run(retime_words(folder, *bold, *more)) == 0
        moving_s[name] = document(capsys)["moving_s"]
        samples = planned_motion(folder / "fast.yaml")
        robot_torque = predict(model, samples.position, samples.velocity, samples.acceleration)
        over[name] = (np.abs(robot_torque + tool_torques(samples)) / limit).max()
    assert moving_s["carrying"] > 1.03 * moving_s["empty"]
    assert 0.97 < over["carrying"] <= 1.0 + 1e-9
    assert over["empty"] > 1.05


def test_a_result_beyond_the_torque_limits_with_payload_is_not_written(
    folder: Path,
    tool: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """The test patches the search so that it ignores the payload."""
    empty = read_estimate(folder / "model.json")
    monkeypatch.setattr(
        "rid_daq.operations.path.retiming.retime_path",
        lambda samples, robot, _loaded, *known_estimate, **more: retime_path(
            samples, robot, empty, *known_estimate, **more
        ),
    )
    assert run(retime_words(folder, "--confidence", "0", "--payload", tool)) != 0
    assert "RID-INTERNAL-ERROR" in capsys.readouterr().err
    assert not (folder / "fast.yaml").exists()


@pytest.mark.usefixtures("drawn_reports")
def test_a_faster_motion_and_its_report_are_written(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(retime_words(folder, "--report", folder / "fast.html", "--json")) == 0
    result = document(capsys)
    assert result["shorter_percent"] > 20.0
    assert result["off_the_path"] < 1e-4
    assert [joint["joint"] for joint in result["joints"]] == ["axis1", "axis2", "axis3"]
    cell = load_cell("ir361")
    motion = load_motion(folder / "fast.yaml")
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    verify_limits(samples, cell.robot)
    model = read_estimate(folder / "model.json")
    torque = np.abs(predict(model, samples.position, samples.velocity, samples.acceleration))
    for j, joint in enumerate(result["joints"]):
        assert torque[:, j].max() == pytest.approx(joint["torque_peak"], rel=1e-6)
        assert torque[:, j].max() + joint["torque_margin"] * 0.5 < joint["torque_limit"]
    page = (folder / "fast.html").read_text()
    assert "Retimed path" in page
    assert "limit curve" in page
    assert "path.yaml" in page
    assert "completed path [%]" in page
    assert f"original, {result['original_s']:.4g} s" in page
    assert f"timed, {result['moving_s']:.4g} s" in page


CIRCLE = """
kind: circle
robot: ir361
centre_m: [0.575, -0.078, -1.724]
radius_m: 0.1
speed_m_s: 0.3
near: [0.1, -0.1, 0.4]
periods: 1
transient_periods: 1
ramp_s: 0.5
"""
WAVES = """
period_s: 6.0
periods: 2
joints:
- {joint: axis1, sine: [0.3, 0.1], cosine: [0.2, 0.0]}
- {joint: axis2, offset: -0.2, sine: [0.2, 0.1], cosine: [0.1, 0.05]}
- {joint: axis3, offset: 0.3, sine: [0.2, 0.1], cosine: [0.1, 0.05]}
"""
MULTISINE = """
period_s: 4.0
lowest_hz: 1.0
highest_hz: 10.0
joints:
- {joint: axis1, velocity: 0.05}
"""
CONSTANT = """
pose: [0.0, 0.0, 0.3]
joints:
- {joint: axis1, low: -0.5, high: 0.5, speeds: [0.3, 0.6]}
"""
TABLE = """
joints: [axis1, axis2, axis3]
time_s: [0.0, 0.2, 0.4, 0.6, 0.8, 1.0]
position:
- [0.0, 0.0, 0.0]
- [0.1, 0.0, 0.0]
- [0.2, 0.0, 0.0]
- [0.3, 0.0, 0.0]
- [0.4, 0.0, 0.0]
- [0.5, 0.0, 0.0]
"""


@pytest.mark.parametrize("other", ["fast.yaml", "sub/../fast.yaml"])
def test_a_report_with_the_name_of_the_motion_is_refused_before_the_search(
    folder: Path, other: str, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "sub").mkdir()
    assert run(retime_words(folder, "--report", folder / other, "--overwrite")) == 2
    assert "RID-OPTION-EXCLUSIVE" in capsys.readouterr().err
    assert not (folder / "fast.yaml").exists()


def test_several_turns_of_a_circle_become_one_path(folder: Path) -> None:
    (folder / "path.yaml").write_text(CIRCLE)
    assert run(retime_words(folder, "--report", folder / "fast.html")) == 0
    assert "The motion was periodic" in (folder / "fast.html").read_text()
    samples = planned_motion(folder / "fast.yaml")
    assert samples.periods == 0
    assert not samples.velocity[[0, -1]].any()
    turned = np.unwrap(np.arctan2(*(tool_positions(samples) - [0.575, -0.078]).T[::-1]))
    assert abs(turned[-1] - turned[0]) > 2.0 * 2.0 * np.pi


def tool_positions(samples: MotionSamples) -> FloatArray:
    """Return the x and y positions of the tool point [m], shape (samples, 2)."""
    chain = Chain.from_description(load_cell("ir361").robot)
    return np.asarray(forward(chain, samples.position)[:, :2])


@pytest.mark.parametrize(
    ("kind", "keys", "message"),
    [
        ("fourier", WAVES, "the periods of this motion of kind fourier"),
        ("reversed", WAVES, "the forward and backward periods of this"),
        ("multisine", MULTISINE, "the periods and frequencies of this"),
        ("constant_velocity", CONSTANT, "the speeds of this motion of kind"),
        ("joint_table", TABLE, "the table must begin and end at rest"),
    ],
)
def test_a_motion_that_is_not_a_path_from_rest_to_rest_is_refused(
    kind: str, keys: str, message: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (folder / "path.yaml").write_text(f"kind: {kind}\nrobot: ir361{keys}")
    assert run(retime_words(folder)) == 2
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (folder / "fast.yaml").exists()


def test_the_output_ends_with_the_record_command(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(retime_words(folder, "--confidence", "0", "--margin", "0.1")) == 0
    output = capsys.readouterr().out
    assert "% shorter" in output
    assert "periodic" not in output
    assert "rid-daq record ir361" in output


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--confidence", "1.5"], "--confidence: 1.5 is outside its range"),
        (["--margin", "2"], "--margin: 2 is outside its range"),
        (["--margin", "0.97"], "at any speed: torque of axis3"),
        (
            ["--jerk", "1", "--jerk", "2"],
            "--jerk has 2 values: give one value, or one for each of the 3",
        ),
        (["--torque-rate", "-1"], "--torque-rate: -1 is outside its range"),
        (["--mass", "300"], "--mass"),
        (["--base-limits"], "RID-MODEL-NOT-COMBINED"),
        (["--rms-torque", "5"], "RMS torque of axis2 is"),
    ],
)
def test_invalid_options_are_named_and_no_file_is_written(
    more: list[str], message: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(retime_words(folder, *more)) != 0
    assert message in " ".join(capsys.readouterr().err.split())
    assert not (folder / "fast.yaml").exists()
