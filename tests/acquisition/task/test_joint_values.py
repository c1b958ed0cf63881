from __future__ import annotations

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.task.joint_values import JointWatch
from acquisition.task.ring import Ring
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription

T = 0.008


def write(ring: Ring, cycle: int, *, speed: float = 0.5, torque_nm: float = -40.0) -> None:
    row = np.zeros((), dtype=row_dtype(3))
    row["time_s"] = cycle * T
    row["position"] = speed * cycle * T
    row["target_position"] = row["position"] + 0.01
    row["target_velocity"] = (0.0, 0.5, -0.5)
    row["torque_nm"] = (torque_nm, 0.0, 10.0)
    row["valid"] = (1, 0, 1)
    values = [v for name in row.dtype.names or () for v in np.atleast_1d(row[name]).tolist()]
    assert ring.write(tuple(values))


@pytest.fixture
def ring() -> Ring:
    return Ring.create(3, 64)


def test_the_latest_values_are_shown_with_their_limits(
    ring: Ring, cell: CellConfig, robot: RobotDescription
) -> None:
    watch = JointWatch(ring, cell, robot)
    assert watch.look() is None
    for cycle in range(40):
        write(ring, cycle)
    values = watch.look()
    assert values is not None
    assert values.time_s == pytest.approx(39 * T)
    np.testing.assert_allclose(values.velocity, 0.5)
    np.testing.assert_allclose(values.torque_share, (0.4, 0.0, 0.1))
    np.testing.assert_allclose(values.following_error, 0.01)
    np.testing.assert_allclose(values.following_error_share, (0.5, 0.01 / 0.07, 0.01 / 0.07))
    assert values.valid.tolist() == [True, False, True]


def test_reading_removes_no_row(ring: Ring, cell: CellConfig, robot: RobotDescription) -> None:
    watch = JointWatch(ring, cell, robot)
    for cycle in range(10):
        write(ring, cycle)
        watch.look()
    assert ring.waiting == 10
    assert len(ring.read()) == 10 * ring.row_size


def test_the_latest_rows_are_complete_and_in_order_at_any_wrap_of_the_ring(ring: Ring) -> None:
    for cycle in range(150):
        write(ring, cycle)
        ring.read()
        rows = np.frombuffer(ring.latest(9), dtype=row_dtype(3))
        first = max(0, cycle - 8)
        np.testing.assert_allclose(rows["time_s"], np.arange(first, cycle + 1) * T)


def test_at_most_the_rows_in_the_ring_are_returned(ring: Ring) -> None:
    for cycle in range(64):
        write(ring, cycle)
    assert len(ring.latest(1000)) == 63 * ring.row_size
