"""Robot files: every model term can be selected; contradictions are refused with their key."""

from __future__ import annotations

import numpy as np
import pytest

from config.errors import ConfigError
from config.formats.yaml_tree import parse_yaml
from config.load import bundled_names, load_robot, to_yaml, validate
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import RobotDescription
from tests.builders.raised_codes import raises_code

ROBOT = """\
name: two
kinematics:
  convention: modified_dh
  rows: [{}, {a_m: 0.4}]
joints:
  - name: a
    limits: {position_min: -1.0, position_max: 1.0, velocity: 2.0, acceleration: 9.0, torque: 50.0}
    ##a
  - name: b
    limits: {position_min: -1.0, position_max: 1.0, velocity: 2.0, acceleration: 9.0, torque: 50.0}
##
"""


def read(addition: str = "", *, joint: str = "") -> RobotDescription:
    text = ROBOT.replace("##a", joint or "gear_ratio: 1.0").replace("##", addition)
    return validate(parse_yaml(text.encode(), "robot.yaml"), RobotDescription)


def assert_refused(where: str, *details: str, addition: str = "", joint: str = "") -> None:
    with raises_code(ConfigError, "RID-FILE-VALUE", *details) as caught:
        read(addition, joint=joint)
    assert str(caught.value).startswith(f"robot.yaml:{where}: ")


class TestFriction:
    def test_every_friction_term_can_be_selected(self) -> None:
        terms = "asymmetric, viscous, cubic, cube_root, stribeck, shear_thinning, temperature, load"
        speeds = "stribeck_velocity: 0.1\n    shear_thinning_velocity: 0.4"
        starts = f"{speeds}\n    reference_temperature_k: 300.0"
        robot = read(joint=f"friction: [{terms}]\n    {starts}")
        assert len(robot.joints[0].friction) == 8
        assert robot.joints[1].friction == ("coulomb", "viscous")

    @pytest.mark.parametrize("twice", ["coulomb", "offset"])
    def test_asymmetric_replaces_coulomb_and_offset(self, twice: str) -> None:
        terms = f"friction: [asymmetric, {twice}]"
        assert_refused("6:5: joints.0", "friction", "asymmetric", twice, joint=terms)

    def test_a_repeated_friction_term_is_refused(self) -> None:
        assert_refused("6:5: joints.0", "friction", "twice", joint="friction: [viscous, viscous]")

    def test_an_unknown_friction_term_is_refused_with_the_known_ones(self) -> None:
        terms = "friction: [coulomb, stribek]"
        assert_refused("8:25: joints.0.friction.1", "'stribeck'", "'stribek'", joint=terms)


class TestDrive:
    def test_armature_and_rotor_exclude_each_other(self) -> None:
        both = "armature: true\n    rotor: {link: 0, axis: [0.0, 0.0, 1.0]}"
        assert_refused("6:5: joints.0", "armature", "rotor", joint=both)

    def test_efficiency_and_load_friction_exclude_each_other(self) -> None:
        both = "efficiency: 0.8\n    friction: [coulomb, load]"
        assert_refused("6:5: joints.0", "efficiency", "load", joint=both)

    @pytest.mark.parametrize("efficiency", ["0.0", "1.1", "true"])
    def test_efficiency_is_a_fraction(self, efficiency: str) -> None:
        assert_refused("8:5: joints.0.efficiency", joint=f"efficiency: {efficiency}")


class TestSpring:
    def test_a_physical_spring_needs_its_distances(self) -> None:
        assert_refused("11:1: spring", "l_m", "r_m", addition="spring: {joint: a, l_m: 0.4}")
        assert read("spring: {joint: a, l_m: 0.4, r_m: 0.1}").spring is not None

    def test_a_spring_as_a_fourier_series_needs_no_distances(self) -> None:
        spring = read("spring: {joint: b, form: fourier}").spring
        assert spring is not None
        assert spring.form == "fourier"

    def test_a_spring_on_a_missing_joint_is_refused(self) -> None:
        nowhere = "spring: {joint: c, form: fourier}"
        assert_refused("1:1", "spring.joint 'c'", " a, b", addition=nowhere)


class TestCoupling:
    def test_a_coupling_is_a_matrix_of_joints_by_actuators(self) -> None:
        assert read("coupling: [[1.0, 0.0], [-0.2, 1.0]]").coupling == ((1.0, 0.0), (-0.2, 1.0))

    @pytest.mark.parametrize("matrix", ["[[1.0, 0.0]]", "[[1.0, 0.0], [1.0]]"])
    def test_a_coupling_has_a_row_and_a_column_for_each_joint(self, matrix: str) -> None:
        assert_refused("11:1: coupling", "2 rows", "2 numbers", addition=f"coupling: {matrix}")

    def test_a_coupling_must_be_invertible(self) -> None:
        assert_refused(
            "11:1: coupling", "q = C alpha", addition="coupling: [[1.0, 1.0], [1.0, 1.0]]"
        )


