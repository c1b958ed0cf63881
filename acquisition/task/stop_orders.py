"""`StopOrders`: whether anybody wants the task to stop: a person, the program or the recorder."""

from __future__ import annotations

from collections.abc import Callable

from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.states import RecorderState

TEXT_OF_ORDER = {
    StopCode.INTERRUPTED: "stopped by the operator",
    StopCode.STOP_COMMAND: "stopped by `rid-daq stop`",
    StopCode.STOP_BUTTON: "stopped by the page's stop button",
    StopCode.CLIENT_LOST: "stopped because its client is out of reach",
    StopCode.RECORDER: "the recorder process has died; what it had written is kept",
    StopCode.PLATE_LINE: "the force plate's rows have ended",
    StopCode.PLATE_OVERLOAD: "the force plate was overloaded in more periods than can be left out",
}


class StopOrders:
    """Orders to stop; once there is one, it stays.

    Parameters
    ----------
    control : ControlBlock
        Where requests to stop, and the recorder's troubles, are found.
    orphaned : callable
        Whether the program that started the task is gone.
    """

    def __init__(self, control: ControlBlock, orphaned: Callable[[], bool]) -> None:
        self._control = control
        self._orphaned = orphaned

    def reason(self) -> StopReason | None:
        """Return why the task is to stop; None where nobody wants it to."""
        control = self._control
        if control.program.stop_code:
            code = StopCode(control.program.stop_code)
            return StopReason(code, TEXT_OF_ORDER.get(code, code.name.lower()))
        if control.recorder.state in (RecorderState.FAILED, RecorderState.ENDING):
            return StopReason(StopCode.RECORDER, str(control.recorder.error))
        if self._orphaned():
            return StopReason(StopCode.PROGRAM_GONE, "the program that started the motion is gone")
        return None

    def given(self) -> bool:
        """Return whether there is an order to stop."""
        return self.reason() is not None
