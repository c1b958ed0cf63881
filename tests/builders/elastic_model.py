"""`write_elastic_model`: a model whose robot has elastic gears."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from identification.estimation.file import read_estimate, write_estimate


def write_elastic_model(model: Path, path: Path, joints: list[int]) -> None:
    """Read a model, give some joints of its robot gears of 2e4 N m/rad, and write it to `path`."""
    estimate = read_estimate(model)
    gears = [
        joint.model_copy(update={"stiffness_nm_rad": 2e4}) if number in joints else joint
        for number, joint in enumerate(estimate.robot.joints)
    ]
    robot = estimate.robot.model_copy(update={"joints": tuple(gears)})
    write_estimate(path, replace(estimate, robot=robot))
