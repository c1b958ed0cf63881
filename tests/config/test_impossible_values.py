"""Values of a file that cannot be physically right, or contradict another value of the files."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

import pytest

from config.errors import ConfigError
from config.load import load_cell, load_robot
from tests.builders.raised_codes import raises_code

Write = Callable[..., str]
AXIS = "- {joint: axis1, node_id: 1"
GAIN = "position_gain_per_s: 15.0"
ROBOT = "robot: ir361\n"


def bundled(kind: str, name: str = "ir361") -> str:
    return files("config").joinpath(f"bundled/{kind}/{name}.yaml").read_text()


@pytest.fixture
def write_cell(tmp_path: Path) -> Write:
    """Return a function that writes cell, robot and plant ir361, with replaced texts in one file.

    It returns the path of the cell file.
    """

    def write(*replaced: tuple[str, str], kind: str = "cell") -> str:
        for name in ("cell", "robot", "plant"):
            text = bundled(f"{name}s")
            if name == "cell":
                text = text.replace(ROBOT, "robot: robot.yaml\n")
                text = text.replace("plant: ir361", "plant: plant.yaml")
            for right, wrong in replaced if name == kind else ():
                assert right in text
                text = text.replace(right, wrong, 1)
            (tmp_path / f"{name}.yaml").write_text(text)
        return str(tmp_path / "cell.yaml")

    return write


IMPOSSIBLE = [
    ("cell", AXIS, f"{AXIS}, servo: {{encoder_increments: 100.0}}", "encoder_increments", "100"),
    ("cell", "error_rad: 0.1", "error_rad: 0.1\n  torque_limit_fraction: 6.5", "fraction", "5"),
    (
        *("cell", "error_rad: 0.1", "error_rad: 0.1\n  following_error_timeout_ms: 60000"),
        *("following_error_timeout_ms", "60000", "1000"),
    ),
    ("cell", GAIN, "position_gain_per_s: 63.0", "position_gain_per_s", "63", "62.5 1/s"),
    ("cell", "percent: [5.0,", "percent: [150.0,", "validation_limits_percent.0", "150"),
    (
        *("cell", "  a_m: 0.120", "  zero: {offset_n: [1300, 0, 0, 0, 0, 0, 0, 0]}\n  a_m: 0.120"),
        *("fx12", "1300", "1250"),
    ),
    ("cell", "[1.0019,", "[-7.5,", "fx12", "-7.5"),
    ("robot", "velocity: 2.6", "velocity: 55.0", "joints.0.motor_speed_rad_s", "6655"),
    ("robot", "acceleration: 10.0", "acceleration: 573.0", "joints.0.limits.acceleration_time_s"),
    (
        *("robot", "acceleration: 10.0", "acceleration: 100.0"),  # degrees/s^2, of a slow robot
        *("joints.0.limits.acceleration_time_s", "0.026", "0.04", "degrees/s²", "1.49"),
    ),
    (
        *("robot", "acceleration: 10.0, torque: 450.0}", "acceleration: 900.0, torque: 450.0}"),
        "joints.0.limits.acceleration_time_s",
    ),
    ("robot", "acceleration: 10.0", "acceleration: 0.02", "joints.0.limits.acceleration_time_s"),
    ("robot", "position_max: 2.7", "position_max: -2.6999", "joints.0.limits.position_range"),
    ("robot", "gear_ratio: 121.0", "gear_ratio: 121.0\n    efficiency: 0.01", "efficiency"),
    (
        *("robot", "gear_ratio: 121.0", "gear_ratio: 121.0\n    torque_constant_nm_per_a: 0.1"),
        *("joints.0.current_at_torque_limit_a", "4500 A"),
    ),
    (
        *("robot", "name: ir361"),
        "name: ir361\ncoupling: [[1.0, 0.0, 0.0], [0.0, 500.0, 0.0], [0.0, 0.0, 1.0]]",
        *("coupling.1.1", "500"),
    ),
    ("plant", "peak_motor_torque_nm: 4.5", "peak_motor_torque_nm: 1.4", "peak_motor", "1.5"),
]


@pytest.mark.parametrize("case", IMPOSSIBLE, ids=lambda case: case[3])
def test_an_impossible_value_is_refused_with_its_key(
    case: tuple[str, ...], write_cell: Write
) -> None:
    kind, right, wrong, *values = case
    load_cell(write_cell())
    path = write_cell((right, wrong), kind=kind)
    with raises_code(ConfigError, "RID-FILE-VALUE", f"{kind}.yaml:", *values):
        load_cell(path)


def test_a_linear_joint_may_reach_its_speed_sooner_than_a_turning_one(write_cell: Write) -> None:
    slides = "name: axis3\n    type: prismatic"
    fast = ("velocity: 3.0, acceleration: 14.0", "velocity: 3.0, acceleration: 300.0")
    load_cell(write_cell(("name: axis3", slides), fast, kind="robot"))
    millimetres = (fast[0], "velocity: 2.0, acceleration: 450.0")
    with raises_code(ConfigError, "RID-FILE-VALUE", "joints.2.limits.acceleration_time_s", "mm/s²"):
        load_cell(write_cell(("name: axis3", slides), millimetres, kind="robot"))
    with raises_code(ConfigError, "RID-FILE-VALUE", "joints.2.limits.acceleration_time_s"):
        load_cell(write_cell(fast, kind="robot"))


def test_a_profile_in_its_own_file_has_the_same_ranges(write_cell: Write, tmp_path: Path) -> None:
    servo = f"{ROBOT}servo: family.yaml\n"
    path = write_cell((ROBOT.replace("ir361", "robot.yaml"), servo.replace("ir361", "robot.yaml")))
    (tmp_path / "family.yaml").write_text("{encoder_increments: 4096.0, rated_torque_nm: 1.5}\n")
    load_cell(path)
    (tmp_path / "family.yaml").write_text("{encoder_increments: 64.0}\n")
    with raises_code(
        ConfigError, "RID-FILE-VALUE", "family.yaml:1:", "64", "implausible_on_purpose"
    ):
        load_cell(path)


def test_a_motor_with_few_increments_is_accepted_if_it_is_declared(write_cell: Write) -> None:
    declared = "implausible_on_purpose: [axes.0.servo.encoder_increments]\nname: ir361"
    path = write_cell(
        (AXIS, f"{AXIS}, servo: {{encoder_increments: 64.0}}"), ("name: ir361", declared)
    )
    cell = load_cell(path).config
    assert cell.servo_of(cell.axes[0]).encoder_increments == 64.0


def test_a_payload_that_weighs_far_more_than_the_arm_is_refused(tmp_path: Path) -> None:
    text = bundled("robots", "ur10e")
    assert "rated_payload_kg: 12.5" in text
    path = tmp_path / "robot.yaml"
    path.write_text(text)
    load_robot(str(path))
    path.write_text(text.replace("rated_payload_kg: 12.5", "rated_payload_kg: 1250.0"))
    with raises_code(ConfigError, "RID-FILE-VALUE", "rated_payload_by_arm_mass"):
        load_robot(str(path))


@pytest.mark.parametrize(
    "name", ["ir361", "ir361_elastic", "ir361_thesis", "kr15", "exercise"], ids=str
)
def test_every_bundled_cell_stays_valid(name: str) -> None:
    assert load_cell(name).config.name
