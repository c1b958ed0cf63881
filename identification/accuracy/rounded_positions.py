"""`RoundedPositions`: effect of positions with few digits on an estimate, and its remedy.

The second derivative of rounding errors is a noise in the columns of inertia, which makes inertias
too small (errors in variables). Its power grows with the fifth power of the band's upper limit, so
a narrower band is the remedy. The remaining effect is found by rounding the positions once more: to
first order, the estimate moves by as much as the first rounding has already moved it.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from acquisition.processing.smoothing import low_pass
from acquisition.recording.recording import Recording
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.choices import BAND_HZ
from identification.estimation.estimate import Estimate

SMALLEST_STEP: Final = 5e-5
"""Rounding step above which an effect is computed [rad or m]; that of 17 bits per turn."""
NOISE_SHARE_LIMIT: Final = 1e-3
"""Largest power of the rounding errors' acceleration, relative to that of the motion, for which
rounding once more has about the same effect as the first rounding."""
BANDS_HZ: Final = (10.0, 7.0, 5.0, 4.0, 3.0, 2.0)
"""Bands from which a narrower one is selected [Hz]."""
HIGHEST_SHARE: Final = 0.4
"""Highest cut-off of a low-pass, relative to the sampling rate."""
MOVING_STEPS: Final = 20.0
"""Smallest range of a joint that counts as moved [steps]."""
ROUNDINGS: Final = 3
"""Number of times that the positions are rounded once more."""
WIDER: Final = 1.2
"""Factor by which an interval must have become wider to be reported."""


@dataclass(frozen=True, eq=False)
class RoundedPositions:
    """Rounding steps of the positions of some recordings, and the band that they allow.

    Attributes:
        robot: The robot.
        steps: Shape (recordings, n). Rounding step of each joint [rad or m]; 0 without a step that
            has an effect.
        asked_hz: Requested upper limit of the band [Hz].
        band_hz: Upper limit that was used [Hz].
        advised_hz: Highest tried upper limit at which the effect is small; the lowest tried one if
            it is small at none [Hz].
        noise_share: Power of the rounding errors' acceleration in the used band, relative to that
            of the motion.
        widening: Largest factor by which an interval became wider because of the rounding.
    """

    robot: RobotDescription
    steps: FloatArray
    asked_hz: float
    band_hz: float
    advised_hz: float
    noise_share: float
    widening: float = 1.0

    @classmethod
    def of(
        cls,
        robot: RobotDescription,
        recordings: Sequence[Recording],
        steps: Sequence[Sequence[float | None]],
        band_hz: float,
    ) -> RoundedPositions | None:
        """Return the rounding of some recordings; None if no step is large enough for an effect.

        Args:
            robot: The robot.
            recordings: The recordings.
            steps: For each recording, the rounding step of each joint [rad or m].
            band_hz: Requested upper limit of the band; the default value may be lowered [Hz].
        """
        sizes = np.array([[step or 0.0 for step in own] for own in steps])
        sizes[sizes <= SMALLEST_STEP] = 0.0
        if not sizes.any():
            return None

        def share(limit_hz: float) -> float:
            pairs = zip(recordings, sizes, strict=True)
            return max(rounding_noise_share(each, own, limit_hz) for each, own in pairs)

        lower = [limit_hz for limit_hz in BANDS_HZ if limit_hz <= band_hz] or [band_hz]
        sound = (limit_hz for limit_hz in lower if share(limit_hz) <= NOISE_SHARE_LIMIT)
        advised_hz = next(sound, lower[-1])
        if share(band_hz) <= NOISE_SHARE_LIMIT:
            advised_hz = band_hz
        used_hz = advised_hz if band_hz == BAND_HZ else band_hz
        return cls(robot, sizes, band_hz, used_hz, advised_hz, share(used_hz))

    @property
    def is_material(self) -> bool:
        """True if the band was lowered or is too wide, or if an interval became much wider."""
        too_wide = self.noise_share > NOISE_SHARE_LIMIT
        return too_wide or self.band_hz != self.asked_hz or self.widening >= WIDER

    @property
    def step_of_joint(self) -> dict[str, float]:
        """Largest rounding step of each joint that has one [rad or m]."""
        largest = self.steps.max(axis=0).tolist()
        return {
            name: step
            for name, step in zip(self.robot.joint_names, largest, strict=True)
            if step > 0.0
        }

    @property
    def sentence(self) -> str:
        """The finding in words."""
        own = self.step_of_joint
        units = {joint.name: joint.unit for joint in self.robot.joints}
        sizes = ", ".join(
            f"{name} {_in_user_unit(step, units[name])}" for name, step in own.items()
        )
        found = [
            "The recorded positions are rounded, and the recording has no velocities (steps:"
            f" {sizes}). Rounding errors make inertias too small."
        ]
        if self.band_hz != self.asked_hz:
            found.append(
                f"Therefore the band ends at {self.band_hz:g} Hz instead of {self.asked_hz:g} Hz."
            )
        if self.noise_share > NOISE_SHARE_LIMIT:
            lower = "" if self.advised_hz >= self.band_hz else f": use --band {self.advised_hz:g}"
            found.append(
                f"In the band up to {self.band_hz:g} Hz the errors are so large that the intervals"
                f" can be too narrow{lower}."
            )
        found += widening_sentences(self.widening)
        return " ".join([*found, "Record positions with more digits, or velocities as well."])

    def widen(
        self,
        estimate: Estimate,
        recordings: Sequence[Recording],
        estimate_again: Callable[[Sequence[Recording]], Estimate],
    ) -> tuple[Estimate, RoundedPositions]:
        """Return an estimate whose intervals contain the effect, and the rounding with `widening`.

        Args:
            estimate: The estimate from the recordings.
            recordings: The recordings.
            estimate_again: Function that repeats the estimate for other recordings.
        """
        moves = ~np.isin(self.robot.joint_names, [each.joint for each in estimate.still])
        wider, widening = with_rounding(
            estimate,
            [
                estimate_again(
                    [
                        round_again(recording, own * moves, self.band_hz, random)
                        for recording, own in zip(recordings, self.steps, strict=True)
                    ]
                )
                for random in map(np.random.default_rng, range(ROUNDINGS))
            ],
        )
        return wider, replace(self, widening=widening)


def widening_sentences(widening: float) -> list[str]:
    """Return a sentence on intervals that became much wider; none for other intervals."""
    if widening < WIDER:
        return []
    return [f"The intervals contain this effect; they became up to {widening:.2g} times wider."]


def with_rounding(estimate: Estimate, others: Sequence[Estimate]) -> tuple[Estimate, float]:
    """Return an estimate whose intervals contain the effect of rounding.

    Args:
        estimate: The estimate.
        others: Estimates from the same data, rounded once more.

    Returns:
        The estimate, and the largest factor by which an interval became wider.
    """
    more = np.zeros_like(estimate.covariance_residual)
    of_nonlinear = np.zeros_like(estimate.nonlinear_covariance)
    for other in others:
        moved = other.values - estimate.values
        more += np.outer(moved, moved) / len(others)
        bent = other.model.nonlinear_values - estimate.model.nonlinear_values
        of_nonlinear += np.outer(bent, bent) / len(others)
    wider = estimate.add_covariance(more)
    wider = replace(wider, nonlinear_covariance=wider.nonlinear_covariance + of_nonlinear)
    grown = wider.sigma / np.maximum(estimate.sigma, 1e-300)
    return wider, float(grown.max())


def rounding_noise_share(recording: Recording, steps: FloatArray, limit_hz: float) -> float:
    """Return the power of the rounding errors' acceleration relative to that of the motion.

    The result is the largest of all joints that move, for frequencies up to a limit. Rounding
    errors count as white noise with a variance of a twelfth of the squared step.

    Args:
        recording: Recording with nearly uniform rows.
        steps: Shape (n,). Rounding step of each joint [rad or m]; 0 without rounding.
        limit_hz: Upper limit [Hz].
    """
    step_s = float(np.median(np.diff(recording.time_s)))
    worst = 0.0
    for position, step in zip(recording.position.T, steps.tolist(), strict=True):
        if step == 0.0 or np.ptp(position) < MOVING_STEPS * step:
            continue
        bend = np.diff(position, 2)
        frequency_hz = np.fft.rfftfreq(len(bend), step_s)
        inside = frequency_hz <= limit_hz
        power = float(np.sum(np.abs(np.fft.rfft(bend)[inside]) ** 2))
        gain = (2.0 - 2.0 * np.cos(2.0 * np.pi * frequency_hz[inside] * step_s)) ** 2
        noise = float(np.sum(gain)) * len(bend) * step**2 / 12.0
        worst = max(worst, noise / max(power - noise, 1e-300))
    return worst


def round_again(
    recording: Recording, steps: FloatArray, band_hz: float, random: np.random.Generator
) -> Recording:
    """Return a recording with additional rounding errors, as large as those that it has.

    The errors are those of the low-passed positions, rounded to a grid with a random origin.

    Args:
        recording: Recording with nearly uniform rows.
        steps: Shape (n,). Rounding step of each joint [rad or m]; 0 without rounding.
        band_hz: Upper limit of the band [Hz].
        random: Source of the origins.
    """
    errors = further_errors(recording.position, recording, steps, band_hz, random)
    return replace(recording, position=recording.position + errors)


def further_errors(
    values: FloatArray,
    recording: Recording,
    steps: FloatArray,
    band_hz: float,
    random: np.random.Generator,
) -> FloatArray:
    """Return the errors of low-passed values that are rounded to a grid with a random origin.

    Args:
        values: Shape (rows, n). Rounded positions or torques of the recording.
        recording, steps, band_hz, random: As for `round_again`.
    """
    step_s = float(np.median(np.diff(recording.time_s)))
    smooth = low_pass(values, step_s, min(band_hz, HIGHEST_SHARE / step_s))
    origin = random.uniform(-0.5, 0.5, len(steps)) * steps
    size = np.where(steps > 0.0, steps, 1.0)
    error = np.round((smooth + origin) / size) * size - smooth - origin
    return np.where(steps > 0.0, error, 0.0)


def _in_user_unit(step: float, unit: str) -> str:
    """Return a step in degrees or millimetres, as text."""
    return f"{np.rad2deg(step):.2g}°" if unit == "rad" else f"{1e3 * step:.2g} mm"
