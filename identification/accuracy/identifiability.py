"""Parameters that the data hardly determine, and the motions that would determine them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.formats.interval import plus_minus
from config.robot.robot import Joint, RobotDescription
from dynamics.model.robot_model import RobotModel
from dynamics.terms.conditions import Conditions
from identification.consistency.metric import jackknife_metric
from identification.estimation.estimate import Estimate
from identification.model.torque_columns import torque_columns
from identification.regression.intervals import FEW_CLUSTERS, widening

SAMPLES: Final = 80
LIMIT_SHARE: Final = 0.8
SMALLEST_GAIN: Final = 1.5
NOISELESS_SHARE: Final = 5e-4
"""Ratio of residual to torque (RMS) below which the torque counts as free of noise."""


@dataclass(frozen=True)
class WeakParameter:
    """A base parameter that cannot be distinguished from zero.

    Attributes:
        expression, unit: The parameter.
        value, sigma: Its estimate and cluster-robust standard deviation.
        motion: The motion that would determine it best, in words; empty if no tried motion divides
            the standard deviation by at least `SMALLEST_GAIN`.
        gain: Factor by which the standard deviation would fall if this motion were added.
    """

    expression: str
    unit: str
    value: float
    sigma: float
    motion: str
    gain: float

    @property
    def sentence(self) -> str:
        """One sentence: the parameter, its interval, and the motion that would determine it."""
        interval = plus_minus(self.value, 2.0 * self.sigma, self.unit)
        text = f"{self.expression} = {interval} is poorly determined"
        if not self.motion:
            return f"{text}; no motion of one or two joints would determine it much better."
        return (
            f"{text}; a second run of the same length, {self.motion}, would make the interval"
            f" {self.gain:.1f} times smaller."
        )


def weak_parameters(estimate: Estimate, most: int = 5) -> tuple[WeakParameter, ...]:
    """Return the rigid-body parameters that may be zero, the least certain first.

    They are less than two standard deviations from zero. For each parameter, the motions of
    `joint_motions` are tried. Each motion counts as one more run of the same length, with residuals
    of the same spectrum: its information is added to that of the estimate.

    Args:
        most: Largest number of parameters returned.
    """
    sigma = estimate.sigma
    weak = [
        i
        for i in np.argsort(-sigma / np.maximum(np.abs(estimate.values), 1e-300))
        if estimate.base.rigid_body[i] and abs(estimate.values[i]) < 2.0 * sigma[i]
    ][:most]
    if not weak:
        return ()
    _, factor = jackknife_metric(estimate)
    whitening = np.linalg.inv(sigma[:, np.newaxis] * factor)
    information = whitening.T @ whitening
    noise = np.maximum(estimate.residual_nm, 1e-6 * estimate.residual_nm.max())
    # Coloured residuals contain fewer independent values than rows.
    white = np.diagonal(estimate.covariance_residual)
    clustered = np.diagonal(estimate.covariance_jackknife)
    colour = min(1.0, float(np.median(white / clustered)))
    tried: list[tuple[str, FloatArray]] = []
    still = {estimate.robot.joint_names.index(s.joint): s.positions[0] for s in estimate.still}
    for words, motion in joint_motions(estimate.robot):
        if np.any(
            motion[1][:, list(still)] != 0.0
        ):  # a motion of a joint that was at rest would change the base parameters
            continue
        motion[0][:, list(still)] = list(still.values())
        tried.append((words, _information(estimate, motion, noise)))
    found = []
    for i in weak:
        best, gain = "", 1.0
        for words, more in tried:
            weight = colour * estimate.equations / len(more)
            covariance = np.linalg.inv(information + weight * (more.T @ more))
            better = float(sigma[i] / np.sqrt(covariance[i, i]))
            if better > gain * 1.05:  # simple motions come first; a later motion must be 5 % better
                best, gain = words, better
        found.append(
            WeakParameter(
                expression=estimate.base.expressions[i],
                unit=estimate.base.units[i],
                value=float(estimate.values[i]),
                sigma=float(sigma[i]),
                motion=best if gain >= SMALLEST_GAIN else "",
                gain=gain,
            )
        )
    return tuple(found)


_OF_TERMS: Final = {
    "vs": "stribeck",
    "cl": "load",
    "eta": "efficiency",
    "dp": "presliding",
    "sp": "presliding_share",
}


def few_cluster_findings(estimate: Estimate) -> tuple[str, ...]:
    """Return a warning if the intervals come from few clusters of the recording."""
    clusters = estimate.clusters
    if clusters is None or clusters >= FEW_CLUSTERS:
        return ()
    parts = "bins of the spectrum" if estimate.method == "periodic" else "seconds of motion"
    wider = widening(clusters)
    widened = f" They were made {wider:.2g} times wider to allow for this." if wider >= 1.05 else ""
    return (
        f"The intervals are inaccurate, because they are computed from only {clusters} {parts}."
        f"{widened} Record longer ({FEW_CLUSTERS} are enough).",
    )


def noiseless_findings(estimate: Estimate) -> tuple[str, ...]:
    """Return a warning if the residual contains no torque noise.

    The residual then consists of encoder quantisation, which is not independent from second to
    second, so that intervals of rigid-body parameters are too narrow.
    """
    if estimate.method != "smoothed" or estimate.torque_nm is None:
        return ()
    share = estimate.residual_nm / np.maximum(estimate.torque_nm, 1e-300)
    names = [
        name
        for name, own, torque in zip(
            estimate.robot.joint_names, share, estimate.torque_nm, strict=True
        )
        if own < NOISELESS_SHARE and torque > 0.0
    ]
    if not names:
        return ()
    return (
        f"The residual of {', '.join(names)} is less than {100.0 * NOISELESS_SHARE:g} % of the"
        " torque, so the torque contains no noise. The residual comes from the resolution of the"
        " position encoders; it is not independent, and the intervals can be too narrow."
        " Recorded torques of a real robot contain noise: check whether these torques were"
        " computed.",
    )


def still_findings(estimate: Estimate) -> tuple[str, ...]:
    """Report the joints that no run moved, and their parameters, which are not identified."""
    return tuple(
        f"{each.words} was at rest. Its own friction and inertia are not identified and are left"
        f" out ({', '.join(_of_joint(estimate, each.joint)) or 'none in the model'}). The other"
        f" parameters are valid only with {each.joint} at this position. To identify the"
        f" missing parameters, record a motion that moves {each.joint} and identify both runs"
        " together."
        for each in estimate.still
    )


def _of_joint(estimate: Estimate, joint: str) -> list[str]:
    """Return the friction and motor parameters of a joint that are not identified."""
    number = estimate.robot.joint_names.index(joint) + 1
    motor = (f"Im{number}", f"Ia{number}")
    return [name for name in estimate.base.unseen if name.endswith(f"_{joint}") or name in motor]


def unseen_findings(estimate: Estimate) -> tuple[str, ...]:
    """Report nonlinear parameters that the data do not determine."""
    model = estimate.model
    found = []
    for name, unit, value, (low, high) in zip(
        model.nonlinear_names,
        model.nonlinear_units,
        model.nonlinear_values,
        model.nonlinear_bounds,
        strict=True,
    ):
        if name not in estimate.nonlinear_unseen:
            continue
        symbol, joint = name.split("_", 1)
        of_unit = "" if unit == "1" else f" {unit}"
        is_rigid = symbol == "sp" and value < 0.5
        term = _OF_TERMS["dp" if is_rigid else symbol]
        why = (
            f"is at a bound of its range ({low:.3g} to {high:.3g}): the runs do not determine it,"
            " and its interval is meaningless"
            if name in model.nonlinear_at_bound
            else f"is not determined by the data: its interval is as wide as its range ({low:.3g}"
            f" to {high:.3g}), and its value depends on the start of the fit"
        )
        found.append(
            f"{name} = {value:.3g}{of_unit} {why}. Leave `{term}` of {joint} out of the model."
        )
    return tuple(found)


def _information(
    estimate: Estimate, motion: tuple[FloatArray, FloatArray, FloatArray], noise: FloatArray
) -> FloatArray:
    """Return a motion's regressor rows, divided by the joints' noise, shape (samples n, b)."""
    model: RobotModel = estimate.model
    warm = Conditions(temperature_k=np.full(model.chain.n, 300.0))
    columns = torque_columns(model, estimate.base, motion, warm)
    for each in estimate.still:  # the torque of a joint at rest contains no information
        columns[:, model.joint_names.index(each.joint)] = 0.0
    return np.asarray((columns / noise[:, np.newaxis]).reshape(-1, len(estimate.base)))


def joint_motions(
    robot: RobotDescription,
) -> list[tuple[str, tuple[FloatArray, FloatArray, FloatArray]]]:
    """Return motions of one joint and of two joints, each as a text and as q, v, a.

    For each set of joints there is a slow motion through most of the range and a fast one.
    """
    names = robot.joint_names
    motions = []
    for moved in (*((j,) for j in range(len(names))), *combinations(range(len(names)), 2)):
        joints = " and ".join(names[j] for j in moved)
        joined = " together" if len(moved) > 1 else ""
        for fast, how in ((False, "through their range"), (True, "with large accelerations")):
            how = how if joined else how.replace("their", "its")
            motions.append((f"moving {joints}{joined} {how}", _sine_motion(robot, moved, fast)))
    return motions


def _sine_motion(
    robot: RobotDescription, moved: tuple[int, ...], fast: bool
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return q, v, a of sines of some joints within their limits; the others are at mid-range."""
    q, v, a = np.zeros((3, SAMPLES, len(robot.joints)))
    phase = 2.0 * np.pi * np.arange(SAMPLES) / SAMPLES
    for j, joint in enumerate(robot.joints):
        limits = joint.limits
        q[:, j] = (limits.position_max + limits.position_min) / 2.0
        if j not in moved:
            continue
        turns = 1 + moved.index(j)  # each joint has another frequency
        amplitude, omega = _amplitude(joint, fast)
        angle = turns * phase + 0.7 * j
        q[:, j] += amplitude * np.sin(angle)
        v[:, j] = amplitude * omega * np.cos(angle)
        a[:, j] = -amplitude * omega**2 * np.sin(angle)
    return q, v, a


def _amplitude(joint: Joint, fast: bool) -> tuple[float, float]:
    """Return amplitude and angular frequency of a sine within the joint's limits."""
    limits = joint.limits
    reach = LIMIT_SHARE * min((limits.position_max - limits.position_min) / 2.0, np.pi)
    if not fast:
        return reach, LIMIT_SHARE * min(limits.velocity, 0.5) / reach
    omega = LIMIT_SHARE * limits.acceleration / limits.velocity
    return min(reach, LIMIT_SHARE * limits.velocity / omega), omega
