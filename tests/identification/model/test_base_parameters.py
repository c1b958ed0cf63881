from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.errors import EstimationError
from config.load import load_robot
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor
from identification.model.base_parameters import ModelKind, base_parameters, independent_columns
from tests.builders.raised_codes import raises_code


def arm_of(**terms: bool) -> RobotModel:
    """Return the nominal IR 361: axis 1 vertical, axes 2 and 3 horizontal and parallel."""
    off = {"rotors": False, "friction": False, "spring": False}
    return RobotModel.from_description(load_robot("ir361"), **(off | terms))


class TestCounts:
    def test_the_internal_rigid_body_model_has_15(self) -> None:
        assert len(base_parameters(arm_of())) == 15

    def test_the_spring_leaves_14_since_sin_q2_merges_with_its_stiffness(self) -> None:
        base = base_parameters(arm_of(spring=True))
        assert sum(base.rigid_body) == 14
        assert len(base) == 16
        assert "k_spring - 201.02 sx2 - 96.492 m3" in base.expressions  # 9.81 / (0.488 x 0.100)

    @pytest.mark.parametrize("kind", ["external", "combined"])
    def test_the_base_wrench_adds_parameters_up_to_20(self, kind: ModelKind) -> None:
        assert len(base_parameters(arm_of(), kind=kind)) == 20

    def test_the_internal_model_contains_the_third_rotor_only(self) -> None:
        base = base_parameters(arm_of(rotors=True))
        assert len(base) == 15 + 1
        assert [name for name in base.names if name.startswith("Im")] == ["Im3"]

    def test_the_plate_separates_all_three_rotors(self) -> None:
        base = base_parameters(arm_of(rotors=True), kind="combined")
        assert len(base) == 20 + 3
        assert [name for name in base.names if name.startswith("Im")] == ["Im1", "Im2", "Im3"]

    def test_base_parameters_do_not_depend_on_the_samples(self) -> None:
        models = [base_parameters(arm_of(), seed=seed).expressions for seed in range(5)]
        assert len(set(models)) == 1


class TestWords:
    def test_expressions_start_with_the_head_of_each_combination(self) -> None:
        assert base_parameters(arm_of()).expressions == (
            "Izz1 + Iyy2 + 0.2304 m3 + Iyy3",
            "sx2 + 0.48 m3",
            "sy2",
            "Ixx2 - Iyy2 - 0.2304 m3",
            "Ixy2",
            "Ixz2 - 0.48 sz3",
            "Iyz2",
            "Izz2 + 0.2304 m3",
            "sx3",
            "sy3",
            "Ixx3 - Iyy3",
            "Ixy3",
            "Ixz3",
            "Iyz3",
            "Izz3",
        )

    def test_expressions_of_a_rotor_contain_its_squared_gear_ratio(self) -> None:
        words = base_parameters(arm_of(rotors=True)).expressions
        assert "Izz1 + Iyy2 + 0.2304 m3 + Iyy3 + 14641 Im1" in words  # 121^2
        assert "Izz2 + 0.2304 m3 + 23715 Im2" in words  # 153^2 + 2 x 153

    def test_expressions_do_not_depend_on_rounding(self) -> None:
        words = base_parameters(RobotModel.from_description(load_robot("ur10e"))).expressions
        assert "sx3 - 0.57155 m4 - 0.57155 m5 - 0.57155 m6" in words

    def test_a_combination_has_the_unit_of_its_head(self) -> None:
        base = base_parameters(arm_of(spring=True))
        units = dict(zip(base.names, base.units, strict=True))
        assert (units["Izz1"], units["sy2"], units["k_spring"]) == ("kg m^2", "kg m", "N/m")

    def test_parameters_without_effect_are_listed(self) -> None:
        assert base_parameters(arm_of()).unseen == (
            *("m1", "sx1", "sy1", "sz1", "Ixx1", "Ixy1", "Ixz1", "Iyy1", "Iyz1"),
            *("m2", "sz2"),
        )


