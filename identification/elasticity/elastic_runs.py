"""`ExcitationBins` and `MultisineBins`: recordings prepared for the fit of elastic gears."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.processing.periods import PeriodAverage
from acquisition.processing.realisations import realisation_starts
from acquisition.recording.recording import Recording
from acquisition.signals.bins import Bins, filter_response, from_bins, to_bins
from acquisition.tracker.link_file import LinkPositions
from acquisition.tracker.tracker_file import TrackedPoint
from config.arrays import FloatArray, IntArray
from config.cell.torque_filter import ButterworthFilter
from config.errors import DataQualityError
from config.robot.robot import RobotDescription
from dynamics.geometry.kinematics import Chain
from identification.elasticity.elastic_arm import ElasticArm, SmallMotion
from identification.elasticity.friction_shapes import friction_shapes
from identification.elasticity.link_motion import Gears
from identification.elasticity.link_side import LinkSideBins, encoded_bins, tracked_bins
from identification.equations.base_wrench import average_neighbouring_bins
from identification.equations.bins import harmonics_below

EXCITATION_BAND_HZ: Final = 6.0
SHARE_OF_NYQUIST: Final = 0.8
FINE_STEP_S: Final = 0.001
POSES: Final = 16


@dataclass(frozen=True, eq=False)
class WrenchBins:
    """Base wrench of a mean period on the bins 1 to H.

    Attributes:
        wrench: Shape (H, 6). Bins of the wrench of the base on the robot [N, N m].
        sigma: Shape (6,). RMS of the noise of a bin's real part.
    """

    wrench: Bins
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class ExcitationBins:
    """Mean period of a run with large motion.

    Attributes:
        run_id: Id of the run.
        period_s: The period [s].
        theta: Shape (H + 1, n). Bins 0 to H of the motors' positions.
        torque: Shape (H, n). Bins 1 to H of the motor torques, without the effect of their filter.
        sigma: Shape (n,). RMS of the torque noise of a bin's real part [N m or N].
        friction: Shape (H, n, functions). Bins of `friction_shapes`.
        plate: Base wrench; None without a force plate.
        link_side: Measurements on the link side of the gears.
    """

    run_id: str
    period_s: float
    theta: Bins
    torque: Bins
    sigma: FloatArray
    friction: Bins
    plate: WrenchBins | None = None
    link_side: tuple[LinkSideBins, ...] = ()

    @property
    def rows(self) -> int:
        """Samples per period at which the dynamics are computed."""
        return int(2 ** math.ceil(math.log2(6 * len(self.theta))))

    @property
    def motors(self) -> FloatArray:
        """One period of the motors' positions, shape (rows, n) [rad or m]."""
        return from_bins(self.theta, self.rows)

    def with_tracker(
        self, tracked: TrackedPoint, recording: Recording, chain: Chain
    ) -> ExcitationBins:
        """Return the run with a point that a tracker measured; see `tracked_bins`."""
        found = tracked_bins(
            tracked, recording, self.motors, len(self.torque), self.period_s, chain
        )
        return replace(self, link_side=(*self.link_side, found))

    def with_link_encoders(self, links: LinkPositions, recording: Recording) -> ExcitationBins:
        """Return the run with positions of encoders on the link side; see `encoded_bins`."""
        found = encoded_bins(links, recording, self.motors, len(self.torque), self.period_s)
        return replace(self, link_side=(*self.link_side, found))

    def below(self, band_hz: float) -> ExcitationBins:
        """Return the bins up to a frequency [Hz], at least four."""
        count = min(len(self.torque), max(4, math.floor(band_hz * self.period_s + 1e-9)))
        plate = self.plate
        return replace(
            self,
            theta=self.theta[: count + 1],
            torque=self.torque[:count],
            friction=self.friction[:count],
            plate=None if plate is None else replace(plate, wrench=plate.wrench[:count]),
            link_side=tuple(replace(each, bins=each.bins[:count]) for each in self.link_side),
        )


