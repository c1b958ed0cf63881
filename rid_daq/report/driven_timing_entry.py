"""`DrivenTiming`: a driven path before and after it was retimed to its limits."""

from __future__ import annotations

from rid_daq.report.sections.section import Numbers, Section, Texts
from rid_daq.report.sections.verdict import VerdictCheck

SHORTER_PERCENT = 20.0
MEASURED_PERCENT = 102.0
CLOSE_AS_BEFORE = 3.0


class DrivenPath(Section):
    """Measurements of one driven pick-and-place path.

    Attributes:
        sentence: Description of the run.
        moving_s: Duration of the motion [s].
        mean_m: Mean distance of the tool point from its path [m].
        max_m: Largest distance of the tool point from its path [m].
        torque_share: Largest measured torque of each joint, divided by its limit.
        base_peak: Largest measured value of each component of the base wrench [N, N m].
    """

    sentence: str
    moving_s: float
    mean_m: float
    max_m: float
    torque_share: Numbers
    base_peak: Numbers


class DrivenTiming(Section):
    """Comparison of a driven path before and after retiming, both with pre-compensation.

    Attributes:
        before: Measurements of the original path.
        after: Measurements of the retimed path.
        components: Names of the limited components of the base wrench.
        limit: Limit of each component [N, N m].
        sentence: Robot and model of the measurement.
    """

    before: DrivenPath
    after: DrivenPath
    components: Texts
    limit: Numbers
    sentence: str

    @property
    def base_share(self) -> float:
        """Largest measured base wrench on the retimed path, divided by its limit."""
        peaks = zip(self.after.base_peak, self.limit, strict=True)
        return max(peak / limit for peak, limit in peaks)

    @property
    def words(self) -> str:
        """Improvement by retiming, in a sentence."""
        before, after = self.before, self.after
        return (
            f"Pick and place in {after.moving_s:.4g} s instead of {before.moving_s:.4g} s, with"
            f" at most {100.0 * max(after.torque_share):.0f} % of the torque limits and"
            f" {100.0 * self.base_share:.0f} % of the base wrench limits. Mean distance from the"
            f" path at the motor encoders: {1e3 * before.mean_m:.3f} mm before,"
            f" {1e3 * after.mean_m:.3f} mm after."
        )

    @property
    def checks(self) -> list[VerdictCheck]:
        """Comparison of the retimed path's measurements with their limits."""
        before, after = self.before, self.after
        shorter = 100.0 * (1.0 - after.moving_s / before.moving_s)
        torque, base = 100.0 * max(after.torque_share), 100.0 * self.base_share
        mean, largest = after.mean_m / before.mean_m, after.max_m / before.max_m
        return [
            VerdictCheck.of("reduction of the path's duration", shorter, "≥", SHORTER_PERCENT, "%"),
            VerdictCheck.of(
                "largest measured torque of the retimed path, relative to its limit",
                torque,
                "≤",
                MEASURED_PERCENT,
                "%",
            ),
            VerdictCheck.of(
                "largest measured base wrench of the retimed path, relative to its limit",
                base,
                "≤",
                100.0,
                "%",
            ),
            VerdictCheck.of(
                "mean path error, relative to that before retiming",
                mean,
                "≤",
                CLOSE_AS_BEFORE,
                "times",
            ),
            VerdictCheck.of(
                "largest path error, relative to that before retiming",
                largest,
                "≤",
                CLOSE_AS_BEFORE,
                "times",
            ),
        ]
