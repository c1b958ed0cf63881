"""Fixtures: simulation of the bundled arm with its position loop, its velocity loops and models."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pytest

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.processing.periods import average_periods
from acquisition.recording.recording import Recording
from benchmarks.closed_loop import closed_loop
from compensation.loops.frequency_response import frequency_responses
from compensation.loops.velocity_loop import VelocityLoop, fit_velocity_loop
from config.load import LoadedCell, load_cell
from config.robot.robot import RobotDescription
from identification.design.two_harmonic import TwoHarmonicOptions, design_two_harmonic
from identification.estimation.estimate import Estimate
from identification.estimation.fitted_periods import fit_periodic

Drive = Callable[..., Recording]


@pytest.fixture(scope="session")
def cell() -> LoadedCell:
    return load_cell("ir361")


@pytest.fixture(scope="session")
def drive(cell: LoadedCell) -> Drive:
    """Function that simulates a motion with its feedforward and returns the recording."""
    assert cell.plant is not None
    return partial(closed_loop, cell, cell.plant)


@pytest.fixture(scope="session")
def loops(cell: LoadedCell, drive: Drive) -> list[VelocityLoop]:
    return measured_loops(cell, drive)


def measured_loops(cell: LoadedCell, drive: Drive) -> list[VelocityLoop]:
    """Return the velocity loops of an arm, measured with a multisine."""
    joints = tuple(
        {"joint": name, "velocity": 0.03, "slow_amplitude": 0.1} for name in cell.robot.joint_names
    )
    motion = MultisineMotion.model_validate(
        {
            "kind": "multisine",
            "robot": "ir361",
            "period_s": 4.0,
            "lowest_hz": 0.75,
            "highest_hz": 20.0,
            "realisations": 2,
            "joints": joints,
        }
    )
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    recording = drive(samples, 1)
    return [fit_velocity_loop(r) for r in frequency_responses(recording, motion, cell.robot)]


@pytest.fixture(scope="session")
def model(cell: LoadedCell, drive: Drive) -> Estimate:
    """Model of the arm with presliding friction in its joints."""
    joints = (
        joint.model_copy(update={"friction": (*joint.friction, "presliding")})
        for joint in cell.robot.joints
    )
    return identified(cell, drive, cell.robot.model_copy(update={"joints": tuple(joints)}))


@pytest.fixture(scope="session")
def forgetful(cell: LoadedCell) -> tuple[Drive, list[VelocityLoop], Estimate]:
    """The arm with rigid (Coulomb) friction and no presliding, its velocity loops and its model."""
    plant = cell.plant
    assert plant is not None
    assert plant.unmodelled is not None
    axes = tuple(axis.model_copy(update={"presliding_rad": 0.0}) for axis in plant.extras)
    unmodelled = plant.unmodelled.model_copy(update={"axes": axes})
    drive = partial(closed_loop, cell, plant.model_copy(update={"unmodelled": unmodelled}))
    return drive, measured_loops(cell, drive), identified(cell, drive, cell.robot)


def identified(cell: LoadedCell, drive: Drive, robot: RobotDescription) -> Estimate:
    """Return a model identified from eight periods of an excitation."""
    motion = design_two_harmonic(
        cell.robot, TwoHarmonicOptions(10.0, tries=100, periods=8), cell.config.cycle_time_s
    )
    samples = motion.plan(cell.robot, cell.config.cycle_time_s)
    return fit_periodic(robot, [average_periods(drive(samples, 2))]).estimate()
