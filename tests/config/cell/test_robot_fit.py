"""Values of a cell file that contradict its robot file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from config.errors import ConfigError
from config.load import load_cell
from tests.builders.raised_codes import raises_code

BUNDLED = Path(__file__).parents[3] / "config" / "bundled"
REAL_GEAR = "gear_ratio: 121.0"
DECELERATION = "quick_stop_deceleration_rad_s2: 12.0"


@pytest.fixture
def make_cell(tmp_path: Path) -> Callable[..., str]:
    """Return a function that writes cell and robot ir361 with replaced texts.

    It returns the path of the cell file.
    """

    def make(
        cell: tuple[tuple[str, str], ...] = (), robot: tuple[tuple[str, str], ...] = ()
    ) -> str:
        for kind, replaced in (("cell", cell), ("robot", robot)):
            text = (BUNDLED / f"{kind}s" / "ir361.yaml").read_text()
            for old, new in (*replaced, ("robot: ir361\n", "robot: robot.yaml\n")):
                assert old in text or kind == "robot"
                text = text.replace(old, new, 1)
            (tmp_path / f"{kind}.yaml").write_text(text)
        return str(tmp_path / "cell.yaml")

    return make


def test_a_negative_gear_with_direction_1_is_refused(make_cell: Callable[..., str]) -> None:
    path = make_cell(robot=((REAL_GEAR, "gear_ratio: -121.0"),))
    with raises_code(ConfigError, "RID-CELL-VALUE", "cell.yaml:", "axis1", "-121", "direction"):
        load_cell(path)


def test_a_reversing_gear_whose_drive_counts_backwards_is_accepted(
    make_cell: Callable[..., str],
) -> None:
    path = make_cell(
        cell=(("node_id: 1", "node_id: 1, direction: -1"),),
        robot=((REAL_GEAR, "gear_ratio: -121.0"),),
    )
    loaded = load_cell(path)
    assert (loaded.robot.joints[0].gear_ratio, loaded.config.axes[0].direction) == (-121.0, -1)


def test_gravity_of_length_zero_needs_to_be_intended(make_cell: Callable[..., str]) -> None:
    gravity = ("gravity_m_s2: [0.0, 0.0, 9.81]", "gravity_m_s2: [0.0, 0.0, 0.0]")
    with raises_code(ConfigError, "RID-FILE-VALUE", "gravity_m_s2"):
        load_cell(make_cell(robot=(gravity,)))
    intended = (gravity[0], f"{gravity[1]}\nimplausible_on_purpose: [gravity_m_s2]")
    assert load_cell(make_cell(robot=(intended,))).robot.gravity_m_s2 == (0.0, 0.0, 0.0)


@pytest.mark.parametrize("value", ["688.0", "145.0"])
def test_a_deceleration_that_no_motor_can_produce_is_refused(
    make_cell: Callable[..., str], value: str
) -> None:
    path = make_cell(cell=((DECELERATION, DECELERATION.replace("12.0", value)),))
    with raises_code(ConfigError, "RID-CELL-VALUE", "cell.yaml:", "limit, 14"):
        load_cell(path)


def test_a_deceleration_of_a_drive_without_6085h_is_compared_too(
    make_cell: Callable[..., str],
) -> None:
    servo = ("node_id: 1", "node_id: 1, servo: {deceleration_rad_s2: 688.0}")
    with raises_code(ConfigError, "RID-CELL-VALUE", "axes.0.servo.deceleration_rad_s2", "688"):
        load_cell(make_cell(cell=(servo,)))


@pytest.mark.parametrize("value", ["0.0", "-12.0"])
def test_a_deceleration_of_zero_or_less_is_refused(
    make_cell: Callable[..., str], value: str
) -> None:
    path = make_cell(cell=((DECELERATION, DECELERATION.replace("12.0", value)),))
    with raises_code(ConfigError, "RID-FILE-VALUE", "quick_stop_deceleration_rad_s2"):
        load_cell(path)
