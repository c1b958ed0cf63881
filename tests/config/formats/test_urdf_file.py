"""URDF files: strict numbers, unread elements listed, mimic joints coupled."""

from __future__ import annotations

import numpy as np
import pytest

from config.errors import ConfigError
from config.formats.urdf_file import read_urdf
from config.robot.urdf_robot import UrdfRobot, robot_of_urdf
from tests.builders.raised_codes import raises_code

INERTIAL = (
    '<inertial><origin xyz="0.1 0 0" rpy="0 0 0"/><mass value="3"/>'
    '<inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>'
)
COLLISION = '<collision><geometry><cylinder radius="0.05" length="0.2"/></geometry></collision>'
TRANSMISSION = (
    '<transmission name="t"><joint name="j2"/><actuator name="m">'
    "<mechanicalReduction>50</mechanicalReduction>"
    '<drake:rotor_inertia value="2e-4"/></actuator></transmission>'
)
ARM = f"""<?xml version="1.0"?>
<robot name="r">
<link name="base"/>
<link name="l1">{INERTIAL}</link>
<link name="l2">{INERTIAL}{COLLISION}</link>
<joint name="j1" type="revolute"><parent link="base"/><child link="l1"/>
<limit lower="-2" upper="2" effort="60" velocity="2"/></joint>
<joint name="j2" type="revolute"><parent link="l1"/><child link="l2"/>
<origin xyz="0.4 0 0" rpy="1.5708 0 0"/><axis xyz="0 0 1"/>
<limit lower="-1.5" upper="1.25" effort="50" velocity="2.5" acceleration="7"/>
<dynamics damping="1.5" friction="2.5"/>
<safety_controller soft_lower_limit="-1.4" soft_upper_limit="1.2" k_velocity="10"/></joint>
{TRANSMISSION}
</robot>
"""


def robot_with(*changes: tuple[str, str]) -> UrdfRobot:
    """Return the robot of the arm's URDF after replacements of text."""
    text = ARM
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    return robot_of_urdf(read_urdf(text.encode(), "r.urdf"))


def position(text: str) -> str:
    """Return file and line of a text in the URDF, as errors state them."""
    return f"r.urdf:{ARM[: ARM.index(text)].count(chr(10)) + 1}: "


def test_a_valid_arm_is_read_completely() -> None:
    robot = robot_with()
    limits = robot.robot.joints[1].limits
    assert (limits.position_min, limits.position_max) == (-1.4, 1.2)
    assert (limits.velocity, limits.torque, limits.acceleration) == (2.5, 50.0, 7.0)
    assert robot.robot.joints[1].gear_ratio == 50.0
    assert (robot.motors[1].coulomb, robot.motors[1].viscous) == (2.5, 1.5)
    assert robot.robot.kinematics.rows[1].alpha_rad == np.pi / 2
    assert any("0.0002 kg m²" in note for note in robot.notes)


NUMBERS = [
    *('lower="-1.5"', 'upper="1.25"', 'effort="50"', 'velocity="2.5"', 'acceleration="7"'),
    *('damping="1.5"', 'friction="2.5"', 'soft_lower_limit="-1.4"', 'soft_upper_limit="1.2"'),
    *('mass value="3"', 'ixx="0.02"', 'ixy="0"', 'izz="0.02"', 'radius="0.05"', 'length="0.2"'),
    'rotor_inertia value="2e-4"',
]
JOINT = '<joint name="j2" type'
AT_THE_JOINT = ("<mechanicalReduction>50", 'velocity="2.5"', 'xyz="0 0 1"')
LISTS = ['xyz="0.4 0 0"', 'rpy="1.5708 0 0"', 'xyz="0 0 1"', 'xyz="0.1 0 0"']


@pytest.mark.parametrize("wrong", ["1,5", "1_5", "${pi/6}", "1.5 m", "", "0x1", "1.5°"])
@pytest.mark.parametrize("number", NUMBERS)
def test_an_unreadable_number_is_refused_with_its_line(number: str, wrong: str) -> None:
    key, _, _ = number.partition("=")
    with raises_code(ConfigError, "RID-FILE-NUMBER", position(number)):
        robot_with((number, f'{key}="{wrong}"'))


@pytest.mark.parametrize(
    "wrong", ["0,4 0 0", "0 0", "0 0 0 0", "nan 0 0", "${pi/2} 0 0", "1_0 0 0"]
)
@pytest.mark.parametrize("numbers", LISTS)
def test_an_unreadable_list_is_refused_with_its_line(numbers: str, wrong: str) -> None:
    key, _, _ = numbers.partition("=")
    with raises_code(ConfigError, "RID-FILE-NUMBER", position(numbers)):
        robot_with((numbers, f'{key}="{wrong}"'))


