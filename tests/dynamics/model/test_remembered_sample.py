"""The torque of a path with presliding, computed sample by sample, is compared with the torque of
the whole path.
"""

from __future__ import annotations

import numpy as np
import pytest

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from dynamics.kernels.presliding import FOUND
from dynamics.model.hysteretic_sample import hysteretic_torque, initial_states, update_presliding
from dynamics.model.memory import with_presliding_history
from dynamics.model.one_sample import SampleTorque
from dynamics.model.robot_model import RobotModel, load_torque, torque
from dynamics.terms.conditions import Conditions

DISTANCE, SHARE = 0.05, 0.4
KINDS = (
    "coulomb", "viscous", "offset", "asymmetric", "cubic", "cube_root", "stribeck",
    "shear_thinning", "load",
)  # fmt: skip


def arm(ir361: RobotDescription) -> RobotDescription:
    """Return an arm with presliding in the first and the last joint."""
    joints = tuple(
        joint.model_copy(
            update={
                "friction": KINDS if j == 1 else (*KINDS, "presliding"),
                "presliding_distance": DISTANCE,
                "presliding_share": SHARE if j == 2 else 1.0,
                "efficiency": 0.8 if j == 2 else None,
            }
        )
        for j, joint in enumerate(ir361.joints)
    )
    return ir361.model_copy(update={"joints": joints})


def path_with_reversals() -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q, v, a of a path with distant and close reversals, and with rest."""
    t = np.linspace(0.0, 6.0, 400)[:, np.newaxis]
    q = 0.3 * np.sin(t * [1.0, 1.7, 2.3]) + 0.04 * np.sin(t * [9.0, 7.0, 8.0])
    v = np.gradient(q, t[1, 0], axis=0)
    a = np.gradient(v, t[1, 0], axis=0)
    q[200:230], v[200:230], a[200:230] = q[200], 0.0, 0.0
    return q, v, a


@pytest.mark.parametrize("smoothing", [0.0, 0.05])
def test_the_torques_step_by_step_equal_those_of_the_whole_path(
    smoothing: float, ir361: RobotDescription
) -> None:
    """The joints have every kind of friction and loss, with presliding and without."""
    model = RobotModel.from_description(arm(ir361), sign_smoothing_rad_s=smoothing)
    theta = np.random.default_rng(1).uniform(0.5, 2.0, len(model.parameter_names))
    q, v, a = path_with_reversals()
    conditions = with_presliding_history(model, q)
    load = load_torque(model, q, v, a, theta, conditions)
    expected = torque(model, q, v, a, theta, Conditions(load_nm=load, memory=conditions.memory))
    one = SampleTorque.of(model, theta)
    np.testing.assert_array_equal(one.presliding, [[DISTANCE, 0.0, DISTANCE], [1.0, 0.0, SHARE]])
    state, found, out = initial_states(3), np.zeros((3, FOUND)), np.empty(3)
    for row in range(len(q)):
        update_presliding(q[row], one.presliding, state, found)
        hysteretic_torque(one.arrays, q[row], v[row], a[row], found, out)
        np.testing.assert_allclose(out, expected[row], rtol=1e-9, atol=1e-9)
    by_speed = torque(model, q, v, a, theta, Conditions(load_nm=load))
    assert np.abs(by_speed - expected)[:, 0].max() > 1.0, "presliding has an effect on this path"
    np.testing.assert_allclose(one(q[7], v[7], a[7]), by_speed[7], rtol=1e-9, atol=1e-9)
