"""`rigid_runs`: runs with the torques that rigid gears would need for the motors' motion."""

from __future__ import annotations

from dataclasses import replace

from acquisition.processing.periods import PeriodAverage
from config.robot.robot import RobotDescription
from identification.elasticity.elastic_fit import fit_elastic, rigid_averages
from identification.elasticity.gear_torque import has_stiffness
from identification.estimation.options import EstimationOptions
from identification.payload.measured_runs import MeasuredRuns
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import PayloadOptions, described_robot, robot_options


def gears_bend(robot: RobotDescription, how: PayloadOptions) -> bool:
    """Return True if the model, or without a model the robot file, states elastic gears."""
    if how.robot is not None:
        return how.robot.gear_torque_nm is not None
    return has_stiffness(robot)


def rigid_runs(robot: RobotDescription, runs: MeasuredRuns, how: PayloadOptions) -> MeasuredRuns:
    """Return runs with the torques that rigid gears would need for the motors' motion.

    The runs with the payload and those without are fitted separately to the motion of the links,
    each with the payload as part of the last link, if any. Only periodic runs are converted.

    Args:
        robot: The robot.
        runs: The runs, as measured. They are returned unchanged if no stiffness is known, or if the
            model was fitted to the motors.
        how: The procedure; its model can state the stiffness.

    Raises:
        EstimationError: The deflection does not converge, or the runs do not determine the robot.
    """
    if not gears_bend(robot, how) or not isinstance(runs, PeriodicRuns):
        return runs
    described = described_robot(robot, how)
    options = EstimationOptions(
        replace(robot_options(how), payload=False),
        band_hz=runs.band_hz,
        standstill_rad_s=runs.standstill_rad_s,
    )
    sources: list[PeriodAverage] = list(runs.sources)
    for loaded in sorted(set(runs.loaded)):
        chosen = [number for number, own in enumerate(runs.loaded) if own is loaded]
        measured = [runs.sources[number] for number in chosen]
        links = fit_elastic(described, measured, options).estimate()
        for number, average in zip(chosen, rigid_averages(links, measured), strict=True):
            sources[number] = average
    return replace(runs, sources=tuple(sources))
