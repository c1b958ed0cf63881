"""Unknown payload on the last link, compared with Pinocchio with that body attached."""

from __future__ import annotations

import numpy as np
import pytest

from dynamics.model.robot_model import RobotModel, base_wrench_regressor, regressor, torque
from dynamics.terms.conditions import Conditions

CARRIED, EMPTY = Conditions(payload=True), Conditions(payload=False)


def with_payload(robot) -> RobotModel:
    return RobotModel.from_description(
        robot, rotors=False, friction=False, spring=False, payload=True
    )


@pytest.mark.parametrize(("n", "kinds"), [(1, "R"), (3, "RPR"), (6, "RRRRRR"), (4, "RRRP")])
def test_a_payload_has_the_effect_of_a_body_on_the_last_link(
    n, kinds, random_arm, judge, random_links, random_motion
) -> None:
    robot, links = random_arm(n, n, kinds), random_links(n, 1)
    payload = random_links(1, 2)[0]
    together = links.copy()
    together[-1] += payload
    reference = judge(robot, together)
    q, v, a = random_motion(n, 3)
    samples = list(zip(q, v, a, strict=True))
    model, theta = with_payload(robot), np.concatenate([links.ravel(), payload])

    expected = np.array([reference.torque(*s) for s in samples])
    np.testing.assert_allclose(torque(model, q, v, a, theta, CARRIED), expected, atol=1e-10)
    expected = np.array([reference.base_wrench(*s) for s in samples])
    wrench = base_wrench_regressor(model, q, v, a, CARRIED) @ theta
    np.testing.assert_allclose(wrench, expected, atol=1e-10)


def test_a_payload_that_is_not_carried_has_no_effect(random_arm, random_motion) -> None:
    model = with_payload(random_arm(4, 0))
    q, v, a = random_motion(4, 0)
    for conditions in (None, EMPTY):
        assert not regressor(model, q, v, a, conditions)[:, :, 40:].any()
        assert not base_wrench_regressor(model, q, v, a, conditions)[:, :, 40:].any()


def test_a_payload_has_ten_parameters_after_all_others(ir361) -> None:
    model = RobotModel.from_description(ir361, payload=True)
    assert model.parameter_groups["payload"] == slice(41, 51)
    assert " ".join(model.parameter_names[41:]) == ("mL sxL syL szL IxxL IxyL IxzL IyyL IyzL IzzL")
    assert model.parameter_units[41:] == ("kg", *["kg m"] * 3, *["kg m^2"] * 6)
