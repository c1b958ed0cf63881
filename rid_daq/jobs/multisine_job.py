"""`rid-daq design --kind multisine`: the motion that measures velocity loops, and what is in it."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Any

import numpy as np

from acquisition.motion.kinds.multisine import MultisineMotion, crest_factor
from compensation.loops.multisine_motion import MultisineOptions, limit_use, multisine_motion
from config.errors import ConfigError
from config.formats.whole_file import write_whole
from config.load import LoadedCell, to_yaml
from identification.estimation.file import read_estimate
from rid_daq.report.sections.section import units
from rid_daq.terminal.console import Console


class Grid(StrEnum):
    """Which lines of its band a multisine has."""

    ODD = "odd"
    RANDOM_ODD = "random_odd"
    FULL = "full"


class Phases(StrEnum):
    """Where the phases start before the crest factor is made small."""

    RANDOM = "random"
    SCHROEDER = "schroeder"


def write_multisine(
    console: Console,
    loaded: LoadedCell,
    output: Path,
    *,
    band: str | None,
    grid: Grid,
    phases: Phases,
    realisations: int | None,
    slow: bool,
    period_s: float | None,
    periods: int | None,
    model: Path | None,
    seed: int,
) -> None:
    """Design a multisine within a cell's limits, write it, and say what is in it.

    Parameters
    ----------
    console, loaded, output
        Where to say it, the cell, and the motion file.
    band
        "LOW:HIGH" [Hz]; the cell's, if not given.
    grid, phases, slow, period_s, periods, seed
        As in `MultisineOptions`; four periods, if not given.
    realisations
        Four, or one with Schroeder's phases, if not given.
    model
        A model file, for the torque limits.

    Raises
    ------
    ConfigError
        The band is none, the model is of another robot, or the limits allow no such motion.
    """
    robot = loaded.robot
    estimate = None if model is None else read_estimate(model)
    if estimate is not None and estimate.robot.joint_names != robot.joint_names:
        raise ConfigError(
            f"{model}: is of robot {estimate.robot.name!r}, the cell's is {robot.name!r}: give a"
            " model of this robot"
        )
    options = MultisineOptions(
        band_hz=None if band is None else _band(band),
        period_s=period_s,
        periods=periods or 4,
        realisations=realisations or (1 if phases is Phases.SCHROEDER else 4),
        grid=grid.value,
        phases=phases.value,
        slow=slow,
        seed=seed,
    )
    motion = multisine_motion(robot, loaded.config, options, estimate)
    samples = motion.plan(robot, loaded.config.cycle_time_s)
    use = limit_use(samples, robot, estimate)
    lines, crests = motion.excited_lines(robot), _crest_factors(loaded, motion)
    comment = (
        f"For robot {robot.name}, verified within its limits at {loaded.config.cycle_time_ms} ms."
        f" {motion.describe()}"
    )
    write_whole(output, to_yaml(motion, comment).encode())
    axes: list[dict[str, Any]] = [
        {
            "joint": joint.name,
            "unit": units(joint)[0],
            "lines": len(own),
            "rms_velocity": settings.velocity,
            "crest_factor": crest,
            "slow_amplitude": settings.slow_amplitude,
            "velocity_percent": 100.0 * float(shares[0]),
            "acceleration_percent": 100.0 * float(shares[1]),
            "torque_percent": 100.0 * float(shares[2]) if shares[2] > 0.0 else None,
        }
        for joint, own, settings, crest, shares in zip(
            robot.joints, lines, motion.joints, crests, use, strict=True
        )
    ]
    console.document(
        {
            "motion": str(output),
            "kind": motion.kind,
            "duration_s": samples.duration_s,
            "band_hz": [motion.lowest_hz, motion.highest_hz],
            "axes": axes,
        }
    )
    console.say(f"{output}: {motion.describe()} {samples.duration_s:.0f} s in all.")
    console.table(
        (
            "axis",
            "lines",
            "RMS speed",
            "crest factor",
            "slow sine",
            "of limits: speed",
            "acceleration",
            "torque",
        ),
        [
            (
                axis["joint"],
                str(axis["lines"]),
                f"{axis['rms_velocity']:.3g} {axis['unit']}/s",
                f"{axis['crest_factor']:.2f}",
                f"{axis['slow_amplitude']:.3g} {axis['unit']}",
                f"{axis['velocity_percent']:.0f} %",
                f"{axis['acceleration_percent']:.0f} %",
                "not told" if axis["torque_percent"] is None else f"{axis['torque_percent']:.0f} %",
            )
            for axis in axes
        ],
    )
    if any(axis["torque_percent"] is None for axis in axes):
        console.say("Torque is told where the robot file has `cad`, or a --model is given.")
    if not slow:
        console.say("Without the slow sine friction sticks: inertia and margins come out wrong.")


def _band(words: str) -> tuple[float, float]:
    try:
        lowest, highest = (float(part) for part in words.split(":"))
    except ValueError:
        raise ConfigError(
            f"--band {words!r}: give the lowest and the highest frequency in Hz, as 0.5:20"
        ) from None
    return lowest, highest


def _crest_factors(loaded: LoadedCell, motion: MultisineMotion) -> list[float]:
    """Return each joint's largest crest factor over the realisations."""
    found = []
    lines = motion.excited_lines(loaded.robot)
    for own, phasors in zip(lines, motion.speed_phasors(loaded.robot), strict=True):
        points = 16 * int(own[-1])
        bins = np.zeros((len(phasors), points // 2 + 1), dtype=np.complex128)
        bins[:, own] = phasors
        found.append(max(crest_factor(signal) for signal in np.fft.irfft(bins, points)))
    return found
