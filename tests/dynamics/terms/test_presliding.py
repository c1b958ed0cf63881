"""Presliding hysteresis: properties of its state on any path, and the resulting model terms."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from config.arrays import FloatArray
from config.errors import EstimationError
from config.load import load_robot
from config.robot.friction_terms import FrictionTerm
from dynamics.kernels.presliding import (
    DIRECTION,
    FOUND,
    KNOWN,
    RIGID_SLIP,
    STATE,
    drive_presliding,
    initial_state,
)
from dynamics.model.memory import (
    presliding_of_model,
    samples_with_known_friction,
    with_presliding_history,
)
from dynamics.model.nonlinear_slopes import nonlinear_slopes
from dynamics.model.robot_model import RobotModel, load_torque, regressor, torque
from dynamics.terms.conditions import Conditions
from tests.builders.raised_codes import raises_code

D = 0.01
PATHS = st.lists(st.floats(-3.0 * D, 3.0 * D), min_size=2, max_size=40).map(np.cumsum)


def direction(
    path: FloatArray, distance: float = D, state: FloatArray | None = None, share: float = 1.0
) -> FloatArray:
    out = np.zeros((len(path), FOUND))
    state = initial_state() if state is None else state
    drive_presliding(np.asarray(path, dtype=np.float64), distance, share, state, out)
    return out


@given(PATHS, st.floats(0.0, 1.0))
def test_the_state_is_between_minus_one_and_one(path: FloatArray, share: float) -> None:
    assert np.all(np.abs(direction(path, share=share)[:, DIRECTION]) <= 1.0 + 1e-12)


@given(PATHS, st.integers(2, 5))
def test_the_state_depends_on_the_path_and_not_on_the_speed(path: FloatArray, pieces: int) -> None:
    slowly = np.interp(np.arange((len(path) - 1) * pieces + 1) / pieces, range(len(path)), path)
    np.testing.assert_allclose(
        direction(slowly)[::pieces, DIRECTION], direction(path)[:, DIRECTION], atol=1e-9
    )


@given(PATHS, st.integers(1, 38))
def test_the_state_continues_from_the_previous_part(path: FloatArray, cut: int) -> None:
    state = initial_state()
    pieces = [direction(part, state=state) for part in (path[:cut], path[cut:])]
    np.testing.assert_array_equal(np.concatenate(pieces), direction(path))


@given(st.floats(0.2, 1.9), st.floats(0.05, 1.0))
def test_a_closed_inner_loop_has_no_effect(reversal: float, depth: float) -> None:
    """Return-point memory (Madelung's rules): back at the reversal, the outer branch continues."""
    outer = np.array([0.0, 3.0, 3.0 - reversal, 3.0 - 2.0])
    back = 3.0 - reversal + min(depth, reversal)
    inner = np.array([0.0, 3.0, 3.0 - reversal, back, 3.0 - reversal, 3.0 - 2.0])
    assert direction(D * inner)[-1, DIRECTION] == pytest.approx(
        direction(D * outer)[-1, DIRECTION], abs=1e-12
    )


@given(PATHS, st.integers(0, 1000))
@settings(max_examples=50)
def test_a_known_state_depends_on_the_motion_alone(path: FloatArray, seed: int) -> None:
    before = D * np.cumsum(np.random.default_rng(seed).uniform(-2.0, 2.0, 20))
    other = np.concatenate([before - before[-1] + path[0], path])
    state = initial_state()
    fresh, used = direction(path, state=state), direction(other)[len(before) :]
    known = fresh[:, KNOWN] > 0.0
    np.testing.assert_allclose(used[known, DIRECTION], fresh[known, DIRECTION], atol=1e-9)
    assert state.shape == (STATE,)


def test_a_joint_slides_fully_one_distance_after_rest_and_two_after_a_reversal() -> None:
    from_rest = direction(D * np.array([0.0, 0.2, 0.5, 1.0, 2.0]))[:, DIRECTION]
    assert np.all(np.diff(from_rest[:4]) > 0.0)
    assert from_rest[2] > 0.7, "most of the force builds up over half of the distance"
    np.testing.assert_allclose(from_rest[3:], 1.0, atol=0.01)
    turned = direction(D * np.array([0.0, 2.0, 1.0, 0.1, 0.0]))[:, DIRECTION]
    assert turned[2] > -0.6
    np.testing.assert_allclose(turned[-1], -1.0, atol=1e-12)


def test_the_rigid_fraction_changes_at_once() -> None:
    turned = direction(np.array([0.0, 2.0 * D, 2.0 * D - 2.0 * RIGID_SLIP, D]), share=0.25)
    whole = direction(np.array([0.0, 2.0 * D, 2.0 * D - 2.0 * RIGID_SLIP, D]))[:, DIRECTION]
    np.testing.assert_allclose(turned[1, DIRECTION], 1.0)
    np.testing.assert_allclose(turned[2:, DIRECTION], 0.25 * whole[2:] - 0.75)


def test_the_rigid_fraction_is_unknown_up_to_its_own_distance() -> None:
    path = 1e-6 * np.arange(40.0)
    out = np.empty((len(path), FOUND))
    drive_presliding(path, 1e-6, 0.5, initial_state(), out)
    assert not out[path < 1.99 * RIGID_SLIP, KNOWN].any()
    assert out[path > 2.01 * RIGID_SLIP, KNOWN].all()


TERMS: tuple[tuple[FrictionTerm, ...], ...] = (
    ("coulomb", "viscous", "stribeck", "presliding"),
    ("asymmetric", "load", "presliding"),
    ("coulomb", "cube_root", "temperature", "presliding"),
)


def model_of(efficiency: float | None = None) -> RobotModel:
    robot = load_robot("ir361")
    joints = tuple(
        joint.model_copy(
            update={
                "friction": terms,
                "presliding_distance": 0.02,
                "presliding_share": share,
                "efficiency": None if "load" in terms else efficiency,
            }
        )
        for joint, terms, share in zip(robot.joints, TERMS, (1.0, 0.6, 0.3), strict=True)
    )
    return RobotModel.from_description(robot.model_copy(update={"joints": joints}))


def small_motion(samples: int = 60) -> tuple[FloatArray, FloatArray, FloatArray]:
    random = np.random.default_rng(1)
    q = np.cumsum(random.normal(0.0, 0.006, (samples, 3)), axis=0)
    v, a = random.normal(0.0, 0.1, (2, samples, 3))
    return q, v, a


@pytest.mark.parametrize("efficiency", [None, 0.8])
def test_derivatives_by_distance_and_fraction_are_those_of_the_torque(
    efficiency: float | None,
) -> None:
    model = model_of(efficiency)
    q, v, a = small_motion()
    warm = Conditions(temperature_k=np.full(3, 310.0))
    theta = np.random.default_rng(2).normal(size=len(model.parameter_names))
    load = load_torque(model, q, v, a, theta, warm)
    assert [own.distance.name for own in presliding_of_model(model)] == [
        "dp_axis1",
        "dp_axis2",
        "dp_axis3",
    ]
    assert {"sp_axis2", "sp_axis3"} <= set(model.nonlinear_names)
    assert "sp_axis1" not in model.nonlinear_names, "all friction of axis 1 is presliding"

    def conditions(of: RobotModel) -> Conditions:
        followed = with_presliding_history(of, q, warm)
        return Conditions(followed.temperature_k, load, memory=followed.memory)

    slopes = nonlinear_slopes(model, q, v, a, theta, conditions(model))
    assert np.abs(slopes).max(axis=(0, 1)).min() > 0.0
    for k, name in enumerate(model.nonlinear_names):
        step = 1e-8 * np.eye(len(model.nonlinear_names))[k]
        up, down = (
            regressor(moved, q, v, a, conditions(moved)) @ theta
            for moved in (model.with_nonlinear(model.nonlinear_values + s * step) for s in (1, -1))
        )
        np.testing.assert_allclose(
            slopes[:, :, k], (up - down) / 2e-8, rtol=1e-4, atol=2e-4, err_msg=name
        )


def test_a_joint_that_slides_far_has_the_friction_of_its_direction() -> None:
    model = model_of(0.8)
    t = np.linspace(0.0, 1.0, 200)[:, np.newaxis] * np.ones(3)
    q, v, a = 5.0 * t**2 + 0.1, 10.0 * t + 0.1, np.full_like(t, 10.0)
    warm = Conditions(temperature_k=np.full(3, 310.0))
    theta = np.random.default_rng(2).normal(size=len(model.parameter_names))
    followed = with_presliding_history(model, q, warm)
    assert followed.memory is not None
    known = followed.memory.known.all(axis=1)
    assert 0.5 < known.mean() < 1.0
    np.testing.assert_allclose(
        torque(model, q, v, a, theta, followed)[known],
        torque(model, q, v, a, theta, warm)[known],
        rtol=1e-9,
    )


def test_a_periodic_motion_starts_with_its_last_state_and_a_gap_resets_the_state() -> None:
    model = model_of()
    t = np.linspace(0.0, 2.0 * np.pi, 100, endpoint=False)[:, np.newaxis] * np.ones(3)
    once, steady = (
        with_presliding_history(model, np.sin(t), periodic=p).memory for p in (False, True)
    )
    assert once is not None
    assert steady is not None
    assert steady.known.all()
    assert not once.known[0].any()
    np.testing.assert_allclose(steady.direction[0], 1.0)
    segment = np.repeat([0, 1], 50)
    cut = with_presliding_history(model, np.sin(t), segment=segment).memory
    assert cut is not None
    assert not cut.known[50].any()
    assert cut.known[-1].all()
    np.testing.assert_array_equal(cut.part(slice(50, None)).direction, cut.direction[50:])


def test_samples_at_rest_are_used_for_joints_with_a_known_state() -> None:
    model = model_of()
    q = np.linspace(0.0, 0.1, 50)[:, np.newaxis] * np.ones(3)
    moving = np.zeros((50, 3), dtype=bool)
    assert not samples_with_known_friction(Conditions(), moving).any()
    use = samples_with_known_friction(with_presliding_history(model, q), moving)
    assert not use[0].any()
    assert use[-1].all()


def test_the_states_of_another_motion_are_refused() -> None:
    model, (q, v, a) = model_of(), small_motion()
    with raises_code(EstimationError, "RID-API-ARGUMENT", "59", "60"):
        regressor(model, q, v, a, with_presliding_history(model, q[1:]))
