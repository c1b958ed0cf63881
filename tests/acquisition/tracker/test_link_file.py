"""Files of encoders on the link side: columns, units, clock, and refusals."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from acquisition.tracker.link_file import LinkPositions, read_link_positions
from config.arrays import FloatArray
from config.errors import ConfigError, DataQualityError
from config.load import load_robot
from tests.builders.raised_codes import raises_code

TIME_S = np.arange(0.0, 20.0, 0.008)
ROBOT = load_robot("ir361")


def motors(time_s: FloatArray) -> FloatArray:
    """Return the positions of three joints that start and end at rest."""
    x = np.clip(time_s / 18.0 - 0.05, 0.0, 1.0)
    s = 18.0 * (10.0 * x**3 - 15.0 * x**4 + 6.0 * x**5)
    return np.column_stack([np.sin(1.1 * s), 0.6 * np.sin(0.7 * s), 0.4 * np.cos(1.7 * s)])


def links(offset_s: float, rate: float, joints: tuple[int, ...] = (0, 1, 2)) -> LinkPositions:
    """Return positions of link encoders, with another clock and zero, and 1 mrad of deflection."""
    own = np.arange(-1.0, 21.0, 0.0025)
    position = motors(own)[:, list(joints)] + 1e-3 * np.sin(own)[:, np.newaxis] + 2.0
    return LinkPositions(own * (1.0 + rate) + offset_s, joints, position)


@pytest.mark.parametrize(("offset_s", "rate"), [(500.0, 0.0), (-20.0, 1e-4)])
@pytest.mark.parametrize("joints", [(0, 1, 2), (1,)])
def test_the_clock_is_found(offset_s: float, rate: float, joints: tuple[int, ...]) -> None:
    clock = links(offset_s, rate, joints).clock(TIME_S, motors(TIME_S))
    at = np.array([4.0, 15.0])
    assert clock.run_time(at * (1.0 + rate) + offset_s) == pytest.approx(at, abs=2e-3)


def test_positions_of_another_motion_are_refused() -> None:
    other = LinkPositions(TIME_S, (0, 1, 2), motors(TIME_S)[::-1, [1, 2, 0]])
    with raises_code(DataQualityError, "RID-TRACKER-ALIGNMENT"):
        other.clock(TIME_S, motors(TIME_S))


def test_joints_with_their_units_are_read(tmp_path: Path) -> None:
    path = tmp_path / "links.csv"
    path.write_text("time_s;axis3_deg;axis1;valid\n0,0;180;0,5;1\n0,1;0;0,6;0\n0,2;-180;0,7;1\n")
    found = read_link_positions(path, ROBOT)
    assert found.joints == (0, 2)
    assert found.time_s.tolist() == [0.0, 0.2]
    assert found.position == pytest.approx(np.array([[0.5, np.pi], [0.7, -np.pi]]))


@pytest.mark.parametrize(
    ("text", "code"),
    [
        ("time_s,elbow\n0,1\n1,2\n", "RID-TRACKER-COLUMNS"),
        ("axis1\n0\n1\n", "RID-TRACKER-COLUMNS"),
        ("time_s,axis1\n0,1\n0,2\n", "RID-TRACKER-ROW"),
        ("time_s,axis1\n0,1\n1\n", "RID-TRACKER-ROW"),
    ],
)
def test_an_unusable_table_is_refused(text: str, code: str, tmp_path: Path) -> None:
    path = tmp_path / "links.csv"
    path.write_text(text)
    with raises_code(ConfigError, code):
        read_link_positions(path, ROBOT)
