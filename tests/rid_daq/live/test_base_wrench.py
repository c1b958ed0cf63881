"""The wrench of a force plate in the live values, read from another process's shared memory."""

from __future__ import annotations

import os
import time

import numpy as np
import pytest

from acquisition.recording.plate_geometry import PlateGeometry
from acquisition.session.plate_block import PlateBlock, PlateState
from config.cell.plate import CHANNELS, PlateZero
from config.load import load_cell
from rid_daq.live.base_wrench import LiveWrench
from tests.builders.javascript_types import assert_declared

OFFSET_N = (5.0, -3.0, 2.0, 1.0, -40.0, 30.0, 20.0, -10.0)
WRENCH = np.array([10.0, -20.0, 300.0, 15.0, -25.0, 5.0])


@pytest.fixture
def block() -> PlateBlock:
    return PlateBlock.create()


@pytest.fixture
def live() -> LiveWrench:
    plate = load_cell("ir361").config.plate
    assert plate is not None
    zeroed = plate.model_copy(update={"zero": PlateZero(offset_n=OFFSET_N)})
    return LiveWrench(zeroed, os.getpid())


def send_row(block: PlateBlock, read_s: float, overload: int = 0) -> None:
    """Report a row of a plate that measures `WRENCH` and has the offsets `OFFSET_N`."""
    plate = load_cell("ir361").config.plate
    assert plate is not None
    channels = PlateGeometry.from_config(plate).channels(WRENCH) + np.array(OFFSET_N)
    row = channels.astype(np.float32)[np.newaxis]
    block.state = PlateState.RECORDING
    block.add_rows(row, np.array([overload], dtype=np.uint8), read_s)


def test_the_wrench_of_the_base_on_the_robot_is_relative_to_the_zero(
    block: PlateBlock, live: LiveWrench
) -> None:
    send_row(block, time.monotonic())
    found = live.document()
    assert found is not None
    assert found["force_n"] == pytest.approx(WRENCH[:3], abs=2e-3)
    assert found["moment_nm"] == pytest.approx(WRENCH[3:], abs=2e-3)
    assert found["overloaded"] is False
    assert_declared(found, "LiveWrench")


def test_the_age_is_that_of_the_newest_row(block: PlateBlock, live: LiveWrench) -> None:
    block.state = PlateState.RECORDING
    before = live.document()
    assert before is not None
    assert before["age_s"] is None
    send_row(block, time.monotonic() - 100.0)
    found = live.document()
    assert found is not None
    assert isinstance(found["age_s"], float)
    assert found["age_s"] >= 100.0


def test_an_overload_of_any_channel_is_reported(block: PlateBlock, live: LiveWrench) -> None:
    send_row(block, time.monotonic(), overload=1 << (CHANNELS - 1))
    found = live.document()
    assert found is not None
    assert found["overloaded"] is True


@pytest.mark.parametrize("state", [each for each in PlateState if each != PlateState.RECORDING])
def test_there_is_no_wrench_unless_the_plate_is_recorded(
    block: PlateBlock, live: LiveWrench, state: PlateState
) -> None:
    send_row(block, time.monotonic())
    assert live.document() is not None
    block.state = state
    assert live.document() is None
