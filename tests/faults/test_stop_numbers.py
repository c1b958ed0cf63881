"""Random settings of the stop: every axis stops if the preflight has passed (docs/faults.md, row
39).
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from acquisition.motion.limits import position_bounds
from config.cell.cell import CanBusConfig, CellConfig, DriveAxis, Supervision
from config.cell.drive_safety import DriveSafety
from config.robot.kinematic_table import KinematicRow, Kinematics
from config.robot.robot import Joint, JointLimits, RobotDescription
from tests.builders.obedient_cell import Outcome

CYCLES = 80
Measured = Callable[[str], None]


NUMBERS: dict[str, tuple[float, float, float]] = {
    # name: (usual value, smallest and largest value that the file's schema accepts)
    "master_heartbeat_timeout_ms": (80, 2, 65535),
    "drive_heartbeat_timeout_ms": (100, 2, 65535),
    "quick_stop_deceleration_rad_s2": (8.0, 1e-30, 1e9),
    "following_error_rad": (0.1, 1e-9, 1e9),
    "following_error_timeout_ms": (20, 1, 65535),
    "torque_limit_fraction": (3.0, 1e-6, 6.5),
    "missed_frames_limit": (3, 1, 10**6),
    "late_cycles_limit": (3, 1, 10**6),
    "late_by_cycles_limit": (2.0, 1e-3, 1e6),
    "late_answers_limit": (3, 1, 100),
    "second_answers_limit": (20, 1, 100),
    "following_error_min_rad": (0.05, 1e-6, 1e6),
    "following_error_per_velocity_s": (0.1, 1e-6, 1e6),
    "stuck_encoder_cycles": (5, 2, 10**6),
    "stuck_encoder_velocity_rad_s": (0.05, 1e-6, 1e6),
    "stuck_encoder_torque_fraction": (0.35, 1e-6, 2.0),
    "limit_margin_fraction": (0.1, 1e-6, 0.5),
}


def wide(low: float, high: float) -> st.SearchStrategy[float]:
    """Draw numbers with uniformly distributed logarithms."""
    return st.floats(math.log(low), math.log(high)).map(
        lambda size: min(max(math.exp(size), low), high)
    )


@st.composite
def numbers(draw: st.DrawFn) -> dict[str, Any]:
    """Draw the numbers of a cell: most are near their usual values, up to three are any number."""
    wild = draw(st.sets(st.sampled_from(sorted(NUMBERS)), max_size=3))
    found: dict[str, Any] = {}
    for name, (usual, low, high) in NUMBERS.items():
        size = wide(low, high)
        if name not in wild:
            size = wide(max(low, 0.7 * usual), min(high, 1.4 * usual))
        value = draw(size)
        found[name] = round(value) if isinstance(usual, int) else value
    return found


@st.composite
def safety_of(draw: st.DrawFn, of: dict[str, Any]) -> DriveSafety:
    wanted = {name: of[name] for name in NUMBERS if name in DriveSafety.model_fields}
    return DriveSafety(
        master_heartbeat_ms=draw(st.integers(1, wanted["master_heartbeat_timeout_ms"] // 2)),
        drive_heartbeat_ms=draw(st.integers(1, wanted["drive_heartbeat_timeout_ms"] // 2)),
        abort_connection=draw(st.sampled_from((1, 2, 3))),
        quick_stop_option=draw(st.sampled_from((1, 2, 5, 6))),
        fault_reaction_option=draw(st.sampled_from((0, 1, 2))),
        **wanted,
    )


@st.composite
def cells(draw: st.DrawFn) -> tuple[CellConfig, RobotDescription, int]:
    """Draw a cell of one or two axes, its robot, and the encoders' increments per revolution."""
    count = draw(st.integers(1, 2))
    of = draw(numbers())
    rules = {name: of[name] for name in NUMBERS if name in Supervision.model_fields}
    units: st.SearchStrategy[Literal["increments_per_s", "rpm", "0.1rpm"]]
    units = st.sampled_from(("increments_per_s", "rpm", "0.1rpm"))
    cell = CellConfig(
        name="random", robot="random",
        cycle_time_ms=draw(st.sampled_from((1, 2, 4, 8, 8, 20, 100))),
        can=CanBusConfig(interface="virtual", channel="random"),
        axes=tuple(
            DriveAxis(joint=f"j{i}", node_id=i + 1, velocity_unit=draw(units),
                      direction=draw(st.sampled_from((1, -1))))
            for i in range(count)
        ),
        position_gain_per_s=5.0, drive_safety=draw(safety_of(of)), simulated=True, plant="ir361",
        supervision=Supervision(**rules),
    )  # fmt: skip
    joints = tuple(
        Joint(
            name=f"j{i}",
            gear_ratio=draw(st.sampled_from((1.0, 50.0, 121.0))),
            limits=JointLimits(
                position_min=-draw(wide(0.3, 6.0)), position_max=draw(wide(0.3, 6.0)),
                velocity=draw(wide(0.2, 4.0)), acceleration=draw(wide(2.0, 20.0)), torque=300.0,
            ),
        )
        for i in range(count)
    )  # fmt: skip
    rows = tuple(KinematicRow(a_m=0.1) for _ in range(count))
    kinematics = Kinematics(convention="modified_dh", rows=rows)
    robot = RobotDescription(name="random", kinematics=kinematics, joints=joints)
    return cell, robot, draw(st.sampled_from((4096, 65536, 1 << 20)))


