"""From runs to an estimate: periodic runs on their harmonics, others in the time domain."""

from __future__ import annotations

from collections.abc import Sequence

from acquisition.periods import average_periods
from acquisition.smoothing import smooth_nonperiodic
from config.errors import ConfigError
from identification.estimate import Estimate
from identification.estimators import (
    BAND_HZ,
    STANDSTILL_RAD_S,
    estimate_periodic,
    estimate_smoothed,
)
from identification.model_options import ModelOptions
from identification.torque_filter import without_torque_filter
from rid_daq.run_data import RunData


def estimate_runs(
    data: Sequence[RunData],
    options: ModelOptions | None = None,
    *,
    band_hz: float = BAND_HZ,
    standstill_rad_s: float = STANDSTILL_RAD_S,
) -> Estimate:
    """Estimate from runs of one robot, all periodic or all not.

    Raises
    ------
    ConfigError
        The runs are of different robots, or of both kinds.
    DataQualityError, EstimationError
        The data do not show the parameters.
    """
    robot = data[0].robot
    for other in data[1:]:
        if other.robot != robot:
            raise ConfigError(
                f"run {other.folder.run_id} is of robot {other.robot.name}, run"
                f" {data[0].folder.run_id} of {robot.name} (or of another description of it):"
                " identify them one by one"
            )
    kinds = {item.is_periodic for item in data}
    if len(kinds) > 1:
        names = ", ".join(item.folder.run_id for item in data if not item.is_periodic)
        raise ConfigError(
            f"some runs are periodic and some are not ({names}): identify them one by one"
        )
    run_ids = tuple(item.folder.run_id for item in data)
    cell_name = data[0].recording.cell_name
    if data[0].is_periodic:
        return estimate_periodic(
            robot,
            [average_periods(item.recording) for item in data],
            options=options,
            band_hz=band_hz,
            standstill_rad_s=standstill_rad_s,
            cell_name=cell_name,
            run_ids=run_ids,
        )
    return estimate_smoothed(
        robot,
        [smooth_nonperiodic(without_torque_filter(item.recording), band_hz) for item in data],
        options=options,
        standstill_rad_s=standstill_rad_s,
        cell_name=cell_name,
        run_ids=run_ids,
    )
