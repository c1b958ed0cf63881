"""Multisines on the joints' speeds: which lines they have, and their realisations as motions.

The grids are those of Pintelon and Schoukens (System Identification: A Frequency Domain Approach,
2012): odd lines, so that even distortion falls beside them, some odd lines empty, so that odd
distortion shows too, and phases drawn anew for each realisation.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from config.arrays import FloatArray, IntArray
from config.errors import ConfigError
from config.motion.motion import FourierJoint, FourierMotion, MultisineMotion
from config.robot.robot import RobotDescription

Phasors = NDArray[np.complex128]

DETECTION_GROUP = 4
CREST_ROUNDS = 60
CLIPPING = 0.85
LEAST_SLOW = 0.75


def excited_lines(motion: MultisineMotion, robot: RobotDescription) -> tuple[IntArray, ...]:
    """Return the harmonics that each joint's multisine has, base to flange.

    Raises
    ------
    ConfigError
        The motion's joints are not the robot's, or the band has no line for one of them.
    """
    order = _in_order(motion, robot)
    first = math.ceil(motion.lowest_hz * motion.period_s - 1e-9)
    last = math.floor(motion.highest_hz * motion.period_s + 1e-9)
    lines = np.arange(first, last + 1)
    if motion.grid != "full":
        lines = lines[lines % 2 == 1]
    if motion.grid == "random_odd":
        random = np.random.default_rng([motion.seed, len(lines)])
        groups = [lines[k : k + DETECTION_GROUP] for k in range(0, len(lines), DETECTION_GROUP)]
        empty = [int(random.choice(g)) for g in groups if len(g) == DETECTION_GROUP]
        lines = lines[~np.isin(lines, empty)]
    measured = [k for k, joint in enumerate(order) if motion.joints[joint].velocity > 0.0]
    shared = {k: lines[place :: len(measured)] for place, k in enumerate(measured)}
    for k, own in shared.items():
        if len(own) < 2:
            raise ConfigError(
                f"the band from {motion.lowest_hz:g} to {motion.highest_hz:g} Hz has {len(own)}"
                f" lines for joint {robot.joints[k].name!r}, a multisine needs 2: widen the band or"
                " lengthen the period"
            )
    return tuple(shared.get(k, np.zeros(0, dtype=np.int64)) for k in range(len(order)))


def speed_phasors(motion: MultisineMotion, robot: RobotDescription) -> tuple[Phasors, ...]:
    """Return each joint's multisine as phasors of its speed at its excited lines.

    The speed is the real part of the sum of phasor times exp(j k omega t).

    Returns
    -------
    tuple of ndarray of complex, one a joint, shape (realisations, lines)
        rad/s or m/s.
    """
    lines, order = excited_lines(motion, robot), _in_order(motion, robot)
    found = []
    for number, (own, joint) in enumerate(zip(lines, order, strict=True)):
        size = motion.joints[joint].velocity * math.sqrt(2.0 / max(len(own), 1))
        if motion.phases == "schroeder":
            start = -np.pi * np.arange(len(own)) * np.arange(1, len(own) + 1) / max(len(own), 1)
            phases = np.tile(start, (motion.realisations, 1))
        else:
            random = np.random.default_rng([motion.seed, number, len(own)])
            phases = random.uniform(0.0, 2.0 * np.pi, (motion.realisations, len(own)))
        found.append(
            np.array([size * low_crest_factor(own, np.exp(1j * row)) for row in phases]).reshape(
                motion.realisations, len(own)
            )
        )
    return tuple(found)


def low_crest_factor(lines: IntArray, phasors: Phasors) -> Phasors:
    """Return phasors of the same sizes whose phases make the peak small (clipping algorithm).

    The signal is clipped, the clipped one's phases are taken, and again (Van der Ouderaa, Schoukens
    and Renneboog 1988); the best of all rounds is kept.
    """
    if len(lines) < 2:
        return phasors
    size, best = np.abs(phasors), phasors
    points = 8 * int(lines[-1])
    lowest = math.inf
    for _ in range(CREST_ROUNDS):
        bins = np.zeros(points // 2 + 1, dtype=np.complex128)
        bins[lines] = phasors
        signal = np.fft.irfft(bins, points)
        peak = float(np.abs(signal).max())
        if peak < lowest:
            lowest, best = peak, phasors
        clipped = np.fft.rfft(np.clip(signal, -CLIPPING * peak, CLIPPING * peak))[lines]
        phasors = size * np.exp(1j * np.angle(clipped))
    return best


def crest_factor(signal: FloatArray) -> float:
    """Return peak over RMS of a signal, shape (samples,)."""
    return float(np.abs(signal).max() / np.sqrt(np.mean(signal**2)))


def realisation_motions(
    motion: MultisineMotion, robot: RobotDescription
) -> tuple[FourierMotion, ...]:
    """Return each realisation as a periodic motion: the integral of its speeds.

    Each has a slow sine of its own, from `LEAST_SLOW` of its amplitude to all of it, so that what
    depends on the position (tachometer ripple, cogging) differs between realisations and counts in
    the variance, instead of being the same in all and passing for the response.

    Raises
    ------
    ConfigError
        As `excited_lines`.
    """
    lines, order = excited_lines(motion, robot), _in_order(motion, robot)
    phasors = speed_phasors(motion, robot)
    highest = max(1, *(int(own[-1]) for own in lines if len(own)))
    omega = 2.0 * math.pi / motion.period_s
    shares = np.random.default_rng([motion.seed, len(order), 1]).uniform(
        LEAST_SLOW, 1.0, (motion.realisations, len(order))
    )
    found = []
    for number in range(motion.realisations):
        joints = []
        for k, joint in enumerate(order):
            settings = motion.joints[joint]
            place = np.zeros(highest + 1, dtype=np.complex128)
            place[lines[k]] = phasors[k][number] / (1j * omega * lines[k])
            sine, cosine = -place.imag[1:], place.real[1:]
            sine[0] += shares[number, k] * settings.slow_amplitude
            joints.append(
                FourierJoint(
                    joint=settings.joint,
                    offset=settings.offset,
                    sine=tuple(sine.tolist()),
                    cosine=tuple(cosine.tolist()),
                )
            )
        found.append(
            FourierMotion(
                kind="fourier",
                robot=motion.robot,
                period_s=motion.period_s,
                periods=motion.periods,
                transient_periods=motion.transient_periods,
                ramp_s=motion.ramp_s,
                joints=tuple(joints),
            )
        )
    return tuple(found)


def _in_order(motion: MultisineMotion, robot: RobotDescription) -> list[int]:
    """Return where each of the robot's joints is in the motion."""
    given = [joint.joint for joint in motion.joints]
    if sorted(given) != sorted(robot.joint_names):
        raise ConfigError(
            f"the motion moves joints {', '.join(given)}; robot {robot.name!r} needs each of"
            f" {', '.join(robot.joint_names)} once (velocity 0 where it is not measured)"
        )
    return [given.index(name) for name in robot.joint_names]
