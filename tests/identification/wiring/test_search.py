"""Mistakes that are injected into recordings of random robots are found, and no other mistakes are
reported.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.sound_robots import SoundRecording, sound_run, sound_runs
from config.load import load_robot
from identification.wiring.common_mistakes import common_mistakes
from identification.wiring.mistakes import Mistake, MistakeKind, zero_mistake
from identification.wiring.search import find_mistakes
from identification.wiring.signals import WiredSignals

COUPLING = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, -1.0, 1.0))


def wired(sound: SoundRecording) -> WiredSignals:
    """Return every fifth row of every motor's signals, as its drive measures them."""
    coupling = np.eye(len(sound.robot.joints))
    if sound.robot.coupling is not None:
        coupling = np.linalg.inv(np.array(sound.robot.coupling))
    moved = (sound.position, sound.velocity, sound.acceleration)
    q, v, a = (each[::5] @ coupling.T for each in moved)
    return WiredSignals(sound.robot, q, v, a, sound.torque_nm[::5], np.ones(q.shape[1], bool))


@pytest.fixture(scope="module")
def arm() -> WiredSignals:
    return wired(sound_run(load_robot("ir361"), np.random.default_rng(1)))


def with_mistake(
    arm: WiredSignals, kind: MistakeKind, *joints: int, factor: float | None = None
) -> WiredSignals:
    """Return signals with a mistake of the given kind on the given joints (counted from 0)."""
    return mistake_of(arm, kind, *joints, factor=factor).correct(arm)


def mistake_of(arm: WiredSignals, kind: MistakeKind, *joints: int, factor: float | None) -> Mistake:
    (one,) = (
        mistake
        for mistake in common_mistakes(arm.robot)
        if mistake.kind is kind
        and mistake.joints == joints
        and (factor is None or math.isclose(mistake.factor, factor))
    )
    return one


@pytest.mark.parametrize(
    ("kind", "joints", "factor", "undone_by"),
    [
        (MistakeKind.POSITION_SIGN, (1,), None, -1.0),
        (MistakeKind.TORQUE_SIGN, (1,), None, -1.0),
        (MistakeKind.TORQUE_SIGN, (1, 2), None, -1.0),
        (MistakeKind.TORQUE_SIGN, (), None, -1.0),
        (MistakeKind.DIRECTION, (1,), None, -1.0),
        (MistakeKind.POSITION_FACTOR, (1,), 2.0, 0.5),
        (MistakeKind.POSITION_FACTOR, (2,), 0.5, 2.0),
        (MistakeKind.POSITION_FACTOR, (2,), math.pi / 180.0, 180.0 / math.pi),
        (MistakeKind.TORQUE_FACTOR, (1,), 10.0, 0.1),
        (MistakeKind.TORQUE_FACTOR, (2,), 0.1, 10.0),
        (MistakeKind.POSITION_ORDER, (1, 2), None, 1.0),
        (MistakeKind.TORQUE_ORDER, (1, 2), None, 1.0),
        (MistakeKind.AXIS_ORDER, (1, 2), None, 1.0),
    ],
)
def test_a_mistake_is_found_with_its_joint_and_factor(
    arm: WiredSignals,
    kind: MistakeKind,
    joints: tuple[int, ...],
    factor: float | None,
    undone_by: float,
) -> None:
    (found,) = find_mistakes(with_mistake(arm, kind, *joints, factor=factor))
    named = {(each.kind, each.joints): each.factor for each in (found.mistake, *found.alternatives)}
    assert named[kind, joints] == pytest.approx(undone_by)


def test_a_zero_position_is_found_within_a_degree(arm: WiredSignals) -> None:
    wrong = zero_mistake(arm.robot, 1, math.radians(40.0)).correct(arm)
    (found,) = find_mistakes(wrong)
    assert (found.mistake.kind, found.mistake.joints) == (MistakeKind.POSITION_OFFSET, (1,))
    assert math.degrees(found.mistake.factor) == pytest.approx(-40.0, abs=1.0)


def test_two_mistakes_are_found_one_after_the_other(arm: WiredSignals) -> None:
    once = with_mistake(arm, MistakeKind.TORQUE_SIGN, 1)
    twice = with_mistake(once, MistakeKind.POSITION_FACTOR, 2, factor=2.0)
    found = {(each.mistake.kind, each.mistake.joints) for each in find_mistakes(twice)}
    assert found == {(MistakeKind.TORQUE_SIGN, (1,)), (MistakeKind.POSITION_FACTOR, (2,))}