@dataclass(frozen=True, eq=False)
class MultisineBins:
    """Mean period of one realisation of a multisine, on the excited lines.

    Attributes:
        run_id: Id of the run, with the number of the realisation.
        frequency_hz: Shape (F,). The lines.
        excited: Shape (F,). For each line, index of the joint that it excites.
        theta, torque: Shape (F, n). Bins of motors' positions and torques, filter removed.
        sigma: Shape (n,). RMS of the torque noise of a bin's real part.
        friction: Shape (F, n, functions). Bins of `friction_shapes`, and theta itself, because
            presliding friction is a spring to small motions.
        small: Equations about the poses of the slow motion.
    """

    run_id: str
    frequency_hz: FloatArray
    excited: IntArray
    theta: Bins
    torque: Bins
    sigma: FloatArray
    friction: Bins
    small: SmallMotion


def excitation_bins(run_id: str, average: PeriodAverage, *, plate: bool = False) -> ExcitationBins:
    """Prepare the mean period of an excitation run.

    Args:
        plate: True to use the base wrench.

    Raises:
        DataQualityError: A channel of the force plate is left out.
        EstimationError: The period is too short for the band.
    """
    period_s, step_s = average.period_s, average.sample_period_s
    harmonics = harmonics_below(EXCITATION_BAND_HZ, period_s, step_s, average.torque_filter)
    torque = _unfiltered(average.torque_nm, harmonics, period_s, average.torque_filter)
    shapes = _shape_bins(average.position, torque, period_s, step_s)
    variance = average.torque_bin_variance[1 : harmonics + 1].mean(axis=0) / average.periods_kept
    return ExcitationBins(
        run_id,
        period_s,
        to_bins(average.position, harmonics),
        torque[1:],
        np.sqrt(0.5 * variance),
        shapes[1 : harmonics + 1],
        _wrench(average, harmonics) if plate else None,
    )


