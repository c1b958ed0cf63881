"""`ClockReport`: what was found of a recording's clock, in numbers and in words."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Final

NAMED_SHARE: Final = 0.005
"""More repeated rows, or positions held in more rows, leave the clock in doubt."""
MISSING_SHARE: Final = 0.01


class ClockState(StrEnum):
    """Where the times of a recording come from, and what is known of them."""

    CONFIRMED = "confirmed"
    """The stamps: positions and velocities agree with them."""
    REBUILT = "rebuilt"
    """Positions and velocities: they contradict the stamps."""
    UNVERIFIED = "unverified"
    """The stamps: nothing contradicts them, and nothing confirms them."""
    UNKNOWN = "unknown"
    """The stamps, which are in doubt: no delay and no filter can be fitted."""


@dataclass(frozen=True)
class ClockReport:
    """What was found of a clock.

    Attributes:
        clock: What the times are.
        rows: Rows looked at.
        repeated_rows: Rows that repeat the one before although the robot moves; they are left out.
        longest_repeat: Rows in the longest run of equal ones; 1 if none repeat.
        missing_rows: Rows that the steps of the stamps leave room for.
        jitter_rms_s: How far the stamps' steps are from whole multiples of the median step, RMS
            [s].
        held_share: Share of each joint's positions that are those of the row before although the
            joint moves.
        corrected_rms_s: How far rebuilt times are from the stamps, after the best shift and rate,
            RMS [s].
        rate: Duration of the rebuilt times over that of the stamps; 1 if they are kept.
        tick_s: What all rebuilt steps are whole multiples of [s].
        left_out_gain, torque_gain: Logarithm of the error by the stamps over that by rebuilt times,
            for joints left out and for held-out torques; None if not known.
        doubt: Why the clock is unknown; empty if it is not.
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
        """Whether delays and filters of the torque can be fitted."""
        return self.clock is not ClockState.UNKNOWN

    @property
    def is_sound(self) -> bool:
        """Whether no row repeats another, and nothing speaks against the stamps."""
        held = max(self.held_share, default=0.0) > NAMED_SHARE
        stamps = self.clock in (ClockState.CONFIRMED, ClockState.UNVERIFIED)
        return stamps and not self.repeated_rows and not held

    @property
    def repeated_share(self) -> float:
        """Repeated rows over all rows."""
        return self.repeated_rows / max(self.rows, 1)

    def line(self) -> str:
        """Return the numbers of the clock in one line."""
        return (
            f"clock {self.clock}: {self.repeated_rows} repeated rows"
            f" ({100.0 * self.repeated_share:.1f} %), {self.missing_rows} missing, jitter"
            f" {1e3 * self.jitter_rms_s:.3g} ms RMS"
        )

    def findings(self, joint_names: tuple[str, ...]) -> tuple[str, ...]:
        """Return what a person should know of the clock, a sentence each."""
        said = []
        if self.repeated_rows:
            said.append(
                f"{self.repeated_rows} of {self.rows} rows ({100.0 * self.repeated_share:.1f} %)"
                " repeat the row before although the robot moves, up to"
                f" {self.longest_repeat} equal rows in a run: the logger reads faster than its"
                " source renews. They are left out"
            )
        if self.missing_rows > MISSING_SHARE * self.rows:
            said.append(
                f"{self.missing_rows} rows are missing by the time stamps"
                f" ({100.0 * self.missing_rows / (self.rows + self.missing_rows):.1f} %): the"
                " signals between are interpolated"
            )
        held = [
            f"{name} {100.0 * share:.0f} %"
            for name, share in zip(joint_names, self.held_share, strict=False)
            if share > NAMED_SHARE
        ]
        if held:
            said.append(
                "Positions are renewed less often than rows are written; so many are those of the"
                f" row before although the joint moves: {', '.join(held)}. They are interpolated"
            )
        if self.clock is ClockState.REBUILT:
            tick = "" if self.tick_s is None else f", in steps of {1e3 * self.tick_s:.4g} ms"
            said.append(
                f"The time stamps are off by {1e3 * self.corrected_rms_s:.3g} ms RMS (their steps"
                f" jitter by {1e3 * self.jitter_rms_s:.3g} ms RMS): the times were rebuilt from"
                f" positions and velocities{tick}. The file is unchanged"
            )
        if self.doubt:
            said.append(
                f"The clock is unknown: {self.doubt}. No delay and no filter of the torque is"
                " fitted. Record the source's own time stamps, or its velocities"
            )
        return tuple(said)
