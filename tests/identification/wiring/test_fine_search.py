"""Mistakes that hardly affect a plain fit are found by a fit with flexible friction."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.sound_robots import sound_run
from config.load import load_robot
from config.robot.robot import RobotDescription
from identification.wiring.fine_search import find_fine_mistake, fine_mistakes, table_mistake
from identification.wiring.mistakes import Mistake, MistakeKind
from identification.wiring.search import find_mistakes
from identification.wiring.signals import WiredSignals
from tests.identification.wiring.test_real_recordings import of_ur10e
from tests.identification.wiring.test_search import wired


@pytest.fixture(scope="module")
def arm() -> WiredSignals:
    return wired(sound_run(load_robot("ur10e"), np.random.default_rng(4)))


@pytest.fixture(scope="module")
def recorded(real_robot: Path) -> WiredSignals:
    """Ten poses of a real UR10e."""
    return of_ur10e(real_robot, "ur-20_01_17-ptp_10_points", 700, 4200)


def with_lengths(robot: RobotDescription, factor: float) -> RobotDescription:
    table = robot.kinematics
    rows = tuple(
        row.model_copy(update={"a_m": factor * row.a_m, "d_m": factor * row.d_m})
        for row in table.rows
    )
    return robot.model_copy(update={"kinematics": table.model_copy(update={"rows": rows})})


def fine_mistake(
    robot: RobotDescription, kind: MistakeKind, what: str = "", *joints: int
) -> Mistake:
    return next(
        each
        for each in fine_mistakes(robot)
        if each.kind is kind and what in each.what and each.joints == joints
    )


def test_nothing_is_found_in_correct_signals(arm: WiredSignals) -> None:
    assert find_fine_mistake(arm) is None


@pytest.mark.parametrize(
    ("kind", "what", "joints"),
    [
        (MistakeKind.KINEMATICS, "about 1.6 times", ()),
        (MistakeKind.KINEMATICS, "about 0.625 times", ()),
        (MistakeKind.KINEMATICS, "a_m of row 2", (1,)),
        (MistakeKind.KINEMATICS, "alpha_rad", (0,)),
        (MistakeKind.POSITION_FACTOR, "another gear", (0,)),
        (MistakeKind.CLOCK, "", ()),
    ],
)
def test_a_mistake_masked_by_friction_is_found(
    arm: WiredSignals, kind: MistakeKind, what: str, joints: tuple[int, ...]
) -> None:
    made = fine_mistake(arm.robot, kind, what, *joints)
    fine = find_fine_mistake(made.correct(arm))
    assert fine is not None
    assert kind in {each.kind for each in (fine.mistake, *fine.alternatives)}
    assert fine.ratio < 0.9


def test_lengths_of_0_6_times_the_true_ones_are_found_in_a_real_recording(
    recorded: WiredSignals,
) -> None:
    """The residual of a plain fit, 3 to 7 % of the torques, increases by less than a tenth."""
    wrong = replace(recorded, robot=with_lengths(recorded.robot, 0.6))
    fine = find_fine_mistake(wrong)
    assert find_fine_mistake(recorded) is None
    assert fine is not None
    assert fine.mistake.kind is MistakeKind.KINEMATICS
    assert "1.6 times" in fine.mistake.what


@pytest.mark.slow
def test_the_table_of_another_arm_is_named_without_advice_on_torques(
    recorded: WiredSignals,
) -> None:
    other = {"kinematics": load_robot("kr15").kinematics, "cad": None}
    wrong = replace(recorded, robot=recorded.robot.model_copy(update=other))
    (found,) = find_mistakes(wrong)
    assert found.mistake.what == table_mistake(recorded).what
    assert found.alternatives == ()


def test_too_few_rows_give_no_result(arm: WiredSignals) -> None:
    few = {
        name: getattr(arm, name)[:15]
        for name in ("position", "velocity", "acceleration", "torque_nm")
    }
    assert find_fine_mistake(replace(arm, **few)) is None
