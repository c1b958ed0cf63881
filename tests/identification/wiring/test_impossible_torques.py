"""Torques that are impossible for the robot are reported; a correction makes them possible."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.sound_robots import sound_run
from config.arrays import FloatArray
from config.load import load_robot
from config.robot.nominal_links import nominal_links
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from dynamics.model.robot_model import RobotModel, regressor
from identification.model.drawn_arm import drawn_parameters
from identification.wiring.common_mistakes import common_mistakes, torque_units
from identification.wiring.mistakes import DEGREES, MistakeKind
from identification.wiring.possible import keeps_limits
from identification.wiring.scale import ABSOLUTE
from identification.wiring.search import find_impossibilities, find_mistakes
from identification.wiring.signals import WiredSignals
from identification.wiring.trial import CondensedEquations, plain_model
from tests.identification.wiring.test_search import wired


@pytest.fixture(scope="module")
def arm() -> WiredSignals:
    """Six axes whose `cad` has the measured weight of the arm, with an uncertainty of 30 %."""
    signals = wired(sound_run(load_robot("ur10e"), np.random.default_rng(4)))
    weight = CondensedEquations.of(replace(signals, robot=_drawn(signals, 1.0))).arm_weight(
        np.eye(6)
    )
    assert weight is not None
    return replace(signals, robot=_drawn(signals, weight.share))


def _drawn(signals: WiredSignals, share: float) -> RobotDescription:
    chain = Chain.from_description(signals.robot)
    links = tuple(
        link.model_copy(update={"mass_kg": share * link.mass_kg, "uncertainty": 0.3})
        for link in nominal_links(chain.rows, chain.tool_m)
    )
    return signals.robot.model_copy(update={"cad": links})


def test_the_weight_of_a_correct_arm_agrees_with_its_cad_data(arm: WiredSignals) -> None:
    driving, weight = find_impossibilities(arm)
    assert driving == ()
    assert weight is not None
    assert weight.is_drawn
    assert weight.is_plausible
    assert weight.share == pytest.approx(1.0, abs=0.3)


def test_reversed_torques_have_driving_friction_and_negative_weight(
    arm: WiredSignals,
) -> None:
    driving, weight = find_impossibilities(replace(arm, torque_nm=-arm.torque_nm))
    assert driving == arm.robot.joint_names
    assert weight is not None
    assert not weight.is_plausible
    assert weight.share < 0.0


@pytest.mark.parametrize("joints", [(), (1, 2), (0, 1, 2, 3, 4)])
def test_several_reversed_torques_are_found_at_once(
    arm: WiredSignals, joints: tuple[int, ...]
) -> None:
    torque_nm = arm.torque_nm.copy()
    torque_nm[:, list(joints) or slice(None)] *= -1.0
    (found,) = find_mistakes(replace(arm, torque_nm=torque_nm))
    assert (found.mistake.kind, found.mistake.joints) == (MistakeKind.TORQUE_SIGN, joints)


def test_three_cyclically_swapped_axes_are_found(arm: WiredSignals) -> None:
    order = [1, 2, 0, 3, 4, 5]
    moved = (arm.position, arm.velocity, arm.acceleration, arm.torque_nm)
    q, v, a, torque_nm = (each[:, order] for each in moved)
    wrong = replace(arm, position=q, velocity=v, acceleration=a, torque_nm=torque_nm)
    (found,) = find_mistakes(wrong)
    assert (found.mistake.kind, found.mistake.joints) == (
        MistakeKind.AXIS_ORDER,
        (2, 0, 1, 3, 4, 5),
    )
    assert found.mistake.changed == (0, 1, 2)


@pytest.mark.parametrize("degrees", [10.0, 30.0])
def test_a_tilted_base_is_found_with_its_direction(arm: WiredSignals, degrees: float) -> None:
    tilt = math.radians(degrees)
    gravity = (0.0, 9.81 * math.sin(tilt), -9.81 * math.cos(tilt))
    tilted = arm.robot.model_copy(update={"gravity_m_s2": gravity})
    rigid = plain_model(arm)
    link_columns = rigid.parameter_groups["rigid_body"]
    values = _fitted(arm)
    moved = regressor(plain_model(replace(arm, robot=tilted)), *arm.joints())
    more = (moved - regressor(rigid, *arm.joints()))[:, :, link_columns] @ values[link_columns]
    (found,) = find_mistakes(replace(arm, torque_nm=arm.torque_nm + more))
    assert found.mistake.kind is MistakeKind.MOUNTING
    assert found.mistake.robot is not None
    right = np.array(found.mistake.robot.gravity_m_s2)
    assert math.degrees(math.acos(right @ gravity / 9.81**2)) < 2.0


def test_a_wrong_zero_of_the_first_joint_is_preferred_to_a_tilted_base(
    arm: WiredSignals,
) -> None:
    """If the robot is on a wall, a zero error of 40 degrees in the first joint rotates gravity
    about this joint.
    """
    wall = replace(arm, robot=arm.robot.model_copy(update={"gravity_m_s2": (9.81, 0.0, 0.0)}))
    model = plain_model(wall)
    link_columns = model.parameter_groups["rigid_body"]
    change = regressor(model, *arm.joints()) - regressor(plain_model(arm), *arm.joints())
    torque_nm = arm.torque_nm + change[:, :, link_columns] @ _fitted(arm)[link_columns]
    off = arm.position - math.radians(40.0) * np.eye(6)[0]
    found = find_mistakes(replace(wall, torque_nm=torque_nm, position=off))
    assert [(each.mistake.kind, each.mistake.joints) for each in found] == [
        (MistakeKind.POSITION_OFFSET, (0,))
    ]
    assert math.degrees(found[0].mistake.factor) == pytest.approx(40.0, abs=1.0)
    assert [each.kind for each in found[0].alternatives] == [MistakeKind.MOUNTING]


def test_torques_without_gravity_are_found(arm: WiredSignals) -> None:
    model = plain_model(arm)
    link_columns = model.parameter_groups["rigid_body"]
    q, still = arm.position, np.zeros_like(arm.position)
    gravity_nm = regressor(model, q, still, still)[:, :, link_columns] @ _fitted(arm)[link_columns]
    found = find_mistakes(replace(arm, torque_nm=arm.torque_nm - gravity_nm))
    assert [each.mistake.kind for each in found] == [MistakeKind.GRAVITY_REMOVED]


def _fitted(signals: WiredSignals) -> FloatArray:
    phi = regressor(plain_model(signals), *signals.joints())
    columns, torque_nm = phi.reshape(-1, phi.shape[2]), signals.torque_nm.reshape(-1)
    return np.asarray(np.linalg.lstsq(columns, torque_nm, rcond=1e-8)[0], dtype=np.float64)


@pytest.mark.parametrize("unit", range(5))
def test_every_unit_of_torque_is_named(arm: WiredSignals, unit: int) -> None:
    mistake = list(torque_units(arm.robot))[unit]
    stated = arm.torque_nm @ np.linalg.inv(mistake.torque).T
    found = find_mistakes(replace(arm, torque_nm=stated))
    assert [each.mistake.kind for each in found] == [MistakeKind.TORQUE_UNIT]
    named = (found[0].mistake, *found[0].alternatives)
    assert mistake.what in {each.what for each in named}


@pytest.mark.parametrize("what", ["acceleration", "velocity", "position"])
def test_torques_that_copy_the_motion_are_named(arm: WiredSignals, what: str) -> None:
    copied = replace(arm, torque_nm=getattr(arm, what))
    (found,) = find_mistakes(copied)
    assert (found.mistake.kind, found.mistake.what) == (MistakeKind.TORQUE_QUANTITY, what)
    one = arm.torque_nm.copy()
    one[:, 3] = getattr(arm, what)[:, 3]
    (found,) = find_mistakes(replace(arm, torque_nm=one))
    assert (found.mistake.what, found.mistake.joints) == (what, (3,))


def test_torques_without_sign_are_named(arm: WiredSignals) -> None:
    (found,) = find_mistakes(replace(arm, torque_nm=np.abs(arm.torque_nm)))
    assert (found.mistake.kind, found.mistake.joints) == (MistakeKind.TORQUE_QUANTITY, ())
    assert found.mistake.what == ABSOLUTE


def test_nothing_is_proposed_for_noise(arm: WiredSignals) -> None:
    noise = np.random.default_rng(1).normal(0.0, 20.0, arm.torque_nm.shape)
    assert find_mistakes(replace(arm, torque_nm=noise)) == ()


def test_proposals_keep_the_limits_of_the_robot_file(arm: WiredSignals) -> None:
    refused = [
        (mistake.kind, mistake.factor)
        for mistake in common_mistakes(arm.robot)
        if not keeps_limits(mistake, arm, mistake.correct(arm))
    ]
    assert (MistakeKind.TORQUE_FACTOR, 1000.0) in refused
    assert (MistakeKind.TORQUE_FACTOR, 0.001) in refused
    assert (MistakeKind.POSITION_FACTOR, DEGREES) in refused
    assert (MistakeKind.POSITION_FACTOR, 1.0 / DEGREES) in refused
    assert {(MistakeKind.CLOCK, 0.001), (MistakeKind.CLOCK, 1000.0)} <= set(refused)
    assert {kind for kind, _ in refused} <= {
        *(
            MistakeKind.TORQUE_FACTOR,
            MistakeKind.TORQUE_UNIT,
            MistakeKind.TORQUE_ORDER,
            MistakeKind.CLOCK,
            MistakeKind.AXIS_ORDER,
        ),
        *(MistakeKind.POSITION_FACTOR, MistakeKind.POSITION_OFFSET, MistakeKind.POSITION_ORDER),
    }


@pytest.mark.parametrize(("times", "found"), [(0.2, (0.2,)), (5.0, ())])
def test_a_common_factor_of_torques_must_keep_their_limits(
    arm: WiredSignals, times: float, found: tuple[float, ...]
) -> None:
    """Axis 2 uses 0.9 of its torque limit: a factor of 5 would exceed the limit."""
    links = tuple(
        link.model_copy(update={"mass_kg": times * link.mass_kg}) for link in arm.robot.cad or ()
    )
    drawn = replace(arm, robot=arm.robot.model_copy(update={"cad": links}))
    weight = find_impossibilities(drawn)[1]
    assert weight is not None
    assert not weight.is_plausible
    factors = [each.mistake.factor for each in find_mistakes(drawn)]
    assert factors == pytest.approx(found, rel=0.01)


def test_a_small_motion_does_not_determine_the_weight(arm: WiredSignals) -> None:
    """The main axes move by 3°, as in payload sessions; the fit lacks some friction terms."""
    middle = arm.position.mean(axis=0)
    reach = np.array([0.02, 0.02, 0.02, 0.3, 0.3, 0.3])
    q = middle + reach * (arm.position - middle)
    v, a = reach * arm.velocity, reach * arm.acceleration
    model = RobotModel.from_description(arm.robot, rotors=False, friction=False, spring=False)
    rigid_nm = regressor(model, q, v, a) @ drawn_parameters(model, arm.robot)
    size = np.sqrt(np.mean(rigid_nm**2, axis=0))
    speed = np.sqrt(np.mean(v**2, axis=0))
    friction_nm = 0.1 * size * (np.sign(v) + np.exp(-np.abs(v) / (0.1 * speed)) * np.sign(v))
    slow = replace(arm, position=q, velocity=v, acceleration=a, torque_nm=rigid_nm + friction_nm)
    driving, weight = find_impossibilities(slow)
    assert driving == ()
    assert weight is not None
    assert weight.is_plausible
    assert weight.sigma > 1.0, "the weight is unknown"
    assert np.ptp(q[:, :3], axis=0).max() < math.radians(4.0)
