"""A simulated robot takes up and puts down a payload during a motion."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from config.load import load_cell
from config.simulation.plant import MountedBody, PlantConfig
from drivers.canopen.frames import SYNC_COB_ID, Frame
from mock_hw.plant.load_transfer import LoadTransfer, MotionMarker
from mock_hw.plant.plant import Plant
from mock_hw.plant.snapshot import SnapshotWriter
from mock_hw.rack import DriveRack

CELL = load_cell("ir361")
KG, G = 4.0, 9.81
TOOL = MountedBody(
    mass_kg=KG, centre_m=(0.8, 0.02, 0.01), inertia_kg_m2=(0.02, 0.03, 0.03, 0.0, 0.0, 0.0)
)
UP = LoadTransfer("tool", 0.1, 0.2)
DOWN = LoadTransfer(None, 0.5, 0.1)
STEP_S = 0.01


@pytest.fixture(scope="module")
def truth() -> PlantConfig:
    assert CELL.plant is not None
    return CELL.plant.model_copy(update={"payloads": {"tool": TOOL}})


def held(plant: Plant, steps: int) -> NDArray[np.float64]:
    """Hold the robot with closed brakes; return its weight on the base after each step [N]."""
    rest, brakes = np.zeros(3), np.ones(3, dtype=np.bool_)
    weights = []
    for _ in range(steps):
        plant.advance(STEP_S, rest, rest, ~brakes, brakes)
        weights.append(abs(plant.base_wrench[2]))
    return np.array(weights)


def test_the_weight_of_the_payload_arrives_linearly(truth: PlantConfig) -> None:
    plant = Plant(CELL.robot, truth)
    plant.transfer((UP, DOWN), plant.time_s)
    weight = held(plant, 80)
    time_s = STEP_S * np.arange(1, 81)
    carried = np.interp(time_s, (0.1, 0.3, 0.5, 0.6), (0.0, 1.0, 1.0, 0.0))
    steps_of_the_plant = 2.0 * KG * G * 0.002 / DOWN.duration_s
    np.testing.assert_allclose(weight - weight[0], KG * G * carried, atol=steps_of_the_plant)
    assert plant.attached is None


def test_after_the_transfer_the_robot_is_the_one_that_always_carried_it(
    truth: PlantConfig,
) -> None:
    taken, always = Plant(CELL.robot, truth), Plant(CELL.robot, truth.with_payload("tool"))
    taken.transfer((LoadTransfer("tool", 0.0, 0.02),), 0.0)
    for plant in (taken, always):
        held(plant, 10)
    assert taken.attached == always.attached == "tool"
    np.testing.assert_allclose(taken.base_wrench, always.base_wrench, atol=1e-9)
    # driven in the same way from the same state, both need the same torques
    powered, free = np.ones(3, dtype=np.bool_), np.zeros(3, dtype=np.bool_)
    for plant in (taken, always):
        for step in range(50):
            speed = np.full(3, 0.004 * step)
            plant.advance(STEP_S, speed, speed + 0.004, powered, free)
    np.testing.assert_allclose(taken.torque, always.torque, atol=1e-6)


def test_the_transfers_count_from_the_sync_of_the_announced_row(
    truth: PlantConfig, tmp_path: Path
) -> None:
    """If the first rows of a motion are skipped, its time counts from as many cycles earlier."""
    snapshots = SnapshotWriter(tmp_path / "axes", 3)
    marker = MotionMarker(tmp_path / "axes")
    marker.open()
    rack = DriveRack(CELL.config, CELL.robot, truth, 0, snapshots)
    rack.change_load((UP,))
    sync = Frame(SYNC_COB_ID, b"")
    rack.receive(sync, 0.5)
    empty = abs(rack.base_wrench[2])
    marker.mark(5)
    rack.receive(sync, 1.0)
    origin_s = 1.0 - 5 * CELL.config.cycle_time_s
    for now_s, share in ((origin_s + 0.05, 0.0), (origin_s + 0.2, 0.5), (origin_s + 0.4, 1.0)):
        rack.advance(max(now_s, 1.0))
        assert abs(rack.base_wrench[2]) - empty == pytest.approx(KG * G * share, abs=0.9)
    rack.receive(sync, 2.0)
    rack.advance(2.5)
    assert abs(rack.base_wrench[2]) - empty == pytest.approx(KG * G, abs=1e-3)
