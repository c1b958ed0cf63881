"""The sections of `result.json`, from the objects that the packages below compute."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.processing.periods import PeriodAverage
from acquisition.recording.recording import Recording
from acquisition.session.timing import CycleStatistics
from config.cell.cell import CellConfig
from config.robot.robot import Joint, RobotDescription
from identification.estimation.estimate import Estimate
from identification.validation.friction_selection import Comparison

CURVE_POINTS = 1500


def units(joint: Joint) -> tuple[str, str]:
    """Return the units of a joint's position and of its torque."""
    return ("rad", "N m") if joint.type == "revolute" else ("m", "N")


def cell_section(cell: CellConfig) -> dict[str, Any]:
    """Return what the report's head says of the cell."""
    return {
        "name": cell.name,
        "simulated": cell.simulated,
        "cycle_time_ms": cell.cycle_time_ms,
        "bus": f"{cell.can.interface}:{cell.can.channel}",
    }


def run_section(
    role: str,
    sentence: str,
    recording: Recording,
    robot: RobotDescription,
    stop: str | None = None,
) -> dict[str, Any]:
    """Return what was run: extremes of every axis, lost rows, and why it stopped early.

    Parameters
    ----------
    role
        What the run was for.
    sentence
        What was asked for.
    recording
        What was measured.
    robot
        The robot, for limits and units.
    stop
        Why the motion was stopped, where it was.
    """
    invalid = int(np.count_nonzero(~recording.valid))
    lost = "no row is missing" if invalid == 0 else f"{invalid} rows have no valid answer"
    duration_s = float(recording.time_s[-1] - recording.time_s[0]) if len(recording) else 0.0
    return {
        "role": role,
        "sentence": f"{sentence} {len(recording)} rows in {duration_s:.1f} s; {lost}.",
        "stop": stop,
        "rows": len(recording),
        "invalid_rows": invalid,
        "duration_s": duration_s,
        "axes": _extremes(recording, robot),
        "bad_rows": [],
    }


def _extremes(recording: Recording, robot: RobotDescription) -> list[dict[str, Any]]:
    good = recording.valid
    position, torque, time_s = (
        x[good] for x in (recording.position, recording.torque_nm, recording.time_s)
    )
    if len(position) < 2:
        return []
    speed = np.abs(np.diff(position, axis=0) / np.diff(time_s)[:, np.newaxis]).max(axis=0)
    following: list[float | None] = [None] * len(robot.joints)
    if recording.target_position is not None:
        moving = good & (recording.phase != Phase.APPROACH)
        error = np.abs(recording.target_position - recording.position)[moving]
        following = [float(worst) for worst in error.max(axis=0, initial=0.0)]
    axes = []
    for column, joint in enumerate(robot.joints):
        unit, torque_unit = units(joint)
        largest = float(np.abs(torque[:, column]).max())
        axes.append(
            {
                "joint": joint.name,
                "unit": unit,
                "torque_unit": torque_unit,
                "position_min": float(position[:, column].min()),
                "position_max": float(position[:, column].max()),
                "max_velocity": float(speed[column]),
                "max_torque": largest,
                "max_torque_percent": 100.0 * largest / joint.limits.torque,
                "max_following_error": following[column],
            }
        )
    return axes


def average_section(average: PeriodAverage, robot: RobotDescription) -> dict[str, Any]:
    """Return how many periods were averaged, which were rejected and why, and the noise."""
    recorded = average.periods_kept + len(average.rejected)
    axes = []
    for column, joint in enumerate(robot.joints):
        unit, torque_unit = units(joint)
        axes.append(
            {
                "joint": joint.name,
                "unit": unit,
                "torque_unit": torque_unit,
                "torque_noise": float(np.sqrt(average.torque_variance[column])),
                "position_noise": float(np.sqrt(average.position_variance[column])),
            }
        )
    return {
        "sentence": f"{average.periods_kept} of {recorded} periods averaged,"
        f" {average.samples_per_period} samples each; {average.missing_samples} single rows"
        f" without a valid answer were left out of the mean.{_plate_sentence(average)}",
        "periods_kept": average.periods_kept,
        "samples_per_period": average.samples_per_period,
        "missing_samples": average.missing_samples,
        "rejected": [{"index": p.index, "reason": p.reason} for p in average.rejected],
        "axes": axes,
    }


def _plate_sentence(average: PeriodAverage) -> str:
    """Return what became of the force plate's channels, where there were any."""
    plate = average.reaction
    if plate is None:
        return ""
    drift = 1e3 * float(np.abs(plate.drift_n_s).max())
    words = f" The force plate's channels drifted by up to {drift:.3g} mN/s, which was removed"
    if plate.left_out:
        words += f"; {', '.join(plate.left_out)} left out for overload, loss or drift"
    return words + "."


