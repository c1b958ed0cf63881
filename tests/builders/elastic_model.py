"""Models of robots with elastic gears."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from config.load import LoadedCell
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate, write_estimate
from tests.builders.known_model import known_estimate


def write_elastic_model(model: Path, path: Path, joints: list[int]) -> None:
    """Write a model to `path` with gears of 2e4 N m/rad at some joints.

    Args:
        model: Path of the model that is read.
        path: Path of the new model.
        joints: Numbers of the joints, from 0.
    """
    estimate = read_estimate(model)
    gears = [
        joint.model_copy(update={"stiffness_nm_rad": 2e4}) if number in joints else joint
        for number, joint in enumerate(estimate.robot.joints)
    ]
    robot = estimate.robot.model_copy(update={"joints": tuple(gears)})
    write_estimate(path, replace(estimate, robot=robot))


def links_model(cell: LoadedCell, stiffness_nm_rad: float = 2e4) -> Estimate:
    """Return the true parameters of a simulated arm as a model of links behind elastic gears.

    The gears have a damping of 50 N m s/rad and motors of 5 kg m2.
    """
    gears = {
        "stiffness_nm_rad": stiffness_nm_rad,
        "damping_nm_s": 50.0,
        "motor_inertia_kg_m2": 5.0,
    }
    joints = tuple(joint.model_copy(update=gears) for joint in cell.robot.joints)
    robot = cell.robot.model_copy(update={"joints": joints})
    size = np.full(len(joints), 0.5)
    return replace(known_estimate(cell, {}), robot=robot, gear_torque_nm=size)