class TestDrawings:
    def test_cad_data_have_an_uncertainty_for_each_link(self) -> None:
        robot = read("cad: [{mass_kg: 3.0}, {mass_kg: 2.0, uncertainty: 0.3}]")
        assert robot.cad is not None
        assert [link.uncertainty for link in robot.cad] == [0.1, 0.3]

    def test_cad_data_must_cover_every_link(self) -> None:
        assert_refused("11:1: cad", "1 links", "2 joints", addition="cad: [{mass_kg: 3.0}]")

    @pytest.mark.parametrize(
        ("inertia", "moments"),
        [
            ("1.0, 0.0, 0.0, 1.0, 0.0, 2.1", "1, 1, 2.1"),
            ("1.0, 2.0, 0.0, 1.0, 0.0, 1.0", "-1, 1, 3"),
        ],
        ids=["triangle", "negative"],
    )
    def test_an_impossible_inertia_is_refused(self, inertia: str, moments: str) -> None:
        links = f"cad: [{{mass_kg: 3.0}}, {{mass_kg: 3.0, inertia_kg_m2: [{inertia}]}}]"
        assert_refused("11:23: cad.1", "inertia_kg_m2", moments, addition=links)

    def test_the_inertia_of_a_thin_rod_is_accepted(self) -> None:
        inertia = "inertia_kg_m2: [0.0, 0.0, 0.0, 0.1, 0.0, 0.1]"
        robot = read(f"cad: [{{mass_kg: 1.0, {inertia}}}, {{mass_kg: 1.0}}]")
        assert robot.cad is not None
        assert robot.cad[0].inertia_kg_m2 == (0.0, 0.0, 0.0, 0.1, 0.0, 0.1)


class TestCalibration:
    OFFSETS = (KinematicRow(theta_rad=0.01, d_m=-0.002), KinematicRow(beta_rad=0.003, a_m=0.001))
    NOMINAL = (KinematicRow(theta_rad=1.0, d_m=0.5), KinematicRow(alpha_rad=1.5, a_m=0.4))

    def test_calibration_offsets_are_added_row_by_row(self) -> None:
        table = Kinematics(convention="modified_dh", rows=self.NOMINAL, calibration=self.OFFSETS)
        assert table.modified_rows() == (
            KinematicRow(theta_rad=1.01, d_m=0.498),
            KinematicRow(alpha_rad=1.5, beta_rad=0.003, a_m=0.401),
        )

    def test_calibration_has_a_row_per_joint_and_hayatis_angle_in_modified_dh_only(
        self,
    ) -> None:
        rows = "kinematics:\n  convention: standard_dh\n  rows: [{}, {}]\n  calibration: "
        for calibration, names in (
            ("[{}]", ("calibration", "1 rows", "2 rows")),
            ("[{beta_rad: 0.1}, {}]", ("beta_rad", "modified_dh")),
        ):
            text = ROBOT.replace("##a", "gear_ratio: 1.0").replace("##", "")
            start, end = text.index("kinematics:"), text.index("joints:")
            text = f"{text[:start]}{rows}{calibration}\n{text[end:]}"
            where = "robot.yaml:2:1: kinematics: "
            with raises_code(ConfigError, "RID-FILE-VALUE", where, *names):
                validate(parse_yaml(text.encode(), "robot.yaml"), RobotDescription)


@pytest.mark.parametrize("name", bundled_names("robots"))
def test_a_written_robot_is_read_back_equal(name: str) -> None:
    robot = load_robot(name)
    text = to_yaml(robot).encode()
    assert validate(parse_yaml(text, "robot.yaml"), RobotDescription) == robot


class TestRoundedAngles:
    ROWS = (KinematicRow(theta_rad=-1.5708, d_m=0.5), KinematicRow(alpha_rad=1.57, a_m=0.4))

    def test_rounded_angles_become_exact_multiples_of_15_degrees_and_are_named(self) -> None:
        table = Kinematics(convention="modified_dh", rows=self.ROWS)
        first, second = table.modified_rows()
        assert first.theta_rad == -np.pi / 2
        assert second.alpha_rad == np.pi / 2
        (note,) = table.notes
        assert "kinematics.rows.0.theta_rad" in note
        assert "kinematics.rows.1.alpha_rad" in note
        assert table.rows == self.ROWS  # the file itself is unchanged

    def test_calibration_offsets_and_hayati_angles_are_not_rounded(self) -> None:
        offsets = (KinematicRow(alpha_rad=0.0005), KinematicRow(theta_rad=0.001))
        rows = (KinematicRow(beta_rad=0.785), KinematicRow())
        table = Kinematics(convention="modified_dh", rows=rows, calibration=offsets)
        first, second = table.modified_rows()
        assert (first.alpha_rad, first.beta_rad, second.theta_rad) == (0.0005, 0.785, 0.001)

    def test_angles_of_a_calibrated_robot_are_unchanged_and_named(self) -> None:
        rows = (KinematicRow(), KinematicRow(alpha_rad=1.5702964))
        table = Kinematics(convention="standard_dh", rows=rows)
        assert table.calibrated_rows == rows
        assert len(table.notes) == 1


def test_more_than_32_joints_are_refused_with_file_and_line() -> None:
    limits = "{position_min: -1, position_max: 1, velocity: 1, acceleration: 1, torque: 1}"
    joints = "".join(f"  - {{name: j{n}, limits: {limits}}}\n" for n in range(33))
    rows = ", ".join(["{}"] * 33)
    text = f"name: r\nkinematics: {{convention: modified_dh, rows: [{rows}]}}\njoints:\n{joints}"
    where = "robot.yaml:3:1: joints: "
    with raises_code(ConfigError, "RID-FILE-VALUE", where, "32", "33"):
        validate(parse_yaml(text.encode(), "robot.yaml"), RobotDescription)