def estimate_section(
    estimate: Estimate, truth: Sequence[float] | np.ndarray[Any, Any] | None = None
) -> dict[str, Any]:
    """Return the parameters with their intervals.

    Parameters
    ----------
    estimate
        The estimate.
    truth
        The true base parameters, shape (b,), where the robot is simulated.
    """
    noise = estimate.sigma_noise
    parameters: list[dict[str, Any]] = []
    for i, (name, words, unit) in enumerate(
        zip(estimate.base.names, estimate.base.expressions, estimate.base.units, strict=True)
    ):
        entry: dict[str, Any] = {
            "name": name,
            "words": words,
            "unit": unit,
            "value": float(estimate.values[i]),
            "std": float(estimate.sigma[i]),
            "std_noise": None if noise is None else float(noise[i]),
            "std_residual": float(estimate.sigma_residual[i]),
        }
        if truth is not None:
            deviation = (float(estimate.values[i]) - float(truth[i])) / float(estimate.sigma[i])
            entry["truth"] = float(truth[i])
            entry["deviation_sigmas"] = deviation
            entry["inside_two_sigma"] = abs(deviation) <= 2.0
        parameters.append(entry)
    model = estimate.model
    for name, unit, value, sigma in zip(
        model.nonlinear_names,
        model.nonlinear_units,
        model.nonlinear_values,
        estimate.nonlinear_sigma,
        strict=True,
    ):
        parameters.append(
            {
                "name": name,
                "words": name,
                "unit": unit,
                "value": float(value),
                "std": float(sigma),
                "std_noise": None,
                "std_residual": None,
            }
        )
    return {
        "sentence": _estimate_sentence(estimate),
        "method": estimate.method,
        "condition_number": float(estimate.condition_number),
        "equations": estimate.equations,
        "band_hz": estimate.band_hz,
        "periods": estimate.periods,
        "weighting": estimate.weighting,
        "unseen": list(estimate.base.unseen),
        "has_truth": truth is not None,
        "parameters": parameters,
        "axes": [
            {
                "joint": joint.name,
                "unit": units(joint)[1],
                "residual": float(estimate.residual_nm[i]),
                "noise": None if estimate.noise_nm is None else float(estimate.noise_nm[i]),
                "left_out_fraction": float(estimate.left_out_fraction[i]),
            }
            for i, joint in enumerate(estimate.robot.joints)
        ],
    }


def comparison_section(comparison: Comparison) -> dict[str, Any]:
    """Return how candidates of friction terms compare, and what was chosen."""
    return {
        "joints": list(comparison.joint_names),
        "chosen": {
            name: list(terms)
            for name, terms in zip(comparison.joint_names, comparison.chosen, strict=True)
        },
        "trials": [
            {
                "terms": list(trial.terms),
                "error": [float(error) for error in trial.error_nm],
                "parameters": trial.parameters,
                "aic": trial.aic,
                "bic": trial.bic,
            }
            for trial in (*comparison.trials, comparison.together)
        ],
    }


_OUTPUTS = {
    "internal": "",
    "external": ", of the reaction on the force plate alone",
    "combined": ", of the torques and the reaction on the force plate",
}


def _estimate_sentence(estimate: Estimate) -> str:
    left_out = ", ".join(f"{100.0 * x:.0f}" for x in estimate.left_out_fraction)
    way = {
        "ml": "Least squares weighted by noise (maximum likelihood)",
        "ls": "Least squares without weights",
        "huber": "Robust least squares (Huber) weighted by noise",
    }[estimate.weighting]
    how = (
        f"{way} by QR on the bins up to {estimate.band_hz:g} Hz of {estimate.periods} averaged"
        " periods"
        if estimate.method == "periodic"
        else f"{way} by QR in the time domain; the recording is not periodic, so it is low-passed"
        f" without phase shift at {estimate.band_hz:g} Hz instead of averaged"
    )
    return (
        f"{how}{_OUTPUTS[estimate.options.kind]}: {len(estimate.base)} base parameters from"
        f" {estimate.equations} equations,"
        f" condition number {estimate.condition_number:.3g}. Below"
        f" {estimate.standstill_rad_s:g} rad/s friction is not sign(velocity); such samples are not"
        f" used for it ({left_out} % of each axis). Intervals are by leaving out one part of the"
        " data after the other (cluster jackknife), so that they hold for model error as well; what"
        " measured noise or white residuals alone would say stands beside them."
    )


def truth_case(title: str, estimate: dict[str, Any]) -> dict[str, Any]:
    """Return how an estimate section with truth compares with it."""
    parameters = estimate["parameters"]
    inside = sum(parameter["inside_two_sigma"] for parameter in parameters)
    return {
        "title": title,
        "sentence": f"{title}: {inside} of {len(parameters)} true values lie inside the two-sigma"
        f" interval ({100.0 * inside / len(parameters):.0f} %).",
        "inside": inside,
        "of": len(parameters),
        "deviation_sigmas": [parameter["deviation_sigmas"] for parameter in parameters],
    }


def thinned(rows: int) -> slice:
    """Return which of so many rows a curve of the report shows."""
    return slice(0, rows, max(1, -(-rows // CURVE_POINTS)))


def rounded(values: np.ndarray[Any, Any], digits: int = 5) -> list[float]:
    """Return values for a drawing: so many significant digits."""
    return [float(f"{value:.{digits}g}") for value in values]


def loop_sentence(statistics: CycleStatistics) -> str:
    """Say how well the cyclic task kept its time."""
    missed = sum(statistics.missed_frames)
    if statistics.cycles and statistics.lateness_max_s == 0.0:
        return (
            f"{statistics.cycles} cycles, {statistics.overruns} overruns, {missed} missed answers,"
            " in simulated time (lock-step): how late cycles begin on this computer is not told."
        )
    return (
        f"{statistics.cycles} cycles, {statistics.overruns} overruns, {missed} missed answers;"
        f" cycles began {_microseconds(statistics.lateness_p50_s)} late in the median,"
        f" {_microseconds(statistics.lateness_p99_s)} at 99 %,"
        f" {_microseconds(statistics.lateness_max_s)} at most; the drives had all answered"
        f" {_microseconds(statistics.exchange_p99_s)} after SYNC (99 %)."
    )


def loop_section(role: str, statistics: CycleStatistics) -> dict[str, Any]:
    """Return the loop's timing, with the histogram of how late its cycles began."""
    return {
        "role": role,
        "sentence": loop_sentence(statistics),
        "edges_us": [1e6 * edge for edge in statistics.lateness_edges_s],
        "counts": list(statistics.lateness_counts),
        **statistics.to_dict(),
    }


def _microseconds(seconds: float) -> str:
    return f"{1e6 * seconds:.0f} µs"
