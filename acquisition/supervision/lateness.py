"""`Lateness`: check that cycles begin in time, before anything is sent in a cycle."""

from __future__ import annotations

from acquisition.supervision.stop_reason import StopCode, StopReason
from config.cell.cell import CellConfig

LATE_FRACTION = 0.5
"""Delay from which a cycle counts as late, as a fraction of the cycle time."""


class Lateness:
    """Check of the delays of cycles (faults: row 27).

    Args:
        cell: Cycle time and limits.
    """

    def __init__(self, cell: CellConfig) -> None:
        self._rules = cell.supervision
        self._period_s = cell.cycle_time_s
        self._late = 0  # consecutive late cycles

    def judge(self, lateness_s: float) -> StopReason | None:
        """Return the reason to stop; None if the motion may continue.

        Args:
            lateness_s: Delay of the beginning of this cycle [s].
        """
        rules = self._rules
        late_by = lateness_s / self._period_s
        if not late_by <= rules.late_by_cycles_limit:
            return StopReason(
                StopCode.LATE_CYCLE,
                f"a cycle began {lateness_s * 1e3:.1f} ms late ({late_by:.1f} cycle times);"
                f" at most {rules.late_by_cycles_limit:g} cycle times are allowed. Check the"
                " computer's load",
                value=late_by,
                limit=rules.late_by_cycles_limit,
            )
        self._late = self._late + 1 if late_by > LATE_FRACTION else 0
        if self._late >= rules.late_cycles_limit:
            return StopReason(
                StopCode.LATE_CYCLE,
                f"{self._late} cycles in a row began more than {LATE_FRACTION:g} cycle times late."
                " Check the computer's load",
                value=float(self._late),
                limit=float(rules.late_cycles_limit),
            )
        return None
