"""`AxisAnswer`: what one drive said of its power state in a cycle, judged while it is enabled."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from config.errors import DeviceFaultError
from drivers.servo.cia402 import PowerState, state_of


class AxisAnswer(NamedTuple):
    """One axis in one cycle: whether it answered, and its statusword 6041h."""

    joint: str
    received: bool
    status: int

    @property
    def state(self) -> PowerState:
        """The power state of the statusword."""
        return state_of(self.status)

    def __str__(self) -> str:
        """Return the answer in words."""
        if not self.received:
            return f"{self.joint} is silent"
        return f"{self.joint} is {self.state.words} (6041h={self.status:04X}h)"


def answers_of(
    joints: Sequence[str], received: NDArray[np.bool_], statusword: NDArray[np.uint16]
) -> list[AxisAnswer]:
    """Return the answers of a cycle, axis by axis; `received` and `statusword` are (axes,)."""
    return [
        AxisAnswer(joint, bool(came), status)
        for joint, came, status in zip(joints, received, statusword.tolist(), strict=True)
    ]


def refuse_fault(answers: Iterable[AxisAnswer], enabled: set[str]) -> None:
    """Refuse a drive in fault and one of `enabled` that is not any more; add those that now are.

    Raises
    ------
    DeviceFaultError
        Naming the joint and the state that its drive is in.
    """
    for answer in answers:
        if not answer.received:
            continue
        state = answer.state
        faulty = state in (PowerState.FAULT, PowerState.FAULT_REACTION_ACTIVE)
        if faulty or (answer.joint in enabled and state is not PowerState.OPERATION_ENABLED):
            raise DeviceFaultError(
                f"{answer.joint}: the drive is {state.words}; find the cause, then begin again"
            )
        if state is PowerState.OPERATION_ENABLED:
            enabled.add(answer.joint)
