"""`rid-daq jog` in a terminal: a key is held or released, the program is killed or suspended."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest

from acquisition.journal.cycle_row import row_dtype
from acquisition.journal.cycles import read_journal
from acquisition.runs.folder import RunFolder
from config.load import load_cell
from mock_hw.cell import SimulatedCell
from mock_hw.host.runtime_directory import runtime_directory
from mock_hw.simulation import CellSimulation
from tests.builders.console_blocks import assert_shown
from tests.builders.screens import screen_lines
from tests.builders.typist import Typist, wait_for

pytestmark = pytest.mark.slow

LOADED = load_cell("ir361")
SPEED = 0.05 * LOADED.robot.joints[0].limits.velocity
RAMP_S = SPEED / LOADED.config.drive_safety.quick_stop_deceleration_rad_s2


@pytest.fixture(scope="module")
def served() -> Iterator[SimulatedCell]:
    assert LOADED.plant is not None
    simulation = CellSimulation(
        LOADED.config, LOADED.robot, LOADED.plant, realtime=False, seed=1,
        directory=runtime_directory(),
    )  # fmt: skip
    with SimulatedCell(simulation) as simulated:
        yield simulated


def is_moving(served: SimulatedCell) -> bool:
    return bool(np.abs(served.axes().velocity).max() > 0.5 * SPEED)


def is_off(served: SimulatedCell) -> bool:
    axes = served.axes()
    return not axes.enabled.any() and bool(np.abs(axes.velocity).max() < 1e-6)


def recorded_rows(runs: Path) -> np.ndarray:
    (folder,) = runs.iterdir()
    path = RunFolder.open(folder).file("recording.mcap")
    wait_for(lambda: read_journal(path).damage.finished)
    journal = read_journal(path)
    assert journal.damage.notes == ()
    assert journal.rows.dtype == row_dtype(3)
    return journal.rows


def test_a_joint_moves_only_while_its_key_is_held(served: SimulatedCell, tmp_path: Path) -> None:
    with Typist("jog", "ir361", "--runs", tmp_path) as person:
        person.wait_for_text("Ready")
        before = served.axes().position
        person.type("3")
        with person.hold_key("-"):
            wait_for(lambda: bool(served.axes().position[2] < before[2] - 0.1))
        person.type("q")
        assert person.wait_for_end() == 0
    shown = "\n".join(screen_lines(person.shown))
    assert_shown("first-motion", "rid-daq jog cell.yaml", shown)
    after = served.axes().position
    assert is_off(served)
    np.testing.assert_allclose(after[:2], before[:2], atol=1e-3)
    rows = recorded_rows(tmp_path)
    limit = LOADED.robot.joints[2].limits
    assert np.abs(rows["target_velocity"]).max() == pytest.approx(0.05 * limit.velocity)
    slope = np.diff(rows["target_velocity"], axis=0) / LOADED.config.cycle_time_s
    assert np.abs(slope).max() <= 0.3 * limit.acceleration * 1.001


def test_jog_home_reaches_the_home_pose_and_ends(served: SimulatedCell, tmp_path: Path) -> None:
    home = np.array(LOADED.config.home)
    away = np.abs(served.axes().position - home).max()
    with Typist("jog", "ir361", "--home", "--runs", tmp_path) as person:
        person.wait_for_text("Ready")
        with person.hold_key(" "):
            assert person.wait_for_end() == 0
    assert away > 0.05
    assert is_off(served)
    np.testing.assert_allclose(served.axes().position, home, atol=0.01)


@pytest.mark.fault(43)
@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGSTOP])
def test_the_axes_stop_if_the_program_is_killed_or_suspended_with_a_held_key(
    served: SimulatedCell, tmp_path: Path, how: signal.Signals, measured: Callable[[str], None]
) -> None:
    with Typist("jog", "ir361", "--runs", tmp_path) as person:
        person.wait_for_text("Ready")
        with person.hold_key("+"):
            wait_for(lambda: is_moving(served))
            person.program.send_signal(how)
            if how is signal.SIGSTOP:
                wait_for(lambda: not is_moving(served))
                person.program.kill()
            wait_for(lambda: is_off(served))
    rows = recorded_rows(tmp_path)
    moving = np.abs(rows["target_velocity"]).max(axis=1) > 0.0
    after = rows[np.flatnonzero(moving)[-1] + 1 :]
    assert np.abs(after["velocity_command"]).max() < SPEED
    if how is signal.SIGSTOP:
        measured("jog with the key held, SIGSTOP: at rest, then power off")
    else:
        taken_s = after["time_s"][-1] - after["time_s"][0]
        assert taken_s < RAMP_S + 0.1
        measured(
            f"jog with the key held, kill -9: at rest {1e3 * taken_s:.0f} ms later, then power off"
        )
