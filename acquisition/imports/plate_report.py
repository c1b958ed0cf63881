"""`PlateReport`: rows, offset, lag and clock of an imported force plate."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal

NORMAL_95: Final = 1.96
"""Half width of a 95 % interval in standard deviations."""


@dataclass(frozen=True)
class PlateReport:
    """Report on the readings of a force plate.

    Attributes:
        names: Names of the readings.
        rows_read, rows_used: Number of rows with data in the plate's file, and of usable rows.
        step_s: Median time between rows [s].
        gaps: Number of places at which rows are missing.
        saturated_share: Fraction of the rows in which each reading is saturated or settling.
        offset_rule: Origin of the offset: `rest` of the robot, `stated` in the map, or `estimated`
            together with the robot's parameters when a model is identified.
        offset: Offset that was subtracted from each reading [N or N m]; empty if none was.
        clock: `shared` with the positions, or `own`.
        lag_s: Delay that was compensated [s].
        lag_found_s, lag_std_s: Delay of the plate's signals behind the positions, estimated from
            the motion, and its standard deviation [s]; None if the motion does not show it.
        drift_ppm, drift_std_ppm: Amount by which the plate's own clock is fast, and its standard
            deviation [ppm]; None with a shared clock.
        explained_share: Fraction of the readings' variance that the motion explains at the
            estimated delay; None if no delay could be estimated.
        usable_share: Fraction of the recording's rows with valid readings of all channels.
    """

    names: tuple[str, ...]
    rows_read: int
    rows_used: int
    step_s: float
    gaps: int
    saturated_share: tuple[float, ...]
    offset_rule: Literal["rest", "stated", "estimated"]
    offset: tuple[float, ...]
    clock: Literal["shared", "own"]
    lag_s: float
    lag_found_s: float | None
    lag_std_s: float | None
    drift_ppm: float | None
    drift_std_ppm: float | None
    explained_share: float | None
    usable_share: float

    def lines(self) -> tuple[str, ...]:
        """Return the report as text."""
        return (
            f"Force plate: {self.rows_used} of {self.rows_read} rows used, {1.0 / self.step_s:.5g}"
            f" Hz; {self.gaps} gaps; valid on {100.0 * self.usable_share:.1f} % of the recording's"
            " rows",
            f"Force plate: {self._offset_words()}",
            f"Force plate: {self._clock_words()}",
        )

    def _offset_words(self) -> str:
        if not self.offset:
            return "no offset is subtracted; `identify` estimates it with the parameters"
        pairs = zip(self.names, self.offset, strict=True)
        shown = ", ".join(f"{name} {value:.4g}" for name, value in pairs)
        rule = "the readings at rest are" if self.offset_rule == "rest" else "the stated offset is"
        return f"{rule} subtracted: {shown}"

    def _clock_words(self) -> str:
        words = f"delay of {1e3 * self.lag_s:.2f} ms compensated"
        if self.lag_found_s is None or self.lag_std_s is None:
            return f"{words}; the motion does not show the delay"
        half = NORMAL_95 * self.lag_std_s
        words += (
            f"; the motion shows {1e3 * self.lag_found_s:.2f} ± {1e3 * half:.2f} ms (95 % interval)"
        )
        if self.drift_ppm is not None and self.drift_std_ppm is not None:
            half = NORMAL_95 * self.drift_std_ppm
            words += (
                f"; the plate's clock is {self.drift_ppm:.0f} ± {half:.0f} ppm fast, and its rows"
                " are resampled"
            )
        return words
