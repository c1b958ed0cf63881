"""Multisines on the joints' speeds: excited lines, and realisations as motions.

A line is a harmonic of the period. The default grid follows Pintelon and Schoukens (System
Identification: A Frequency Domain Approach, 2012). Only odd lines are excited, so that even
nonlinear distortion appears at other lines. Some odd lines stay empty, so that odd distortion
appears there. Each realisation has new phases.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from acquisition.motion.kinds.fourier import (
    MOST_HARMONICS,
    FourierJoint,
    FourierMotion,
    join_periodic_motions,
    require_duration,
)
from acquisition.motion.kinds.motion import Motion, Position, Seconds
from acquisition.motion.samples import MotionSamples
from config.arrays import FloatArray, IntArray
from config.cell.cell import LoopFrequency
from config.errors import ConfigError
from config.model import ConfigModel
from config.plausible import Plausible
from config.robot.robot import RobotDescription

Phasors = NDArray[np.complex128]

DETECTION_GROUP: Final = 4
CREST_ROUNDS: Final = 60
CLIPPING: Final = 0.85
LEAST_SLOW: Final = 0.75
DWELL_S: Final = 0.5


class MultisineJoint(ConfigModel):
    """Excitation of one joint: its speed is a multisine plus a slow sine.

    Attributes:
        joint: Name of the joint.
        offset: Position about which the joint moves [rad or m].
        velocity: RMS speed of the multisine [rad/s or m/s]; 0 for a joint that is not measured.
        slow_amplitude: Amplitude of the slow sine, which has the period `period_s` [rad or m].
    """

    joint: str
    offset: Position = 0.0
    velocity: Annotated[float, Field(ge=0.0), Plausible(1e-6, 60.0, "rad/s or m/s")]
    slow_amplitude: Annotated[float, Field(ge=0.0), Plausible(0.0, 50.0, "rad or m")] = 0.0


class MultisineMotion(Motion):
    """Multisines on the joints' speeds, to measure the response of the velocity loops.

    The excited lines are harmonics of the period. They are assigned to the joints in turn, so that
    each line belongs to one joint.

    Attributes:
        period_s: Duration of one period [s].
        lowest_hz: Lower end of the excited band [Hz].
        highest_hz: Upper end of the excited band [Hz].
        grid: Excited lines: `odd`, all odd harmonics of the period; `random_odd`, odd harmonics of
            which one in each group of four, chosen at random, stays empty and shows distortion;
            `full`, all harmonics.
        phases: Phases of the sines: `random`, drawn anew for each realisation; `schroeder`, always
            the same, for one realisation only. Both are then optimised for a low crest factor.
        seed: Random seed of the phases and of the empty lines.
        realisations: Number of multisines with different phases.
        periods: Number of periods of each realisation for the measurement.
        transient_periods: Number of periods of each realisation before the measurement, in which
            the transient decays.
        ramp_s: Time to speed up before each realisation, and to slow down after it [s].
        joints: Excitation of each joint of the robot, in any order.
    """

    kind: Literal["multisine"]
    period_s: Seconds
    lowest_hz: LoopFrequency
    highest_hz: LoopFrequency
    grid: Literal["odd", "random_odd", "full"] = "random_odd"
    phases: Literal["random", "schroeder"] = "random"
    seed: Annotated[int, Field(ge=0)] = 0
    realisations: Annotated[int, Field(ge=1, le=100)] = 4
    periods: Annotated[int, Field(ge=2, le=1000)] = 4
    transient_periods: Annotated[int, Field(ge=0, le=100)] = 1
    ramp_s: Seconds = 2.0
    joints: tuple[MultisineJoint, ...] = Field(min_length=1)

    @model_validator(mode="after")
    def _check_band(self) -> MultisineMotion:
        if self.lowest_hz >= self.highest_hz:
            raise ValueError(f"lowest_hz {self.lowest_hz} must be below highest_hz")
        if self.lowest_hz * self.period_s < 2.0 - 1e-9:
            raise ValueError(
                "lowest_hz must be at least 2 / period_s, since the first harmonic is the slow sine"
            )
        if self.phases == "schroeder" and self.realisations > 1:
            raise ValueError(
                f"schroeder phases are the same in all {self.realisations} realisations: set"
                " realisations to 1, or phases to random"
            )
        if not any(joint.velocity > 0.0 for joint in self.joints):
            raise ValueError(
                "no joint has a velocity, so that nothing is excited: give one"
                " joint a velocity above 0"
            )
        return self

    def describe(self) -> str:
        """Return a description of the motion in one sentence."""
        return (
            f"{self.realisations} multisines, {self.periods} periods of {self.period_s:g} s"
            f" each, {self.lowest_hz:g} to {self.highest_hz:g} Hz."
        )

    def next_command(self, run: Path) -> tuple[object, ...]:
        """Return the command that identifies the velocity loops."""
        return "loop", run

    def excited_lines(self, robot: RobotDescription) -> tuple[IntArray, ...]:
        """Return the harmonics of each joint's multisine, base to flange.

        Raises:
            ConfigError: The joints of motion and robot differ, `highest_hz` is too high a harmonic
                of the period, or the band has too few lines for one of the joints.
        """
        order = self._joint_order(robot)
        first = math.ceil(self.lowest_hz * self.period_s - 1e-9)
        last = math.floor(self.highest_hz * self.period_s + 1e-9)
        if last > MOST_HARMONICS:
            raise ConfigError(
                f"highest_hz {self.highest_hz:g} is harmonic {last} of period_s, but at most"
                f" {MOST_HARMONICS} are permitted: reduce highest_hz or shorten the period",
                code="RID-MOTION-BAND",
            )
        lines = np.arange(first, last + 1)
        if self.grid != "full":
            lines = lines[lines % 2 == 1]
        if self.grid == "random_odd":
            random = np.random.default_rng([self.seed, len(lines)])
            groups = [lines[k : k + DETECTION_GROUP] for k in range(0, len(lines), DETECTION_GROUP)]
            empty = [int(random.choice(g)) for g in groups if len(g) == DETECTION_GROUP]
            lines = lines[~np.isin(lines, empty)]
        measured = [k for k, joint in enumerate(order) if self.joints[joint].velocity > 0.0]
        shared = {k: lines[place :: len(measured)] for place, k in enumerate(measured)}
        for k, own in shared.items():
            if len(own) < 2:
                raise ConfigError(
                    f"the band from {self.lowest_hz:g} to {self.highest_hz:g} Hz has {len(own)}"
                    f" lines for joint {robot.joints[k].name!r}, but a multisine needs 2: widen"
                    " the band or lengthen the period",
                    code="RID-MOTION-BAND",
                )
        return tuple(shared.get(k, np.zeros(0, dtype=np.int64)) for k in range(len(order)))

    def speed_phasors(self, robot: RobotDescription) -> tuple[Phasors, ...]:
        """Return each joint's multisine: the phasors of its speed at its excited lines.

        The speed is the real part of the sum of phasor times exp(j k omega t).

        Returns:
            Tuple of complex ndarray, one per joint, shape (realisations, lines). rad/s or m/s.
        """
        lines, order = self.excited_lines(robot), self._joint_order(robot)
        found = []
        for number, (own, joint) in enumerate(zip(lines, order, strict=True)):
            size = self.joints[joint].velocity * math.sqrt(2.0 / max(len(own), 1))
            if self.phases == "schroeder":
                start = -np.pi * np.arange(len(own)) * np.arange(1, len(own) + 1) / max(len(own), 1)
                phases = np.tile(start, (self.realisations, 1))
            else:
                random = np.random.default_rng([self.seed, number, len(own)])
                phases = random.uniform(0.0, 2.0 * np.pi, (self.realisations, len(own)))
            found.append(
                np.array(
                    [size * low_crest_factor(own, np.exp(1j * row)) for row in phases]
                ).reshape(self.realisations, len(own))
            )
        return tuple(found)

    def realisation_motions(self, robot: RobotDescription) -> tuple[FourierMotion, ...]:
        """Return each realisation as a periodic motion, the integral of its speeds.

        Each realisation has its own slow sine, with `LEAST_SLOW` to 100 % of the amplitude.
        Therefore effects that depend on the position (tachometer ripple, cogging) differ between
        realisations and contribute to the variance. Otherwise they would be the same in all
        realisations and appear as a part of the response.

        Raises:
            ConfigError: See `excited_lines`.
        """
        lines, order = self.excited_lines(robot), self._joint_order(robot)
        phasors = self.speed_phasors(robot)
        highest = max(1, *(int(own[-1]) for own in lines if len(own)))
        omega = 2.0 * math.pi / self.period_s
        shares = np.random.default_rng([self.seed, len(order), 1]).uniform(
            LEAST_SLOW, 1.0, (self.realisations, len(order))
        )
        found = []
        for number in range(self.realisations):
            joints = []
            for k, joint in enumerate(order):
                settings = self.joints[joint]
                place = np.zeros(highest + 1, dtype=np.complex128)
                place[lines[k]] = phasors[k][number] / (1j * omega * lines[k])
                sine, cosine = -place.imag[1:], place.real[1:]
                sine[0] += shares[number, k] * settings.slow_amplitude
                joints.append(FourierJoint.from_attributes(settings, sine=sine, cosine=cosine))
            found.append(FourierMotion.from_attributes(self, kind="fourier", joints=tuple(joints)))
        return tuple(found)

    def _joint_order(self, robot: RobotDescription) -> list[int]:
        """Return, for each joint of the robot, the index of its excitation in `joints`."""
        given = [joint.joint for joint in self.joints]
        if sorted(given) != sorted(robot.joint_names):
            raise ConfigError(
                f"the motion moves joints {', '.join(given)}, but robot {robot.name!r} needs each"
                f" of {', '.join(robot.joint_names)} once (give velocity 0 for a joint that is"
                " not measured)",
                code="RID-MOTION-JOINTS",
            )
        return [given.index(name) for name in robot.joint_names]

    def crest_factors(self, robot: RobotDescription) -> tuple[float, ...]:
        """Return each joint's largest crest factor over the realisations, base to flange.

        It is 0 for a joint without lines.
        """
        found = []
        for own, phasors in zip(self.excited_lines(robot), self.speed_phasors(robot), strict=True):
            if not len(own):
                found.append(0.0)
                continue
            points = 16 * int(own[-1])
            bins = np.zeros((len(phasors), points // 2 + 1), dtype=np.complex128)
            bins[:, own] = phasors
            found.append(max(crest_factor(signal) for signal in np.fft.irfft(bins, points)))
        return tuple(found)

    def _samples(self, robot: RobotDescription, sample_period_s: float) -> MotionSamples:
        periods = self.transient_periods + self.periods
        require_duration(periods, self.period_s, self.ramp_s, parts=self.realisations)
        return join_periodic_motions(
            self.realisation_motions(robot), robot, sample_period_s, DWELL_S
        )


def low_crest_factor(lines: IntArray, phasors: Phasors) -> Phasors:
    """Return the phasors with new phases that lower the peak of the signal (clipping algorithm).

    Each round clips the signal and uses the phases of the clipped signal (Van der Ouderaa,
    Schoukens and Renneboog 1988); the best round is returned.
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
    """Return the peak divided by the RMS of a signal, shape (samples,)."""
    return float(np.abs(signal).max() / np.sqrt(np.mean(signal**2)))