def test_equally_good_explanations_are_listed(arm: WiredSignals) -> None:
    """About a vertical axis a reversed torque is indistinguishable from a reversed position."""
    (found,) = find_mistakes(with_mistake(arm, MistakeKind.TORQUE_SIGN, 0))
    kinds = {found.mistake.kind, *(other.kind for other in found.alternatives)}
    assert {MistakeKind.TORQUE_SIGN, MistakeKind.POSITION_SIGN} <= kinds
    assert {found.mistake.joints, *(other.joints for other in found.alternatives)} == {(0,)}


def test_a_wrong_convention_of_the_table_is_found() -> None:
    sound = sound_run(load_robot("ur10e"), np.random.default_rng(2))
    robot = sound.robot
    wrong = robot.kinematics.model_copy(update={"convention": "modified_dh"})
    stated = robot.model_copy(update={"kinematics": wrong})
    found = find_mistakes(replace(wired(sound), robot=stated))
    assert found[0].mistake.kind is MistakeKind.CONVENTION


@pytest.mark.parametrize("stated", [None, ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 1.0, 1.0))])
def test_a_missing_or_reversed_coupling_is_found(
    arm: WiredSignals, stated: tuple[tuple[float, ...], ...] | None
) -> None:
    coupled = arm.robot.model_copy(update={"coupling": COUPLING})
    sound = wired(sound_run(coupled, np.random.default_rng(3)))
    wrong = arm.robot.model_copy(update={"coupling": stated})
    (found,) = find_mistakes(replace(sound, robot=wrong))
    assert found.mistake.kind is MistakeKind.COUPLING


@pytest.mark.slow
def test_nothing_is_found_in_correct_recordings() -> None:
    assert [find_mistakes(wired(sound)) for sound in sound_runs(3, first_seed=1000)] == [()] * 3


def test_a_wrong_mounting_is_found() -> None:
    sound = wired(sound_run(load_robot("kr15"), np.random.default_rng(2)))
    gravity = (0.0, 9.81, 0.0)
    stated = replace(sound, robot=sound.robot.model_copy(update={"gravity_m_s2": gravity}))
    (found,) = find_mistakes(stated)
    assert found.mistake.kind is MistakeKind.MOUNTING
    assert found.mistake.robot == sound.robot


def test_a_superfluous_coupling_is_found_for_joint_and_motor_positions(
    arm: WiredSignals,
) -> None:
    coupled = arm.robot.model_copy(update={"coupling": COUPLING})
    for position in (np.eye(3), np.linalg.inv(np.array(COUPLING))):
        stated = replace(arm.transform(position, np.zeros(3), 1.0), robot=coupled)
        (found,) = find_mistakes(stated)
        assert found.mistake.kind is MistakeKind.COUPLING
        assert found.mistake.joints == (1, 2)


@pytest.mark.parametrize("factor", [0.1, 1.0 / 54.0])
def test_a_position_factor_of_a_coupled_joint_is_found(
    factor: float,
) -> None:
    sound = wired(sound_run(load_robot("kr15"), np.random.default_rng([0, 1])))
    assert sound.robot.coupling is not None
    scale = np.diag([1.0] * 5 + [factor])
    coupling = np.array(sound.robot.coupling)
    stated = sound.transform(np.linalg.solve(coupling, scale @ coupling), np.zeros(6), 1.0)
    (found,) = find_mistakes(stated)
    assert (found.mistake.kind, found.mistake.joints) == (MistakeKind.POSITION_FACTOR, (5,))
    assert found.mistake.factor == pytest.approx(1.0 / factor)


@pytest.mark.parametrize(
    ("in_units", "what"), [(1.0 / (2.0 * math.pi), "in turns"), (1000.0, "in mrad")]
)
def test_positions_in_another_unit_are_found(arm: WiredSignals, in_units: float, what: str) -> None:
    (found,) = find_mistakes(arm.transform(in_units * np.eye(3), np.zeros(3), 1.0))
    assert (found.mistake.kind, found.mistake.joints) == (MistakeKind.POSITION_FACTOR, ())
    assert found.mistake.what == what
    assert found.mistake.factor == pytest.approx(1.0 / in_units)
