"""`stream_motion`: what is refused before the cell is opened."""

from __future__ import annotations

from dataclasses import replace
from multiprocessing import active_children
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pytest

from acquisition.session.outcome import RecordOutcome
from acquisition.task.set_points import SetPointSource
from compensation.online.point_source import MOST_NODES, buffer_points
from compensation.online.stream import StreamSettings, stream_motion, stream_socket
from config.errors import ConfigError, PreflightError, TransportError
from config.robot.bodies import Plane, Workspace
from tests.builders.point_streams import CELL, FORWARD, planned
from tests.builders.raised_codes import raises_code


def record(_: SetPointSource) -> RecordOutcome:
    raise AssertionError("it was begun")


def test_a_motion_of_another_cycle_time_is_refused() -> None:
    slower = CELL.config.model_copy(update={"cycle_time_ms": 2 * CELL.config.cycle_time_ms})
    with raises_code(ConfigError, "RID-MOTION-CYCLE"):
        stream_motion(slower, FORWARD, planned(), record)


def test_a_motion_that_comes_too_close_is_refused() -> None:
    samples = planned()
    wall = Plane(name="wall", normal=(-1.0, 0.0, 0.0), offset_m=-0.6)
    cell = CELL.config.model_copy(update={"workspace": Workspace(planes=(wall,))})
    turn = np.zeros_like(samples.position)
    turn[:, 0] = np.linspace(1.5, 0.0, len(samples))  # towards the wall
    with raises_code(PreflightError, "RID-MOTION-COLLISION", "wall"):
        stream_motion(cell, FORWARD, replace(samples, position=turn), record)


@pytest.mark.parametrize("cycle_s", [0.001, 0.008])
def test_a_buffer_larger_than_the_ring_is_refused(cycle_s: float) -> None:
    assert buffer_points(MOST_NODES * cycle_s, cycle_s) == MOST_NODES
    with raises_code(ConfigError, "RID-OPTION-RANGE"):
        buffer_points((MOST_NODES + 1) * cycle_s, cycle_s)


def test_a_point_server_that_dies_before_the_first_point_moves_nothing() -> None:
    def kill() -> None:
        (server,) = (each for each in active_children() if each.name == "rid-daq points")
        server.kill()
        server.join()

    waits = StreamSettings(patience_s=3600.0)
    with TemporaryDirectory() as folder, raises_code(TransportError, "RID-STREAM-CLIENT"):
        stream_socket(CELL.config, FORWARD, Path(folder) / "points", record, waits, kill)