def multisine_bins(
    run_id: str,
    recording: Recording,
    motion: MultisineMotion,
    robot: RobotDescription,
    arm: ElasticArm,
) -> tuple[MultisineBins, ...]:
    """Prepare each realisation of a multisine run.

    Raises:
        DataQualityError: No realisation is complete, or the recording has no uniform times.
    """
    step_s = recording.sample_period_s
    if step_s is None:
        raise DataQualityError(
            f"run {run_id}: the time stamps are not uniform: record the multisine with"
            " `rid-daq record`",
            code="RID-RUN-FOREIGN",
        )
    rows = round(motion.period_s / step_s)
    own = motion.excited_lines(robot)
    lines = np.concatenate(own)
    joints = np.concatenate([np.full(len(each), j) for j, each in enumerate(own)])
    order = np.argsort(lines)
    lines, joints = lines[order], joints[order]
    found = []
    for number, first in sorted(realisation_starts(recording, motion, robot).items()):
        used = slice(first, first + motion.periods * rows)
        position, torque_nm = (
            values[used].reshape(motion.periods, rows, -1)
            for values in (recording.position, recording.torque_nm)
        )
        mean = position.mean(axis=0)
        harmonics = int(lines[-1])
        torque = _unfiltered(
            torque_nm.mean(axis=0), harmonics, motion.period_s, recording.torque_filter
        )
        between = np.fft.rfft(torque_nm, axis=1)[:, lines] / rows
        variance = between.var(axis=0, ddof=1).mean(axis=0) / motion.periods
        theta = to_bins(mean, harmonics)
        shapes = _shape_bins(mean, torque, motion.period_s, step_s)[: harmonics + 1]
        friction = np.concatenate([shapes, theta[:, :, np.newaxis]], axis=2)
        poses = mean[:: max(1, rows // POSES)]
        found.append(
            MultisineBins(
                f"{run_id}, realisation {number + 1}",
                lines / motion.period_s,
                joints,
                theta[lines],
                torque[lines],
                np.sqrt(0.5 * variance),
                friction[lines],
                SmallMotion.of(arm, poses),
            )
        )
    return tuple(found)


def multisine_torque(run: MultisineBins, gears: Gears) -> Bins:
    """Return the motor torques without friction at the lines of a multisine, shape (F, n).

    q = [s^2 M + K + s D + K_g]^-1 [K + s D - s^2 S] theta, and
    tau = s^2 (I theta + C q) + (K + s D) (theta - q). K and D contain the stiffness and damping of
    the gears. The matrices M, K_g, S, C and I are `mass`, `slope`, `reaction`, `carried` and `own`
    of `SmallMotion`. If stiffness and damping have the shape (tries, n), the result has the shape
    (tries, F, n).
    """
    small = run.small
    s = 2j * math.pi * run.frequency_hz[:, np.newaxis]
    stiffness, damping = (each[..., np.newaxis, :] for each in (gears.stiffness, gears.damping))
    gear = stiffness + s * damping
    mass, slope = small.mass @ gears.body, small.slope @ gears.body
    reaction, carried = small.reaction @ gears.rotor, small.carried @ gears.rotor
    left = s[:, np.newaxis] ** 2 * mass + slope + gear[..., np.newaxis] * np.eye(len(mass))
    right = gear * run.theta - s**2 * (run.theta @ reaction.T)
    link = np.linalg.solve(left, right[..., np.newaxis])[..., 0]
    own = np.diagonal(small.own) * gears.rotor
    return np.asarray(s**2 * (own * run.theta + link @ carried.T) + gear * (run.theta - link))


def _unfiltered(
    torque_nm: FloatArray, harmonics: int, period_s: float, analog: ButterworthFilter | None
) -> Bins:
    """Return the bins 0 to `harmonics` of torques without the effect of their filter."""
    bins = to_bins(torque_nm, harmonics)
    if analog is None:
        return bins
    response = filter_response(analog, np.arange(harmonics + 1) / period_s)
    return np.asarray(bins / response[:, np.newaxis])


def _shape_bins(position: FloatArray, torque: Bins, period_s: float, step_s: float) -> Bins:
    """Return the bins of the friction shapes of a mean period."""
    rows = len(position)
    fine = rows * max(1, math.ceil(step_s / FINE_STEP_S))
    reach = math.floor(SHARE_OF_NYQUIST * 0.5 * rows)
    bins = to_bins(position, reach)
    s = 2j * math.pi / period_s * np.arange(reach + 1)[:, np.newaxis]
    shapes = friction_shapes(
        from_bins(bins, fine), from_bins(bins * s, fine), from_bins(torque, fine)
    )
    return np.asarray(np.fft.rfft(shapes, axis=0)[: rows // 2] / fine)


def _wrench(average: PeriodAverage, harmonics: int) -> WrenchBins | None:
    """Return the base wrench of a mean period; None without a force plate.

    Raises:
        DataQualityError: A channel of the force plate is left out.
    """
    reaction = average.reaction
    if reaction is None:
        return None
    if not reaction.used.all():
        raise DataQualityError(
            f"channels {', '.join(reaction.left_out)} of the force plate are overloaded or missing:"
            " identify the stiffness without the plate",
            code="RID-PLATE-CHANNEL",
        )
    response = np.ones(harmonics + 1, dtype=complex)
    if reaction.low_pass is not None:
        response = filter_response(reaction.low_pass, np.arange(harmonics + 1) / average.period_s)
    matrix = reaction.base_wrench_matrix
    wrench = to_bins(reaction.channels_n, harmonics) @ matrix.T / response[:, np.newaxis]
    noise = average_neighbouring_bins(matrix @ reaction.bin_covariance @ matrix.T)
    variance = np.diagonal(noise[1 : harmonics + 1], axis1=1, axis2=2).mean(axis=0)
    return WrenchBins(wrench[1:], np.sqrt(0.5 * variance / average.periods_kept))
