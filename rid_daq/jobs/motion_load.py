"""The reaction on the base that a motion file would cause, without running it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from acquisition.motion.motion_file import load_motion
from config.cell.cell import CellConfig
from config.cell.plate import PlateLimits
from config.errors import ConfigError
from config.load import load_cell
from identification.calibration.base_reaction import BaseLoad, base_load
from identification.estimation.estimate import Estimate


def is_motion_file(name: str) -> bool:
    """Return whether what was named is a YAML file, and no run."""
    path = Path(name)
    return path.suffix in (".yaml", ".yml") and path.is_file()


def motion_load(
    estimate: Estimate, motion: Path, cell: str | None, mass_kg: float | None
) -> BaseLoad:
    """Predict the largest reaction of a motion, and hold it against the cell's limits.

    Parameters
    ----------
    estimate
        Of the external or the combined model.
    motion
        The motion file.
    cell
        A bundled name or a cell file.
    mass_kg
        Mass of everything that the base carries; by the robot's drawings where not given.

    Raises
    ------
    ConfigError
        No cell is named, it has no limits, or the motion is for another robot or cannot be run.
    EstimationError
        The estimate is of the internal model.
    """
    if cell is None:
        raise ConfigError(
            f"{motion}: a motion file needs --cell, which says the limits and the cycle time"
        )
    loaded = load_cell(cell)
    limits = limits_of(loaded.config, f"cell {loaded.config.name}")
    asked = load_motion(motion)
    for what, robot in ((str(motion), asked.robot), ("the model", estimate.robot.name)):
        if robot != loaded.robot.name:
            raise ConfigError(
                f"{what}: is for robot {robot!r}, cell {loaded.config.name} has"
                f" {loaded.robot.name!r}"
            )
    samples = asked.plan(loaded.robot, loaded.config.cycle_time_s)
    return base_load(
        estimate,
        np.arange(len(samples), dtype=np.float64) * samples.sample_period_s,
        samples.position,
        samples.velocity,
        samples.acceleration,
        limits,
        mass_kg=mass_kg,
    )


def limits_of(cell: CellConfig | None, where: str) -> PlateLimits:
    """Return what a cell file says that the floor may see.

    Raises
    ------
    ConfigError
        It says nothing; `where` names it in the message.
    """
    limits = None if cell is None or cell.plate is None else cell.plate.limits
    if limits is None:
        raise ConfigError(
            f"--base-limits: {where} has no `plate` with `limits`; add force_n and moment_nm there"
        )
    return limits