@pytest.mark.parametrize("key", ["lower", "upper", "velocity", "effort"])
def test_nan_is_refused_as_any_limit(key: str) -> None:
    old = next(number for number in NUMBERS if number.startswith(f"{key}="))
    with pytest.raises(ConfigError) as refused:
        robot_with((old, f'{key}="nan"'))
    assert refused.value.refusal == "RID-FILE-NUMBER"


@pytest.mark.parametrize(
    ("old", "new", "code"),
    [
        ('rpy="1.5708 0 0"', 'rpy="90 0 0"', "RID-URDF-ANGLE"),
        ('mass value="3"', 'mass value="-3"', "RID-URDF-VALUE"),
        ('friction="2.5"', 'friction="-2.5"', "RID-URDF-VALUE"),
        ('damping="1.5"', 'damping="-1.5"', "RID-URDF-VALUE"),
        ("<mechanicalReduction>50", "<mechanicalReduction>50:1", "RID-FILE-NUMBER"),
        ("<mechanicalReduction>50", "<mechanicalReduction>N/A", "RID-FILE-NUMBER"),
        ("<mechanicalReduction>50", "<mechanicalReduction>1e5", "RID-URDF-GEAR"),
        ("<transmission", f"{TRANSMISSION}<transmission", "RID-FILE-DUPLICATE"),
        ('velocity="2.5"', 'velocity="143"', "RID-URDF-LIMIT"),
        ('xyz="0 0 1"', 'xyz="0 0 0"', "RID-URDF-STRUCTURE"),
    ],
)
def test_impossible_values_are_refused_with_file_and_line(old: str, new: str, code: str) -> None:
    where = JOINT if old in AT_THE_JOINT and code != "RID-FILE-NUMBER" else old
    with raises_code(ConfigError, code, position(where)):
        robot_with((old, new))


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('upper="1.25"', 'upper="1.25" uper="3"', "'uper' of <limit>"),
        ("<dynamics", "<dynamix/><dynamics", "<dynamix> of <joint>"),
        ('rpy="1.5708 0 0"', 'rpy="1.5708 0 0" quat="0 0 0 1"', "'quat' of <origin>"),
        ('xyz="0 0 1"', 'xyz="0 0 2"', "length 2"),
        ('rpy="1.5708 0 0"', 'rpy="1.5702 0 0"', "close to a multiple of 15 degrees"),
        ('joint name="j2"/>', 'joint name="j9"/>', "j9: no joint has this name"),
    ],
)
def test_unread_elements_are_listed(old: str, new: str, named: str) -> None:
    assert any(named in note for note in robot_with((old, new)).notes)
    assert not any(named in note for note in robot_with().notes)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ('<limit lower="-1.5"', '<Limit lower="-1.5"', "<limit>"),
        ('lower="-1.5"', 'Lower="-1.5"', "'lower'"),
        ('<axis xyz="0 0 1"', '<axis XYZ="0 0 1"', "'xyz'"),
        ('damping="1.5"', 'Damping="1.5"', "'damping'"),
        ('rpy="1.5708 0 0"', 'quat_xyzw="0.7 0 0 0.7"', "rpy"),
    ],
)
def test_a_name_in_another_case_and_a_quaternion_are_refused(
    old: str, new: str, named: str
) -> None:
    where = position(old)
    with raises_code(ConfigError, "RID-URDF-STRUCTURE", where, named):
        robot_with((old, new))


def test_the_offset_of_a_transmission_is_listed() -> None:
    offset = '<joint name="j2"><offset>1</offset></joint><act'
    robot = robot_with(('<joint name="j2"/><act', offset))
    assert [note for note in robot.notes if "<offset>" in note and "r.urdf:" in note]


def test_a_motor_opposite_to_its_joint_has_direction_minus_1_and_a_positive_ratio() -> None:
    robot = robot_with(("<mechanicalReduction>50", "<mechanicalReduction>-50"))
    assert robot.robot.joints[1].gear_ratio == 50.0
    assert [motor.direction for motor in robot.motors] == [1, -1]
    assert any("direction -1" in note for note in robot.notes)


def finger(joint: str, inertial: str = INERTIAL) -> str:
    return (
        f'<link name="finger">{inertial}</link><joint name="jf" type="revolute">'
        '<parent link="l2"/><child link="finger"/><origin xyz="0 0 0.2"/><axis xyz="0 1 0"/>'
        f"{joint}</joint></robot>"
    )


