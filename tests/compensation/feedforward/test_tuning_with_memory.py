"""Tuning with presliding friction, whose state is carried from one period to the next."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from acquisition.motion.samples import MotionSamples, Phase, phases_of
from compensation.feedforward.inverse import periodic_feedforward
from compensation.feedforward.repeated_error import RepeatedError
from compensation.feedforward.tuning import tune
from config.load import load_cell
from dynamics.model.memory import with_presliding_history
from identification.estimation.estimate import predict
from tests.builders.known_model import known_estimate
from tests.builders.point_streams import T, loops_of

ROWS = 500


def test_a_correct_feedforward_is_not_changed() -> None:
    cell = load_cell("ir361")
    joints = tuple(
        joint.model_copy(
            update={"friction": (*joint.friction, "presliding"), "presliding_distance": 0.03}
        )
        for joint in cell.robot.joints
    )
    cell = replace(cell, robot=cell.robot.model_copy(update={"joints": joints}))
    model, loops = known_estimate(cell, {}), loops_of(cell)
    turn = 2.0 * np.pi / (ROWS * T)
    angle = turn * T * np.arange(ROWS)[:, np.newaxis] + [0.0, 1.0, 2.0]
    q = 0.3 * np.sin(angle) + 0.02 * np.sin(3.0 * angle)
    v = turn * (0.3 * np.cos(angle) + 0.06 * np.cos(3.0 * angle))
    a = turn**2 * (-0.3 * np.sin(angle) - 0.18 * np.sin(3.0 * angle))
    torque = predict(model, q, v, a, with_presliding_history(model.model, q, periodic=True))
    samples = MotionSamples(
        cell.robot.joint_names, T, q, v, a,
        phase=phases_of((Phase.MAIN, ROWS)),
        feedforward=periodic_feedforward(loops, v, torque, T),
    )  # fmt: skip
    exact = RepeatedError(
        joint_names=samples.joint_names,
        sample_period_s=T,
        rows=slice(0, ROWS),
        error=np.zeros_like(q),
        bin_variance=np.zeros((ROWS // 2 + 1, 3)),
        periodic=True,
        repetitions=4,
    )
    found = tune(samples, exact, model, loops, cell.config.position_gain_per_s)
    np.testing.assert_allclose(found.scale, 1.0, atol=1e-3)
