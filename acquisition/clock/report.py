"""`ClockReport`: findings about a recording's clock."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

NAMED_SHARE: Final = 0.005
"""Largest fraction of repeated rows or positions for which the clock is not in doubt."""
MISSING_SHARE: Final = 0.01


class ClockState(StrEnum):
    """Origin of a recording's times, and the confidence in them."""

    CONFIRMED = "confirmed"
    """The times are the stamps; positions and velocities do not contradict them significantly."""
    REBUILT = "rebuilt"
    """The times are estimated from positions and velocities, which contradict the stamps."""
    UNVERIFIED = "unverified"
    """The times are the stamps; nothing contradicts or confirms them."""
    UNKNOWN = "unknown"
    """The times are the stamps, which are in doubt: no delay and no filter can be fitted."""


@dataclass(frozen=True)
class ClockReport:
    """Findings about a clock.

    Attributes:
        clock: Origin of the times.
        rows: Number of rows.
        repeated_rows: Number of rows that repeat the previous row although the robot moves; an
            import drops them.
        longest_repeat: Number of rows in the longest run of equal rows; 1 if no row repeats.
        missing_rows: Number of missing rows according to the steps of the stamps; steps of five
            median steps or more are not counted.
        jitter_rms_s: Deviation of the stamps' steps from whole multiples of the median step, RMS
            [s].
        held_share: For each joint, the fraction of positions that repeat the previous row although
            the joint moves.
        corrected_rms_s: RMS difference between rebuilt times and stamps, after removal of a common
            shift and rate [s]; 0 if the stamps are kept.
        rate: Duration of the rebuilt times divided by the duration of the stamps; 1 if the stamps
            are kept.
        tick_s: Time of which all rebuilt steps except gaps are whole multiples [s]; None if there
            is no such time, or the stamps are kept.
        left_out_gain, torque_gain: Logarithm of a ratio: the prediction error with the stamps
            divided by the prediction error with the rebuilt times. The predictions are
            displacements of left-out joints, or held-out torques. None if unknown; a
            `left_out_gain` of 0 is not significant.
        doubt: Reason for an unknown clock; empty otherwise.
    """

    clock: ClockState
    rows: int
    repeated_rows: int = 0
    longest_repeat: int = 1
    missing_rows: int = 0
    jitter_rms_s: float = 0.0
    held_share: tuple[float, ...] = ()
    corrected_rms_s: float = 0.0
    rate: float = 1.0
    tick_s: float | None = None
    left_out_gain: float | None = None
    torque_gain: float | None = None
    doubt: str = ""

    @property
    def is_known(self) -> bool:
        """True if delays and filters of the torque can be fitted."""
        return self.clock is not ClockState.UNKNOWN

    @property
    def is_sound(self) -> bool:
        """True if no row and few positions are repeats, and nothing contradicts the stamps."""
        held = max(self.held_share, default=0.0) > NAMED_SHARE
        stamps = self.clock in (ClockState.CONFIRMED, ClockState.UNVERIFIED)
        return stamps and not self.repeated_rows and not held

    @property
    def repeated_share(self) -> float:
        """Number of repeated rows divided by the number of rows."""
        return self.repeated_rows / max(self.rows, 1)

    def line(self) -> str:
        """Return a summary of the clock in one line."""
        return (
            f"clock {self.clock}: {self.repeated_rows} repeated rows"
            f" ({100.0 * self.repeated_share:.1f} %), {self.missing_rows} missing, jitter"
            f" {1e3 * self.jitter_rms_s:.3g} ms RMS"
        )

    def findings(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        """Return the findings that a user should know, one sentence each."""
        sentences = []
        if self.repeated_rows:
            sentences.append(
                f"{self.repeated_rows} of {self.rows} rows ({100.0 * self.repeated_share:.1f} %)"
                " repeat the previous row although the robot moves, in runs of up to"
                f" {self.longest_repeat} equal rows: the logger reads faster than its source"
                " updates. The repeated rows are dropped"
            )
        if self.missing_rows > MISSING_SHARE * self.rows:
            sentences.append(
                f"{self.missing_rows} rows are missing according to the time stamps"
                f" ({100.0 * self.missing_rows / (self.rows + self.missing_rows):.1f} %): the"
                " signals are interpolated across the gaps"
            )
        held = [
            f"{name} {100.0 * share:.0f} %"
            for name, share in zip(joint_names, self.held_share, strict=False)
            if share > NAMED_SHARE
        ]
        if held:
            sentences.append(
                "The source updates positions more slowly than the logger writes rows. Percentage"
                " of positions that repeat the previous row although the joint moves:"
                f" {', '.join(held)}. Repeated positions are interpolated"
            )
        if self.clock is ClockState.REBUILT:
            tick = "" if self.tick_s is None else f", in steps of {1e3 * self.tick_s:.4g} ms"
            sentences.append(
                f"The time stamps have an error of {1e3 * self.corrected_rms_s:.3g} ms RMS"
                f" (jitter of their steps: {1e3 * self.jitter_rms_s:.3g} ms RMS): the times were"
                f" rebuilt from positions and velocities{tick}. The file is unchanged"
            )
        if self.doubt:
            sentences.append(
                f"The clock is unknown: {self.doubt}. No delay and no filter of the torque is"
                " fitted. Record the source's own time stamps, or its velocities"
            )
        return tuple(sentences)