def test_a_link_with_mass_that_follows_a_joint_of_the_arm_is_refused() -> None:
    mimic = '<mimic joint="j2" multiplier="-1" offset="1.2"/>'
    with raises_code(ConfigError, "RID-URDF-MIMIC", position("</robot>"), "'jf'", "'j2'"):
        robot_with(("</robot>", finger(mimic)))
    light = robot_with(("</robot>", finger(mimic, "")))
    assert any("'jf' (mimics 'j2') is held at 1.2" in note for note in light.notes)


@pytest.mark.parametrize(("leader", "named"), [("jf", "itself"), ("nobody", "'nobody'")])
def test_a_mimic_joint_of_itself_or_of_a_missing_joint_is_refused(leader: str, named: str) -> None:
    with raises_code(ConfigError, "RID-URDF-STRUCTURE", position("</robot>"), "'jf'", named):
        robot_with(("</robot>", finger(f'<mimic joint="{leader}"/>')))


def test_a_joint_outside_the_arm_is_fixed_within_its_limits() -> None:
    tree = read_urdf(
        ARM.replace(
            "</robot>", finger('<limit lower="0.5" upper="1" effort="1" velocity="1"/>')
        ).encode(),
        "r.urdf",
    )
    robot = robot_of_urdf(tree, tip="l2")
    assert any("'jf' is held at 0.5" in note for note in robot.notes)
    cad = robot.robot.cad
    assert cad is not None
    x = cad[1].centre_m[0]
    assert x == pytest.approx((0.1 + 0.1 * np.cos(0.5)) / 2.0)


def test_friction_beyond_the_motors_torque_is_not_simulated_and_reported() -> None:
    robot = robot_with(('friction="2.5"', 'friction="2500"'))
    assert robot.motors[1].coulomb is None
    assert any("friction of j2" in note and "an assumed one" in note for note in robot.notes)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16", "iso-8859-1", "us-ascii"])
def test_every_declared_encoding_and_comments_are_read(encoding: str) -> None:
    text = ARM.replace('version="1.0"', f'version="1.0" encoding="{encoding}"')
    text = text.replace('<link name="base"/>', '<!-- lower="9" --><link name="base"/>')
    robot = robot_of_urdf(read_urdf(text.encode(encoding), "r.urdf")).robot
    assert robot.joints[1].limits.position_max == 1.2


@pytest.mark.parametrize(
    ("encoding", "declared"),
    [
        ("utf-16", "utf-8"),  # Windows PowerShell redirects output in UTF-16
        ("utf-16-le", None),
        ("utf-16-be", "utf-16"),
        ("utf-8", "utf-16"),
        ("utf-8-sig", None),
        ("utf-32", None),
        ("shift_jis", "Shift_JIS"),
    ],
)
def test_the_first_bytes_correct_a_wrong_or_missing_encoding(
    encoding: str, declared: str | None
) -> None:
    text = ARM.replace(
        'version="1.0"', f'version="1.0" encoding="{declared}"' if declared else 'version="1.0"'
    ).replace('<link name="base"/>', '<link name="base"/><!-- ロボット -->')
    assert read_urdf(text.encode(encoding), "r.urdf").links.keys() >= {"base"}


def test_bytes_that_are_no_text_in_their_encoding_are_refused() -> None:
    for data in (
        ARM.encode("utf-16")[:-1],
        ARM.replace('"1.0"', '"1.0" encoding="none-1"').encode(),
    ):
        with raises_code(ConfigError, "RID-FILE-TYPE", "r.urdf"):
            read_urdf(data, "r.urdf")


def test_more_than_32_joints_are_refused_before_any_processing() -> None:
    links = "".join(f'<link name="l{n}"/>' for n in range(34))
    joints = "".join(
        f'<joint name="j{n}" type="revolute"><parent link="l{n}"/><child link="l{n + 1}"/>'
        '<limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for n in range(33)
    )
    with raises_code(ConfigError, "RID-URDF-ARM", "32"):
        robot_of_urdf(read_urdf(f'<robot name="r">{links}{joints}</robot>'.encode(), "r.urdf"))


def test_joint_names_equal_in_their_first_32_characters_are_refused() -> None:
    long = "a" * 32
    first, second = (
        ('name="j1" type', f'name="{long}1" type'),
        ('name="j2" type', f'name="{long}2" type'),
    )
    with raises_code(ConfigError, "RID-URDF-NAME", f"{long}1", f"{long}2"):
        robot_with(first, second, (TRANSMISSION, ""))
