"""Link inertias of a URDF: impossible inertias become the nearest possible ones.

Links without mass get default values.
"""

from __future__ import annotations

import numpy as np
import pytest

from config.formats.urdf_file import read_urdf
from config.robot.link_cad import LinkCad
from config.robot.urdf_robot import UrdfRobot, robot_of_urdf


def robot_with(inertial: str, second: str = "") -> UrdfRobot:
    joints = "".join(
        f'<joint name="{name}" type="revolute"><parent link="{parent}"/><child link="{child}"/>'
        '<origin xyz="0.4 0 0.1"/><axis xyz="0 0 1"/>'
        '<limit lower="-2" upper="2" effort="50" velocity="2"/></joint>'
        for name, parent, child in (("one", "base", "tool"), ("two", "tool", "tip"))
    )
    links = (
        f'<link name="base"/><link name="tool">{inertial}</link><link name="tip">{second}</link>'
    )
    return robot_of_urdf(read_urdf(f'<robot name="r">{links}{joints}</robot>'.encode(), "r.urdf"))


def inertial(mass: float, xx: float, yy: float, zz: float, xy: float = 0.0) -> str:
    return (
        f'<inertial><mass value="{mass}"/><inertia ixx="{xx}" iyy="{yy}" izz="{zz}" ixy="{xy}"'
        ' ixz="0" iyz="0"/></inertial>'
    )


SOUND = inertial(2.0, 0.02, 0.02, 0.03)


def moments(link: LinkCad) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = link.inertia_kg_m2
    return np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def test_a_small_violation_of_the_triangle_inequality_is_repaired_by_a_small_change() -> None:
    robot = robot_with(inertial(3.0, 0.010, 0.020, 0.03024), SOUND)
    assert robot.robot.cad is not None
    repaired = moments(robot.robot.cad[0])
    np.testing.assert_allclose(repaired, [0.01008, 0.02008, 0.03016], atol=1e-5)  # least squares
    assert repaired[0] + repaired[1] >= repaired[2]
    note = next(note for note in robot.notes if "impossible" in note)
    assert all(text in note for text in ("r.urdf:1", "0.01, 0.02, 0.03024 kg m²"))
    assert "0.37 % changed" in note
    assert robot.robot.is_drawn
    assert robot.robot.cad[0].uncertainty == 0.1
    assert note in robot.comments["cad", 0]


@pytest.mark.parametrize("stated", [(1.0, 1.0, 9.0), (-0.1, 0.2, 0.2), (-1.0, -1.0, -2.0)])
def test_a_large_violation_is_repaired_and_marked_less_certain(
    stated: tuple[float, float, float],
) -> None:
    robot = robot_with(inertial(4.0, *stated), SOUND)
    assert robot.robot.cad is not None
    repaired = moments(robot.robot.cad[0])
    assert repaired[0] >= 0.0
    assert repaired[0] + repaired[1] >= repaired[2]
    uncertainty = robot.robot.cad[0].uncertainty
    assert uncertainty is not None
    assert uncertainty > 0.1


def test_products_of_inertia_are_included() -> None:
    robot = robot_with(
        inertial(1.0, 0.01, 0.01, 0.015, xy=0.02), SOUND
    )  # moments -0.01, 0.015, 0.03
    assert robot.robot.cad is not None
    assert moments(robot.robot.cad[0])[0] >= 0.0
    assert any("principal moments -0.01, 0.015, 0.03" in note for note in robot.notes)


def test_valid_inertias_are_unchanged() -> None:
    robot = robot_with(inertial(1.0, 0.01, 0.02, 0.03), SOUND)  # flat: exactly on the limit
    assert robot.robot.cad is not None
    np.testing.assert_allclose(moments(robot.robot.cad[0]), [0.01, 0.02, 0.03], rtol=1e-12)
    assert not any("impossible" in note for note in robot.notes)


def test_an_inertia_in_another_unit_counts_as_unknown() -> None:
    robot = robot_with(inertial(2.0, 2e4, 2e4, 3e4), SOUND)  # kg mm²
    assert any("a unit other than kg m²?" in note for note in robot.notes)
    assert robot.robot.cad is not None
    assert robot.robot.cad[0].unknown_inertia_kg_m2 is not None


@pytest.mark.parametrize(
    "nothing",
    ["", "<inertial/>", '<inertial><mass value="0"/></inertial>'],
)
def test_a_moving_link_without_mass_is_a_guess_and_the_others_are_unchanged(nothing: str) -> None:
    robot = robot_with(nothing, SOUND)
    assert robot.robot.cad is not None
    guess, sound = robot.robot.cad
    assert guess.uncertainty is None
    assert guess.mass_kg > 0.0
    assert sound.mass_kg == 2.0
    assert not robot.robot.is_drawn
    assert any(
        "simulated as cylinders" in note and "tool (no mass;" in note for note in robot.notes
    )
    assert "a guess, because the URDF states no mass" in robot.comments["cad", 0]


def test_one_inertia_that_is_nan_counts_as_unknown_and_the_link_keeps_its_mass() -> None:
    robot = robot_with(inertial(2.0, float("nan"), 0.02, 0.03), SOUND)
    assert robot.robot.cad is not None
    assert robot.robot.cad[0].mass_kg == 2.0
    assert robot.robot.cad[0].unknown_inertia_kg_m2 is not None
    assert any("counts as unknown" in note for note in robot.notes)
