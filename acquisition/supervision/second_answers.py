"""`SecondAnswers`: detection of another device that answers with a drive's identifier."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from acquisition.supervision.stop_reason import StopCode, StopReason
from config.cell.cell import CellConfig
from config.robot.robot import RobotDescription
from drivers.canopen.frames import tpdo_cob_id

WINDOW = 100


class SecondAnswers:
    """Counter of cycles in which a drive's identifier answered more than once.

    A rare second answer is harmless: a CAN controller that detects an error at the very end of a
    frame sends the frame again. `supervision.second_answers_limit` second answers in `WINDOW`
    cycles mean that another device sends with the same identifier.
    """

    def __init__(self, cell: CellConfig, robot: RobotDescription) -> None:
        node_of = {axis.joint: axis.node_id for axis in cell.axes}
        self._names = robot.joint_names
        self._nodes = [node_of[name] for name in self._names]
        self._limit = cell.supervision.second_answers_limit
        self.begin([0] * len(self._names))

    def begin(self, counts: Sequence[int]) -> None:
        """Restart with the present counts; for their meaning, see `check`."""
        self._cycle = 0
        self._counts = counts  # numbers of answers in the last cycle
        self._seen: list[deque[int]] = [deque(maxlen=self._limit) for _ in self._names]

    def check(self, counts: Sequence[int]) -> StopReason | None:
        """Return the reason to stop after a cycle; None if the motion may continue.

        Args:
            counts: For each drive, number of cycles so far in which its identifier answered more
                than once.
        """
        before, self._counts = self._counts, counts
        self._cycle += 1
        if counts == before:
            return None
        for i, seen in enumerate(self._seen):
            seen.extend([self._cycle] * (counts[i] - before[i]))
            if len(seen) == self._limit and self._cycle - seen[0] < WINDOW:
                return self._reason(i)
        return None

    def explain(self, i: int) -> StopReason | None:
        """Return the reason to stop after a second answer in this cycle; None without one."""
        seen = self._seen[i]
        if not seen or seen[-1] != self._cycle:
            return None
        return self._held_up() if self._in_a_bunch else self._reason(i)

    @property
    def _in_a_bunch(self) -> bool:
        """True if every drive answered more than once in this cycle, and none in the last cycle.

        The cause is this computer or its adapter: SYNCs of earlier cycles were delayed and then
        transmitted together.
        """
        return all(
            len(seen) > 0 and seen[-1] == self._cycle and self._cycle - 1 not in seen
            for seen in self._seen
        )

    def _held_up(self) -> StopReason:
        return StopReason(
            StopCode.MISSED_FRAMES,
            "no drive answered for some cycles, then every drive answered more than once in one"
            " cycle: frames of this computer were delayed and sent together. Check the adapter,"
            " its cable and the termination (frames without acknowledge are sent again)",
        )

    def _reason(self, i: int) -> StopReason:
        node, cycles = self._nodes[i], len(self._seen[i])
        return StopReason(
            StopCode.SECOND_ANSWERS,
            f"joint {self._names[i]}: two devices send with the identifier of its drive, node"
            f" {node}: a second answer came in {cycles} cycles. Look for another drive with node id"
            f" {node}, and for a program or gateway that sends {tpdo_cob_id(node):03X}h",
            joint=self._names[i],
            value=float(cycles),
            limit=float(self._limit),
        )
