"""`LinkSideBins`: mean periods of instruments on the link side of the gears.

A tracker measures a point on the last link, and encoders on the link side measure the positions of
joints. Their unknowns are fitted together with the gears: clock and frame of an instrument, the
measured point, the geometry of the arm, and the encoders' zeros. The constant part of a mean period
depends on frame and zeros; it is not used.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import ClassVar, Final

import numpy as np

from acquisition.motion.samples import Phase
from acquisition.recording.recording import Recording
from acquisition.signals.bins import Bins, to_bins
from acquisition.tracker.alignment import align
from acquisition.tracker.clock_offsets import InstrumentClock, is_covered
from acquisition.tracker.folded_period import FoldedPeriod, fold_period
from acquisition.tracker.link_file import LinkPositions
from acquisition.tracker.tracker_file import TrackedPoint
from config.arrays import FloatArray
from config.errors import DataQualityError
from dynamics.geometry.kinematics import Chain, forward
from identification.kinematics.arm import PlacedArm
from identification.kinematics.parameters import (
    KinematicParameter,
    choose_identifiable,
    geometry_candidates,
)

LARGEST_LOSS: Final = 2e-5
"""Largest accepted RMS of the motion at harmonics that an instrument does not show [m or rad]."""
GEOMETRY_SIGMA: Final = 0.01
"""Standard deviation of the prior of each geometric parameter [m or rad]."""
DELAY_SIGMA_S: Final = 0.01
TURNS: Final = tuple(
    KinematicParameter("frame", 3 + k, 0, f"base rotation {axis}", "rad")
    for k, axis in enumerate("xyz")
)


@dataclass(frozen=True, eq=False)
class LinkSideBins(ABC):
    """Mean period that an instrument measured on the link side of the gears.

    Attributes:
        name: Kind of the instrument, as in `Channel`.
        frame: Parameters of the frame of the instrument.
        bins: Shape (H, m). Bins 1 to H of the measured values [m or rad].
        sigma: Shape (m,). RMS of the noise of a bin's real part.
        delay_s: Delay of the measured values behind the run.
    """

    name: ClassVar[str]
    frame: ClassVar[tuple[KinematicParameter, ...]] = ()
    bins: Bins
    sigma: FloatArray
    delay_s: float = field(default=0.0, kw_only=True)

    @abstractmethod
    def values(self, q: FloatArray) -> FloatArray:
        """Return the values without delay, (rows, m), for link positions (rows, n)."""

    @abstractmethod
    def value_slopes(self, q: FloatArray, parameters: Sequence[KinematicParameter]) -> FloatArray:
        """Return the derivatives of the values by parameters, (rows, m, parameters)."""

    @abstractmethod
    def moved(self, geometry: Sequence[KinematicParameter], step: FloatArray) -> LinkSideBins:
        """Return the measurement with `step` added to its unknowns, in the order of `slopes`."""

    def predicted(self, q: FloatArray, period_s: float) -> Bins:
        """Return the bins 1 to H for a period of link positions, (rows, n)."""
        return _late(self._bins(self.values(q)), self.delay_s, period_s)

    def slopes(
        self, q: FloatArray, period_s: float, geometry: Sequence[KinematicParameter]
    ) -> Bins:
        """Return the derivatives with respect to geometry, `frame` and delay, (H, m, any)."""
        by_parameters = self._bins(self.value_slopes(q, (*geometry, *self.frame)))
        by_delay = -1j * _omega(len(self.bins), period_s)[:, np.newaxis]
        own = (by_delay * self._bins(self.values(q)))[..., np.newaxis]
        return np.concatenate([by_parameters, own], axis=2)

    def _bins(self, values: FloatArray) -> Bins:
        return to_bins(values, len(self.bins))[1:]


@dataclass(frozen=True, eq=False)
class TrackedBins(LinkSideBins):
    """Mean period of a point on the last link, in the frame of the first alignment [m].

    Attributes:
        arm: Geometry of the arm and its place in this frame.
    """

    name = "tracker"
    frame = TURNS
    arm: PlacedArm

    def values(self, q: FloatArray) -> FloatArray:
        """Return the points, (rows, 3)."""
        return self.arm.points(q, np.zeros(len(q)))

    def value_slopes(self, q: FloatArray, parameters: Sequence[KinematicParameter]) -> FloatArray:
        """Return the derivatives of the points by parameters, (rows, 3, parameters)."""
        return self.arm.slopes(q, np.zeros(len(q)), parameters)

    def moved(self, geometry: Sequence[KinematicParameter], step: FloatArray) -> TrackedBins:
        """Return the same measurement with another geometry, frame and delay."""
        arm = self.arm.moved((*geometry, *self.frame), step[:-1])
        return replace(self, arm=arm, delay_s=self.delay_s + float(step[-1]))


@dataclass(frozen=True, eq=False)
class EncodedBins(LinkSideBins):
    """Mean period of joint positions by encoders on the link side [rad or m].

    Attributes:
        joints: Indices of the m joints.
    """

    name = "encoder"
    joints: tuple[int, ...]

    def values(self, q: FloatArray) -> FloatArray:
        """Return the positions of the joints, (rows, m)."""
        return q[:, list(self.joints)]

    def value_slopes(self, q: FloatArray, parameters: Sequence[KinematicParameter]) -> FloatArray:
        """Return zeros, (rows, m, parameters): no position depends on the geometry."""
        return np.zeros((len(q), len(self.joints), len(parameters)))

    def moved(self, geometry: Sequence[KinematicParameter], step: FloatArray) -> EncodedBins:
        """Return the same measurement with another delay."""
        return replace(self, delay_s=self.delay_s + float(step[-1]))


def tracked_bins(
    tracked: TrackedPoint,
    recording: Recording,
    motors: FloatArray,
    harmonics: int,
    period_s: float,
    chain: Chain,
) -> TrackedBins:
    """Prepare the path of a point that a tracker measured during an excitation run.

    Args:
        tracked: The measured point.
        recording: The run.
        motors: Shape (rows, n). One period of the motors' positions.
        harmonics: Number of harmonics that are used if they are measured.
        period_s: Period of the excitation [s].
        chain: The robot's geometry; its tool point is the nominal place of the measured point.

    Raises:
        DataQualityError: The measured path does not fit the run, or has too few rows or too long
            gaps for the motion.
    """
    valid = recording.valid
    path = forward(chain, recording.position[valid])
    found = align(tracked, recording.time_s[valid], path)
    point = found.to_base(tracked.point_m)
    folded = _folded(found, tracked.time_s, point, recording, period_s, harmonics)
    _require_band(folded, forward(chain, motors), period_s, harmonics)
    arm = PlacedArm(chain, np.eye(3), np.zeros(3), np.zeros(chain.n), None)
    return TrackedBins(folded.bins[1:], folded.sigma, arm)


def encoded_bins(
    links: LinkPositions,
    recording: Recording,
    motors: FloatArray,
    harmonics: int,
    period_s: float,
) -> EncodedBins:
    """Prepare positions that encoders on the link side measured during an excitation run.

    Args:
        links: The measured positions.
        recording: The run.
        motors: Shape (rows, n). One period of the motors' positions.
        harmonics: Number of harmonics that are used if they are measured.
        period_s: Period of the excitation [s].

    Raises:
        DataQualityError: The positions do not fit the run, or have too few rows or too long gaps
            for the motion.
    """
    valid = recording.valid
    clock = links.clock(recording.time_s[valid], recording.position[valid])
    folded = _folded(clock, links.time_s, links.position, recording, period_s, harmonics)
    _require_band(folded, motors[:, list(links.joints)], period_s, harmonics)
    return EncodedBins(folded.bins[1:], folded.sigma, links.joints)


def geometry_of(
    tracked: Sequence[TrackedBins], motions: Sequence[FloatArray]
) -> tuple[KinematicParameter, ...]:
    """Return the geometric parameters that the point's paths show, without the base frame.

    Args:
        tracked: The measurements.
        motions: For each, a period of joint positions, (rows, n).
    """
    chain = tracked[0].arm.chain
    names = [f"joint {number + 1}" for number in range(chain.n)]
    candidates = geometry_candidates(chain, names)
    slopes = np.concatenate(
        [
            each.arm.slopes(q, np.zeros(len(q)), candidates)
            for each, q in zip(tracked, motions, strict=True)
        ]
    )
    return tuple(each for each in choose_identifiable(slopes, candidates) if each.kind != "frame")


def _folded(
    clock: InstrumentClock,
    time_s: FloatArray,
    values: FloatArray,
    recording: Recording,
    period_s: float,
    harmonics: int,
) -> FoldedPeriod:
    """Return the mean period of the rows that lie in the main part of a run."""
    main = recording.valid & (recording.phase == Phase.MAIN) & (recording.sample_index >= 0)
    index = recording.sample_index[main] - int(recording.sample_index[main].min())
    at = clock.run_time(time_s)
    rows = is_covered(at, recording.time_s[main])
    assert recording.samples_per_period is not None
    step_s = period_s / recording.samples_per_period
    since_begin = step_s * np.interp(at[rows], recording.time_s[main], index)
    return fold_period(since_begin, values[rows], period_s, harmonics)


def _require_band(
    folded: FoldedPeriod, motion: FloatArray, period_s: float, harmonics: int
) -> None:
    """Refuse a mean period that lacks harmonics of the motion.

    Args:
        folded: The mean period.
        motion: Shape (rows, channels). The same signals by the encoders at the motors.
        period_s: Period of the excitation [s].
        harmonics: Number of harmonics that are used if they are measured.

    Raises:
        DataQualityError: The RMS of the lacking harmonics exceeds `LARGEST_LOSS`.
    """
    shown = len(folded.bins) - 1
    bins = np.fft.rfft(motion, axis=0) / len(motion)
    lost = float(np.sqrt(2.0 * np.sum(np.abs(bins[shown + 1 : harmonics + 1]) ** 2)))
    if lost > LARGEST_LOSS:
        raise DataQualityError(
            f"the measured rows show the motion only up to {shown / period_s:.3g} Hz, but"
            f" {1e3 * lost:.2g} mm or mrad RMS are above this frequency: measure the whole run"
            " at a higher rate",
            code="RID-TRACKER-RATE",
        )


def _omega(count: int, period_s: float) -> FloatArray:
    return np.asarray(2.0 * math.pi / period_s * np.arange(1, count + 1, dtype=np.float64))


def _late(bins: Bins, delay_s: float, period_s: float) -> Bins:
    return np.asarray(bins * np.exp(-1j * _omega(len(bins), period_s) * delay_s)[:, np.newaxis])
