"""Weight and mass of prismatic joints: Pinocchio simulates gantries, sound ones and wrong ones."""

from __future__ import annotations

import json
from dataclasses import dataclass, replace

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
import pytest

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.wiring.mistakes import MistakeKind
from identification.wiring.moved_mass import MovedMass, moved_masses
from identification.wiring.search import find_impossibilities, find_mistakes
from identification.wiring.signals import WiredSignals
from tests.builders.raised_codes import raises_invalid

MASSES_KG = (60.0, 25.0, 15.0)
ROTORS_KG = (20.0, 10.0, 8.0)
COULOMB_N = (40.0, 25.0, 15.0)
OFFSET_N = (2.0, -1.0, 1.5)
REACH = np.array([1.2, 0.8, 0.4])
ROWS = 800


def gantry(*, drawn: bool = True, rotors: bool = True, **of_z: object) -> RobotDescription:
    """Return a gantry whose last joint moves up."""
    limits = {"position_min": -2.0, "position_max": 2.0, "velocity": 3.0, "acceleration": 30.0}
    joints = [
        {
            "name": name,
            "type": "prismatic",
            "limits": {**limits, "torque": 1500.0},
            "friction": ["coulomb", "viscous", "offset"],
            "armature": rotors,
        }
        for name in "xyz"
    ]
    joints[2] |= of_z
    right = np.pi / 2.0
    rows = [
        {"beta_rad": right, "theta_rad": np.pi},
        {"alpha_rad": right, "theta_rad": right},
        {"alpha_rad": right},
    ]
    cad = [{"mass_kg": mass, "uncertainty": 0.1} for mass in MASSES_KG] if drawn else None
    table = {"convention": "modified_dh", "rows": rows}
    robot = {"name": "gantry", "kinematics": table, "joints": joints, "cad": cad}
    return RobotDescription.model_validate_json(json.dumps(robot))


@dataclass(frozen=True, eq=False)
class Simulated:
    """Signals of a gantry, and the forces that gravity needs."""

    signals: WiredSignals
    gravity_n: FloatArray


def simulated(
    robot: RobotDescription,
    coulomb_n: tuple[float, ...] = COULOMB_N,
    rotors_kg: tuple[float, ...] = ROTORS_KG,
    seed: int = 0,
) -> Simulated:
    """Simulate 40 s of a multisine with friction, rotors and 1 % noise."""
    random = np.random.default_rng(seed)
    model = pin.Model()
    axes = (pin.JointModelPX(), pin.JointModelPY(), pin.JointModelPZ())
    for j, (axis, mass) in enumerate(zip(axes, MASSES_KG, strict=True)):
        model.addJoint(j, axis, pin.SE3.Identity(), "xyz"[j])
        model.inertias[j + 1] = pin.Inertia(mass, np.full(3, 0.1), np.eye(3))
    data, still = model.createData(), np.zeros(3)
    time_s = np.linspace(0.0, 40.0, ROWS)[:, np.newaxis]
    omega = 2.0 * np.pi * np.array([0.05, 0.15, 0.325, 0.55])
    size = random.normal(size=(3, 4)) / np.array([1.0, 1.5, 2.5, 3.5])
    size *= (REACH / np.abs(size).sum(axis=1))[:, np.newaxis]
    angles = omega * time_s[:, :, np.newaxis] + random.uniform(0.0, 6.3, (3, 4))
    q = (size * np.sin(angles)).sum(axis=2)
    v = (size * omega * np.cos(angles)).sum(axis=2)
    a = -(size * omega**2 * np.sin(angles)).sum(axis=2)
    gravity_n = np.array([pin.rnea(model, data, row, still, still) for row in q])
    force_n = np.array([pin.rnea(model, data, *rows) for rows in zip(q, v, a, strict=True)])
    force_n += np.array(rotors_kg) * a + np.array(coulomb_n) * np.sign(v) + 20.0 * v
    force_n += np.array(OFFSET_N)
    force_n += 0.01 * np.std(force_n, axis=0) * random.normal(size=q.shape)
    return Simulated(WiredSignals(robot, q, v, a, force_n, np.ones(3, bool)), gravity_n)


def mass_of(signals: WiredSignals, joint: str) -> MovedMass:
    return next(each for each in moved_masses(signals) if each.joint == joint)


def with_force(signals: WiredSignals, factors: tuple[float, ...]) -> WiredSignals:
    return replace(signals, torque_nm=signals.torque_nm * np.array(factors))