class TestCombination:
    @pytest.mark.parametrize("name", ["ir361", "ur10e"])
    def test_base_parameters_predict_the_torques_of_the_standard_parameters(
        self, name: str
    ) -> None:
        model = RobotModel.from_description(load_robot(name))
        base = base_parameters(model)
        random = np.random.default_rng(3)
        n, p = len(model.joint_names), len(model.parameter_names)
        q, v, a = random.normal(size=(3, 40, n))
        theta = random.normal(size=p)
        phi = regressor(model, q, v, a)
        np.testing.assert_allclose(
            base.columns(phi) @ base.from_standard(theta), phi @ theta, rtol=0.0, atol=1e-7
        )

    def test_base_parameters_predict_the_base_wrench(self) -> None:
        model = arm_of(rotors=True)
        base = base_parameters(model, kind="combined")
        random = np.random.default_rng(4)
        theta = random.normal(size=len(model.parameter_names))
        q, v, a = random.normal(size=(3, 20, 3))
        for phi in (regressor(model, q, v, a), base_wrench_regressor(model, q, v, a)):
            np.testing.assert_allclose(
                base.columns(phi) @ base.from_standard(theta), phi @ theta, rtol=0.0, atol=1e-7
            )

    @settings(max_examples=15)
    @given(st.integers(0, 2**32 - 1), st.integers(1, 5))
    def test_base_parameters_are_exact_for_random_arms_with_prismatic_joints(
        self, seed: int, joints: int
    ) -> None:
        random = np.random.default_rng(seed)
        limits = JointLimits(
            position_min=-1.0, position_max=1.0, velocity=1.0, acceleration=1.0, torque=1.0
        )
        robot = RobotDescription(
            name="random",
            kinematics=Kinematics(
                convention="modified_dh",
                rows=tuple(
                    KinematicRow(
                        alpha_rad=float(random.choice([0.0, np.pi / 2.0, -np.pi / 2.0])),
                        a_m=float(random.uniform(-0.5, 0.5)),
                        d_m=float(random.uniform(-0.5, 0.5)),
                    )
                    for _ in range(joints)
                ),
            ),
            joints=tuple(
                Joint(
                    name=f"j{j}",
                    type="prismatic" if random.random() < 0.3 else "revolute",
                    limits=limits,
                )
                for j in range(joints)
            ),
        )
        model = RobotModel.from_description(robot)
        base = base_parameters(model)
        q, v, a = random.uniform(-1.0, 1.0, (3, 30, joints))
        phi = regressor(model, q, v, a)
        theta = random.normal(size=len(model.parameter_names))
        np.testing.assert_allclose(
            base.columns(phi) @ base.from_standard(theta), phi @ theta, rtol=0.0, atol=1e-7
        )
        stacked = base.columns(phi).reshape(-1, len(base))
        if len(stacked) >= 2 * len(base):
            scaled = stacked / np.linalg.norm(stacked, axis=0)
            assert np.linalg.matrix_rank(scaled, tol=1e-9) == len(base)

    def test_parameters_of_another_model_are_refused(self) -> None:
        with raises_code(EstimationError, "RID-API-ARGUMENT", "30"):
            base_parameters(arm_of()).from_standard(np.zeros(7))


class TestIndependentColumns:
    def test_the_more_readable_of_two_equal_columns_is_kept(self) -> None:
        column = np.random.default_rng(0).normal(size=(20, 1))
        base = independent_columns(
            np.hstack([2.0 * column, column]), ("m2", "Izz1"), ("kg", "kg m^2")
        )
        assert base.expressions == ("Izz1 + 2 m2",)

    def test_a_regressor_of_zeros_is_refused(self) -> None:
        with raises_code(EstimationError, "RID-MOTION-UNINFORMATIVE"):
            independent_columns(np.zeros((5, 2)), ("m1", "m2"), ("kg", "kg"))

    def test_a_tolerance_close_to_the_size_of_a_column_is_refused(self) -> None:
        random = np.random.default_rng(0)
        first, others = random.normal(size=(50, 1)), random.normal(size=(50, 20))
        near = first / np.linalg.norm(first) + 9e-7 * others / np.linalg.norm(others, axis=0)
        names = ("Izz1", *(f"m{link}" for link in range(2, 22)))
        with raises_code(EstimationError, "RID-MODEL-RANK", "1e-06"):
            independent_columns(np.hstack([first, near]), names, ("kg",) * 21, tolerance=1e-6)

    def test_a_dependence_within_the_tolerance_counts_as_exact(self) -> None:
        random = np.random.default_rng(1)
        first, other = random.normal(size=(2, 50, 1))
        stacked = np.hstack([first, first + 1e-4 * other])
        names, units = ("Izz1", "m2"), ("kg m^2", "kg")
        assert len(independent_columns(stacked, names, units, tolerance=1e-6)) == 2
        assert len(independent_columns(stacked, names, units, tolerance=1e-2)) == 1
