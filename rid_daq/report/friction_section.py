"""Friction measured alone: the report's section, and the motion that measures it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.motion.kinds.constant_velocity import ConstantVelocityMotion
from acquisition.motion.kinds.reversed import ReversedMotion
from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.whole_file import write_whole
from config.load import LoadedCell, to_yaml
from config.robot.robot import RobotDescription
from dynamics.terms.friction import Friction
from identification.estimation.estimate import Estimate
from identification.friction.curve import FrictionCurve, friction_columns
from identification.friction.fits import CLEARLY_BETTER, FrictionFit
from rid_daq.report.sections import units
from rid_daq.terminal.console import Console

LINE_POINTS = 120


def friction_section(
    curves: Sequence[FrictionCurve],
    fits: Sequence[tuple[FrictionFit, ...]],
    robot: RobotDescription,
    estimate: Estimate | None = None,
) -> dict[str, Any]:
    """Return curves, models and what follows from them, joint by joint.

    Parameters
    ----------
    curves, fits
        The measured friction, and the models fitted to it, the best first.
    robot
        The robot.
    estimate
        A model to compare with.

    Raises
    ------
    ConfigError
        The model is of another robot, or has no friction.
    """
    if estimate is not None and estimate.robot.joint_names != robot.joint_names:
        raise ConfigError(
            f"the model is of robot {estimate.robot.name!r}, the runs are of {robot.name!r}"
        )
    joints = []
    for curve, own in zip(curves, fits, strict=True):
        j = robot.joint_names.index(curve.joint)
        unit, torque_unit = units(robot.joints[j])
        speed = np.linspace(0.0, 1.05 * float(curve.speed.max()), LINE_POINTS)
        speed[0] = 1e-3 * speed[-1]
        lines = {f"{fit.name} (best)" if fit is own[0] else fit.name: fit for fit in own[:2]}
        torque = {name: _odd(fit.torque, speed).tolist() for name, fit in lines.items()}
        sentence = _sentence(curve, own)
        if estimate is not None:
            torque["the model file"] = _of_estimate(estimate, j, speed).tolist()
            error = curve.odd - _of_estimate(estimate, j, curve.speed)
            sentence += (
                f" The model file is off by {np.sqrt(np.mean(error**2)):.3g} {torque_unit} (rms),"
                f" {100.0 * np.sqrt(np.mean(error**2) / np.mean(curve.odd**2)):.2g} %."
            )
        joints.append(
            {
                "joint": curve.joint,
                "unit": unit,
                "torque_unit": torque_unit,
                "sentence": sentence,
                "curve": _curve(curve),
                "fits": [_fit(fit) for fit in own],
                "lines": {"speed": speed.tolist(), "torque": torque},
            }
        )
    return {
        "sentence": "Half of what turning round changes: gravity and inertia are gone. The"
        " criterion is Akaike's, corrected for few values: small is good, and of models within"
        f" {CLEARLY_BETTER:g} of the smallest the simplest is taken.",
        "joints": joints,
    }


def _curve(curve: FrictionCurve) -> dict[str, Any]:
    ways = {"forward": curve.forward, "backward": curve.backward}
    return {
        "speed": curve.speed.tolist(),
        "odd": curve.odd.tolist(),
        "odd_std": curve.odd_sigma.tolist(),
        **{name: None if values is None else values.tolist() for name, values in ways.items()},
        "direction_std": None if curve.direction_sigma is None else curve.direction_sigma.tolist(),
    }


def _fit(fit: FrictionFit) -> dict[str, Any]:
    return {
        "name": fit.name,
        "terms": list(fit.terms),
        "rms": fit.rms_nm,
        "misfit": fit.misfit,
        "criterion": fit.criterion,
        "parameters": [
            {"name": name, "value": float(value), "std": float(std), "unit": unit}
            for name, value, std, unit in zip(
                fit.parameter_names, fit.values, fit.sigmas, fit.parameter_units, strict=True
            )
        ],
    }


def _sentence(curve: FrictionCurve, fits: tuple[FrictionFit, ...]) -> str:
    """Say which model is best, and what to write into the robot file."""
    if not fits:
        return f"{curve.joint}: too few speeds to fit a model; run more of them."
    best = fits[0]
    smallest = min(fit.criterion for fit in fits)
    close = [fit.name for fit in fits[1:] if fit.criterion - smallest < CLEARLY_BETTER]
    text = f"{curve.joint}: {best.name} fits best"
    text += f" ({', '.join(close)} not clearly worse)" if close else ""
    speed = next(
        (v for n, v in zip(best.parameter_names, best.values, strict=True) if n[:3] == "vs_"), None
    )
    start = "" if speed is None else f", stribeck_velocity: {speed:.3g}"
    return f"{text}; in the robot file: friction: [{', '.join(best.terms)}]{start}."


def _odd(torque: Any, speed: FloatArray) -> FloatArray:
    return np.asarray(0.5 * (torque(speed) - torque(-speed)))


def _of_estimate(estimate: Estimate, joint: int, speed: FloatArray) -> FloatArray:
    """Return the friction of an estimated model that changes its sign with the speed."""
    groups = estimate.model.parameter_groups
    if not any(isinstance(term, Friction) for term in estimate.model.terms):
        raise ConfigError("the model file has no friction to compare with")
    values = estimate.standard_values[groups["friction"]]
    return _odd(lambda v: friction_columns(estimate.model, joint, v) @ values, speed)


def write_friction_motion(
    console: Console,
    loaded: LoadedCell,
    motion: ConstantVelocityMotion | ReversedMotion,
    output: Path,
) -> None:
    """Verify a motion that measures friction, write it, and say what it does."""
    samples = motion.plan(loaded.robot, loaded.config.cycle_time_s)
    comment = (
        f"For robot {loaded.robot.name}, verified within its limits at"
        f" {loaded.config.cycle_time_ms} ms. {motion.describe()}"
    )
    write_whole(output, to_yaml(motion, comment).encode())
    console.document({"motion": str(output), "kind": motion.kind, "duration_s": samples.duration_s})
    console.say(f"{output}: {motion.describe()} {samples.duration_s:.0f} s in all.")


def say_speeds(console: Console, motion: ConstantVelocityMotion) -> None:
    """Say at which speeds, and where, each joint is run."""
    console.table(
        ("axis", "from", "to", "speeds"),
        [
            (
                spec.joint,
                f"{spec.low:.3f}",
                f"{spec.high:.3f}",
                ", ".join(f"{speed:g}" for speed in spec.speeds),
            )
            for spec in motion.joints
        ],
    )