def is_doubted(signals: WiredSignals) -> bool:
    """Return True if friction, weight or moved mass of the signals is reported as impossible."""
    driving, weight = find_impossibilities(signals)
    heavy = weight is not None and not weight.is_plausible
    return bool(driving or heavy or [each for each in moved_masses(signals) if each.sentence])


@pytest.mark.parametrize("drawn", [True, False])
@pytest.mark.parametrize("rotors", [True, False])
def test_a_sound_gantry_is_plausible(drawn: bool, rotors: bool) -> None:
    rotors_kg = ROTORS_KG if rotors else (0.0, 0.0, 0.0)
    for seed in range(3):
        run = simulated(gantry(drawn=drawn, rotors=rotors), rotors_kg=rotors_kg, seed=seed)
        assert not is_doubted(run.signals)
        assert find_mistakes(run.signals, fine=False) == ()


def test_mass_and_weight_of_the_vertical_joint_are_those_of_links_and_rotor() -> None:
    moved = mass_of(simulated(gantry()).signals, "z")
    assert moved.mass_kg == pytest.approx(23.0, rel=0.01)
    assert moved.held == pytest.approx(15.0 / 23.0, abs=0.02)
    assert moved.drawn == pytest.approx(23.0 / 15.0, rel=0.01)


def test_a_horizontal_joint_has_a_mass_and_no_weight() -> None:
    moved = mass_of(simulated(gantry()).signals, "x")
    assert moved.mass_kg == pytest.approx(120.0, rel=0.01)
    assert moved.held is None


@pytest.mark.parametrize("drawn", [True, False])
def test_forces_without_gravity_are_impossible(drawn: bool) -> None:
    run = simulated(gantry(drawn=drawn))
    without = replace(run.signals, torque_nm=run.signals.torque_nm - run.gravity_n)
    assert mass_of(without, "z").is_weightless
    assert is_doubted(without)
    kinds = [each.mistake.kind for each in find_mistakes(without, fine=False)]
    assert kinds == ([MistakeKind.GRAVITY_REMOVED] if drawn else [])


def test_a_stated_counterbalance_is_no_contradiction() -> None:
    run = simulated(gantry(counterbalanced=True))
    for carried_n in (0.0, 140.0, 200.0):
        lifted = replace(run.signals, torque_nm=run.signals.torque_nm - [0.0, 0.0, carried_n])
        assert not is_doubted(lifted)
        assert find_mistakes(lifted, fine=False) == ()
        assert mass_of(lifted, "z").held is None


def test_a_counterbalance_that_is_not_stated_is_asked_for() -> None:
    run = simulated(gantry())
    lifted = replace(run.signals, torque_nm=run.signals.torque_nm - [0.0, 0.0, 140.0])
    assert is_doubted(lifted)


@pytest.mark.parametrize("factor", [4.0, 10.0, 0.25, 0.1])
def test_a_factor_of_all_forces_contradicts_the_drawings(factor: float) -> None:
    wrong = with_force(simulated(gantry()).signals, (factor,) * 3)
    assert is_doubted(wrong)
    (found,) = find_mistakes(wrong, fine=False)
    assert found.mistake.kind in (MistakeKind.TORQUE_FACTOR, MistakeKind.TORQUE_UNIT)


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_a_tenth_of_one_force_contradicts_the_drawings(joint: int) -> None:
    factors = [1.0, 1.0, 1.0]
    factors[joint] = 0.1
    wrong = with_force(simulated(gantry()).signals, tuple(factors))
    assert mass_of(wrong, "xyz"[joint]).is_light


@pytest.mark.parametrize("joint", [0, 1, 2])
def test_half_of_one_force_is_shown_but_possible(joint: int) -> None:
    """The masses in `cad` can be wrong by such a factor, and nothing else shows the scale."""
    factors = [1.0, 1.0, 1.0]
    factors[joint] = 0.5
    moved = mass_of(with_force(simulated(gantry()).signals, tuple(factors)), "xyz"[joint])
    assert moved.is_plausible
    assert moved.drawn is not None
    assert moved.drawn < 0.8


