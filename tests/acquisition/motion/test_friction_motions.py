"""The two motions for friction: constant speeds, and the same path in both directions."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion, SpeedRuns
from acquisition.motion.kinds.fourier import FourierJoint
from acquisition.motion.kinds.reversed import ReversedMotion
from acquisition.motion.samples import Phase
from config.errors import ConfigError
from config.formats.yaml_tree import parse_yaml
from config.load import load_robot, to_yaml, validate
from tests.builders.raised_codes import raises_code

CYCLE_S = 0.008
IR361 = load_robot("ir361")


def constant_speeds(*joints: SpeedRuns, **more: Any) -> ConstantVelocityMotion:
    return ConstantVelocityMotion(
        kind="constant_velocity", robot="ir361", pose=(0.1, -0.2, 0.3), joints=joints, **more
    )


LIFT = SpeedRuns(joint="axis2", low=-1.0, high=0.6, speeds=(0.1, 0.5, 1.0))
TURN = SpeedRuns(joint="axis1", low=-2.0, high=2.0, speeds=(2.0,))
WAVES = ReversedMotion(
    kind="reversed",
    robot="ir361",
    period_s=2.0,
    periods=3,
    ramp_s=1.0,
    joints=tuple(
        FourierJoint(joint=name, offset=0.1, sine=(0.3, 0.05), cosine=(0.1, -0.04))
        for name in IR361.joint_names
    ),
)


def test_every_speed_is_constant_in_both_directions_over_the_same_range() -> None:
    motion = constant_speeds(LIFT, TURN, repeats=2, longest_run_s=4.0)
    samples = motion.plan(IR361, CYCLE_S)
    _, runs = motion.runs(IR361, CYCLE_S)
    assert [(run.joint, run.speed) for run in runs] == [
        (joint, sign * speed)
        for joint, speeds in ((1, LIFT.speeds), (0, TURN.speeds))
        for speed in speeds
        for sign in (1, -1, 1, -1)
    ]
    for run in runs:
        rows = slice(run.first, run.end)
        assert np.allclose(samples.velocity[rows, run.joint], run.speed)
        assert np.abs(samples.acceleration[rows]).max() < 1e-9
        others = np.delete(np.arange(3), run.joint)
        np.testing.assert_allclose(
            samples.position[rows][:, others],
            [np.take(motion.pose, others)] * (run.end - run.first),
        )
        assert run.end - run.first <= 4.0 / CYCLE_S + 1
    forward, backward = (samples.position[r.first : r.end, 1] for r in runs[:2])
    np.testing.assert_allclose(forward.mean(), backward.mean(), atol=0.1 * CYCLE_S)
    np.testing.assert_allclose(samples.position[[0, -1]], [motion.pose] * 2)
    assert samples.samples_per_period is None


def test_a_kind_lists_the_ranges_of_its_joints_if_they_differ() -> None:
    heading, rows = constant_speeds(LIFT, TURN).joint_table()
    assert heading == ("axis", "from", "to", "speeds")
    assert rows[0] == ("axis2", "-1.000", "0.600", "0.1, 0.5, 1")
    assert [row[0] for row in rows] == ["axis2", "axis1"]
    assert WAVES.joint_table() is None


@settings(max_examples=30)
@given(
    st.floats(0.02, 2.0), st.floats(0.0, 0.5), st.floats(0.05, 1.0), st.sampled_from([0.004, 0.01])
)
def test_velocity_and_acceleration_are_the_derivatives_of_the_path(
    speed: float, dwell_s: float, fraction: float, cycle_s: float
) -> None:
    spec = SpeedRuns(joint="axis1", low=-2.5, high=2.5, speeds=(speed,))
    motion = constant_speeds(spec, dwell_s=dwell_s, acceleration_fraction=fraction)
    try:
        samples = motion.plan(IR361, cycle_s)
    except ConfigError as error:
        assert error.refusal == "RID-MOTION-STROKE"  # noqa: PT017
        return
    for values, rate in (
        (samples.position, samples.velocity),
        (samples.velocity, samples.acceleration),
    ):
        # Simpson's rule over two cycles; a jump of the rate between them causes a small error
        step = values[2:] - values[:-2]
        integral = (rate[2:] + 4.0 * rate[1:-1] + rate[:-2]) * cycle_s / 3.0
        assert np.abs(step - integral).max() < 0.4 * cycle_s * np.abs(np.diff(rate, axis=0)).max()
    assert np.abs(samples.acceleration[:, 0]).max() <= 10.0 * max(fraction, 0.3) + 1e-9


def test_the_return_path_is_the_forward_path_reversed() -> None:
    samples = WAVES.plan(IR361, CYCLE_S)
    hold = np.flatnonzero(samples.phase == Phase.HOLD)
    forward_part, reversed_part = slice(0, hold[0]), slice(hold[-1] + 1, None)
    period = round(2.0 / CYCLE_S)
    main = [
        np.flatnonzero(samples.phase[part] == Phase.MAIN) for part in (forward_part, reversed_part)
    ]
    assert [len(rows) for rows in main] == [3 * period] * 2
    forward = samples.position[forward_part][main[0][:period]]
    backward = samples.position[reversed_part][main[1][:period]]
    k = -np.arange(period) % period
    np.testing.assert_allclose(backward, forward[k], atol=1e-12)
    for name, sign in (("velocity", -1.0), ("acceleration", 1.0)):
        values = getattr(samples, name)
        np.testing.assert_allclose(
            values[reversed_part][main[1][:period]],
            sign * values[forward_part][main[0][:period]][k],
            atol=1e-12,
        )
    np.testing.assert_allclose(samples.position[hold], samples.position[[hold[0]] * len(hold)])
    assert samples.samples_per_period is None


@pytest.mark.parametrize("motion", [constant_speeds(LIFT)])
def test_a_motion_file_is_read_back_equal(motion: ConstantVelocityMotion) -> None:
    again = validate(parse_yaml(to_yaml(motion).encode(), "m.yaml"), ConstantVelocityMotion)
    assert again == motion


@pytest.mark.parametrize(
    ("motion", "code", "details"),
    [
        (
            constant_speeds(SpeedRuns(joint="axis9", low=0, high=1, speeds=(1.0,))),
            "RID-MOTION-JOINTS",
            ("'axis9'",),
        ),
        (
            constant_speeds(LIFT).model_copy(update={"pose": (0.0,)}),
            "RID-MOTION-JOINTS",
            ("pose", "1 values", "3 joints"),
        ),
        (
            constant_speeds(SpeedRuns(joint="axis2", low=0.0, high=0.3, speeds=(1.5,))),
            "RID-MOTION-STROKE",
            ("'axis2'", "1.5 per", " 0 s ", "0 and 0.3"),
        ),
        (
            constant_speeds(SpeedRuns(joint="axis2", low=-3.0, high=0.3, speeds=(1.5,))),
            "RID-MOTION-LIMIT",
            ("position of joint", "'axis2'", "-3 rad", "-1.4"),
        ),
        (
            constant_speeds(SpeedRuns(joint="axis1", low=-2.6, high=2.6, speeds=(2.7,))),
            "RID-MOTION-LIMIT",
            ("velocity of joint", "'axis1'", "2.7 rad/s", "2.6"),
        ),
        (
            constant_speeds(LIFT, repeats=100, longest_run_s=600.0),
            "RID-MOTION-LONG",
            ("360120 s", "14400 s"),
        ),
    ],
)
def test_an_invalid_friction_motion_is_refused(
    motion: ConstantVelocityMotion, code: str, details: tuple[str, ...]
) -> None:
    with raises_code(ConfigError, code, *details):
        motion.plan(IR361, CYCLE_S)
