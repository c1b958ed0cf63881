"""Effect of coarsely rounded positions and torques on an estimate: wider intervals."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from acquisition.recording.recording import Recording
from config.robot.robot import RobotDescription
from identification.accuracy.rounded_positions import RoundedPositions
from identification.accuracy.rounded_torques import RoundedTorques
from identification.estimation.estimate import Estimate
from identification.validation.model_choice import ModelChoice
from rid_daq.operations.estimation.run_estimation import EstimationJob, estimate_runs
from rid_daq.runs.run_data import RunData


def find_rounded_positions(data: Sequence[RunData], band_hz: float) -> RoundedPositions | None:
    """Return the rounding of imported positions, with the band that it allows.

    The result is None if no step is large enough for an effect.

    Args:
        data: The runs.
        band_hz: Requested upper limit of the band [Hz].
    """
    n = len(data[0].robot.joints)
    reports = [item.import_report for item in data]
    steps = [() if report is None else report.rounded_step for report in reports]
    if not any(steps):
        return None
    return RoundedPositions.of(
        data[0].robot,
        [item.recording for item in data],
        [own or (None,) * n for own in steps],
        band_hz,
    )


def add_rounding_uncertainty(
    estimate: Estimate,
    rounded: RoundedPositions,
    data: Sequence[RunData],
    how: EstimationJob,
    robot: RobotDescription | None,
    chosen: ModelChoice | None,
) -> tuple[Estimate, RoundedPositions]:
    """Return an estimate whose intervals contain the effect of rounded positions, and this effect.

    The estimate is repeated with positions that were rounded once more.

    Args:
        estimate: Result of `estimate_runs` with `data`, `how`, `robot` and `chosen`.
        rounded: Result of `find_rounded_positions`.
    """
    again = _estimate_again(data, how.with_rotors_of(estimate), robot, chosen)
    return rounded.widen(estimate, [item.recording for item in data], again)


def add_torque_rounding_uncertainty(
    estimate: Estimate,
    data: Sequence[RunData],
    how: EstimationJob,
    robot: RobotDescription | None,
    chosen: ModelChoice | None,
) -> tuple[Estimate, list[str]]:
    """Return an estimate whose intervals contain the effect of rounded torques, and findings.

    The estimate is repeated with torques that were rounded once more, if imported torques have so
    few digits that this has an effect.

    Args:
        estimate: Result of `estimate_runs` with `data`, `how`, `robot` and `chosen`.
    """
    if how.options.model.kind == "external" or any(item.import_report is None for item in data):
        return estimate, []
    recordings = [item.recording for item in data]
    rounded = RoundedTorques.of(data[0].robot, recordings, how.options.band_hz)
    if rounded is None:
        return estimate, []
    again = _estimate_again(data, how.with_rotors_of(estimate), robot, chosen)
    estimate, rounded = rounded.widen(estimate, recordings, again)
    return estimate, [rounded.sentence] if rounded.is_material else []


def _estimate_again(
    data: Sequence[RunData],
    how: EstimationJob,
    robot: RobotDescription | None,
    chosen: ModelChoice | None,
) -> Callable[[Sequence[Recording]], Estimate]:
    """Return a function that repeats `estimate_runs` for other recordings of the same runs."""

    def estimate_again(recordings: Sequence[Recording]) -> Estimate:
        other = [
            RunData.of(item.folder, recording, item.robot, item.import_report)
            for item, recording in zip(data, recordings, strict=True)
        ]
        return estimate_runs(other, how, robot=robot, chosen=chosen).estimate

    return estimate_again