@pytest.mark.parametrize("joint", [0, 1])
def test_a_joint_is_at_least_as_heavy_as_the_links_that_a_later_joint_moves(joint: int) -> None:
    sound = simulated(gantry(drawn=False, rotors=False), rotors_kg=(0.0, 0.0, 0.0)).signals
    less = with_force(sound, tuple(0.25 if j == joint else 1.0 for j in range(3)))
    assert is_doubted(less)
    found = mass_of(less, "xyz"[joint])
    assert not found.is_plausible
    assert found.carried is not None
    assert found.carried.joint == "yz"[joint]
    assert found.carried.mass_kg == pytest.approx((40.0, 15.0)[joint], rel=0.05)


def test_of_a_joint_with_a_rotor_only_the_weight_shows_the_mass_of_the_links() -> None:
    sound = simulated(gantry(drawn=False)).signals
    carried = mass_of(sound, "x").carried
    assert carried is not None
    assert carried.joint == "z"
    assert carried.mass_kg == pytest.approx(15.0, rel=0.05)
    assert is_doubted(with_force(sound, (0.08, 1.0, 1.0)))


@pytest.mark.parametrize("seed", range(5))
def test_force_constants_a_tenth_wrong_are_no_contradiction_of_light_carriages(seed: int) -> None:
    robot = gantry(drawn=False, rotors=False)
    sound = simulated(robot, rotors_kg=(-58.0, -23.0, 0.0), seed=seed).signals  # 42, 17 and 15 kg
    assert not is_doubted(with_force(sound, (0.95, 1.05, 1.1)))


@pytest.mark.parametrize("drawn", [True, False])
def test_a_reversed_vertical_joint_is_found(drawn: bool) -> None:
    signals = simulated(gantry(drawn=drawn)).signals
    back = np.array([1.0, 1.0, -1.0])
    names = ("position", "velocity", "acceleration", "torque_nm")
    changes = {name: getattr(signals, name) * back for name in names}
    assert is_doubted(replace(signals, **changes))


@pytest.mark.parametrize("factor", [0.5, 0.001])
def test_a_position_that_makes_the_weight_larger_than_the_mass_is_impossible(
    factor: float,
) -> None:
    signals = simulated(gantry(drawn=False)).signals
    scale = np.array([1.0, 1.0, 1.0 / factor])
    names = ("position", "velocity", "acceleration")
    assert is_doubted(replace(signals, **{name: getattr(signals, name) * scale for name in names}))


@pytest.mark.parametrize(
    ("rotor_kg", "coulomb_n"), [(140.0, 60.0), (600.0, 60.0), (40.0, 120.0), (1500.0, 500.0)]
)
@pytest.mark.parametrize("drawn", [True, False])
def test_a_ball_screw_with_a_heavy_rotor_and_friction_is_sound(
    rotor_kg: float, coulomb_n: float, drawn: bool
) -> None:
    run = simulated(
        gantry(drawn=drawn),
        coulomb_n=(*COULOMB_N[:2], coulomb_n),
        rotors_kg=(*ROTORS_KG[:2], rotor_kg),
    )
    assert not is_doubted(run.signals)


@pytest.mark.parametrize("drawn", [True, False])
def test_a_slow_motion_does_not_show_a_missing_weight(drawn: bool) -> None:
    """If the motion is twelve times slower, accelerations hardly show the mass."""
    for seed in range(4):
        run = simulated(gantry(drawn=drawn), seed=seed)
        slow = replace(
            run.signals,
            velocity=run.signals.velocity / 12.0,
            acceleration=run.signals.acceleration / 144.0,
        )
        random = np.random.default_rng(seed)
        moved = np.array(MASSES_KG)[::-1].cumsum()[::-1] + np.array(ROTORS_KG)
        coulomb_n = 3.0 * np.array(COULOMB_N)
        stribeck = 1.0 + 0.1 * np.exp(-np.abs(slow.velocity) / 0.05)
        force_n = moved * slow.acceleration + coulomb_n * np.sign(slow.velocity) * stribeck
        force_n += run.gravity_n + 0.1 * coulomb_n + 20.0 * slow.velocity
        force_n += 0.02 * np.std(force_n, axis=0) * random.normal(size=force_n.shape)
        assert not is_doubted(replace(slow, torque_nm=force_n))


def test_a_counterbalance_is_stated_for_prismatic_joints_with_an_offset() -> None:
    with raises_invalid("joints.2", "offset"):
        gantry(counterbalanced=True, friction=["coulomb", "viscous"])
    with raises_invalid("joints.2", "spring"):
        gantry(counterbalanced=True, type="revolute")
