"""The Kalman filter agrees with a good run of the six-axis cell with a coupled wrist.

It does not agree with a run whose torques are late.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from acquisition.motion.kinds.fourier import FourierJoint, FourierMotion
from acquisition.processing.periods import PeriodAverage, average_periods
from benchmarks.closed_loop import closed_loop
from config.load import load_cell
from dynamics.terms.conditions import Conditions
from identification.cross_checks.agreement import CrossCheck, CrossMethod, check_method
from identification.equations.segments import unfiltered_period_signals
from identification.equations.time_domain import TimeRun
from identification.estimation.fitted_periods import fit_periodic

pytestmark = pytest.mark.slow

CELL = load_cell("kr15")
LATE_ROWS = 2
JOINTS = (
    (
        -0.444982,
        (-1.34701, 0.883733, 0.757266, -0.247901, 0.047561),
        (-0.916463, -0.486016, -0.23884, -0.26468, -0.03941),
    ),
    (
        0.684745,
        (-0.066374, -0.197701, 0.369094, 0.277258, -0.043036),
        (-0.483309, 0.529442, -0.813566, -0.406019, 0.030737),
    ),
    (
        -0.81378,
        (-0.929704, -0.176556, 0.064341, 0.456664, -0.310259),
        (-0.31862, 0.032534, -0.582342, -0.426866, 0.028759),
    ),
    (
        1.856084,
        (-1.308534, 0.45908, 0.130899, 0.266823, -0.086927),
        (-1.05052, -1.094744, 0.066329, 0.034595, -1.129887),
    ),
    (
        0.637041,
        (-0.382316, -0.222961, 0.257349, 0.346727, 0.173973),
        (0.126384, -0.353331, -0.301047, 0.155961, -1.282163),
    ),
    (
        0.698218,
        (-1.581877, -0.900965, -0.632725, 1.33873, -1.534198),
        (-0.674193, 0.334221, 2.262499, 1.838705, -0.012411),
    ),
)
"""Offset [rad], sine and cosine coefficients of each joint, designed by `rid-daq design`."""


@pytest.fixture(scope="module")
def average() -> PeriodAverage:
    """Return the mean period of a good run; the simulated robot is that of the model."""
    joints = tuple(
        FourierJoint(joint=name, offset=offset, sine=sine, cosine=cosine)
        for name, (offset, sine, cosine) in zip(CELL.robot.joint_names, JOINTS, strict=True)
    )
    motion = FourierMotion(
        kind="fourier", robot="kr15", period_s=9.6, periods=4, ramp_s=4.0, joints=joints
    )
    assert CELL.plant is not None
    samples = motion.plan(CELL.robot, CELL.config.cycle_time_s)
    return average_periods(closed_loop(CELL, CELL.plant.without_unmodelled(), samples, 3))


def check(average: PeriodAverage) -> CrossCheck:
    estimate = fit_periodic(CELL.robot, [average]).estimate()
    run = TimeRun(unfiltered_period_signals(average, 10.0), Conditions(temperature_k=None))
    return check_method(CrossMethod.KALMAN, estimate, (run,))


def test_a_good_run_is_not_contradicted(average: PeriodAverage) -> None:
    found = check(average)
    assert found.agrees, found.sentence


def test_the_filter_does_not_agree_with_a_run_with_late_torques(average: PeriodAverage) -> None:
    late = replace(average, torque_nm=np.roll(average.torque_nm, LATE_ROWS, axis=0))
    assert not check(late).agrees