SEEN: Counter[str] = Counter()


def every_axis_stops_if_the_preflight_is_green(
    made: tuple[CellConfig, RobotDescription, int], share: float, sign: int
) -> None:
    cell, robot, increments = made
    rows = 1 + int(share * CYCLES)
    outcome = Outcome(cell, robot, increments, rows, sign)
    SEEN["tried"] += 1
    trace = outcome.bus.trace
    if not trace:
        assert outcome.error is not None
        SEEN["refused"] += 1
        return
    assert not any(trace[-1][3]), "an axis is still powered"
    SEEN["moved"] += 1
    low, high = position_bounds(cell, robot)
    lag_s = 4.0 * cell.cycle_time_s
    for i, joint in enumerate(robot.joints):
        rest_s = outcome.ordered_s + 1.01 * outcome.stated_s(joint.name) + lag_s
        outside_s = np.inf
        for time_s, position, speed, powered in trace:
            if time_s < outcome.ordered_s:
                continue
            if time_s > rest_s:
                assert speed[i] == 0.0 or not powered[i], (
                    f"{joint.name} still moves after {rest_s} s"
                )
            inside = low[i] <= position[i] <= high[i]
            outside_s = np.inf if inside else min(outside_s, time_s)
            if powered[i] and speed[i] > 0.02:
                assert time_s <= outside_s + lag_s, (
                    f"{joint.name} is still powered too long after it passed its limit"
                )


@pytest.mark.timeout(1500)
@pytest.mark.fault(39)
@pytest.mark.parametrize("count", [250, pytest.param(2000, marks=pytest.mark.long)])
def test_every_axis_stops_if_the_preflight_is_green(measured: Measured, count: int) -> None:
    SEEN.clear()
    drawn = given(made=cells(), share=st.floats(0.02, 1.0), sign=st.sampled_from((1, -1)))
    settings(max_examples=count, suppress_health_check=list(HealthCheck), phases=(Phase.generate,))(
        drawn(every_axis_stops_if_the_preflight_is_green)
    )()
    assert SEEN["tried"] >= count
    assert SEEN["moved"] >= count / 10, "too few cells moved"
    assert SEEN["refused"] >= count / 10, "too few cells were refused"
    measured(
        f"{SEEN['tried']} cells: {SEEN['refused']} refused before power on, {SEEN['moved']} moved"
        " and stopped within the stated time, inside their range or without power"
    )
