"""`StopOrders`: stop orders of user, program, service and recorder for the cyclic task."""

from __future__ import annotations

from collections.abc import Callable

from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.service_beat import CLIENT_LOST_TEXT, ServiceBeat
from acquisition.task.states import RecorderState
from config.process.safety_clock import safety_now_s

TEXT_OF_ORDER = {
    StopCode.INTERRUPTED: "stopped by the user or by the end of the program",
    StopCode.STOP_COMMAND: "stopped by `rid-daq stop`",
    StopCode.STOP_BUTTON: "stopped by the page's stop button",
    StopCode.CLIENT_LOST: CLIENT_LOST_TEXT,
    StopCode.RECORDER: "the recorder process has died; the rows that it has written are kept",
    StopCode.PLATE_LINE: "the force plate sends no more rows",
    StopCode.PLATE_OVERLOAD: "the force plate was overloaded in too many periods",
}


class StopOrders:
    """Orders to stop; the first one is kept.

    Args:
        control: Contains stop requests and the recorder's errors.
        orphaned: Function that returns True if the program that started the task has ended.
        service: Heartbeat of the service that ordered the motion, if any.
        now_s: Function that returns the time of the safety clock [s].
    """

    def __init__(
        self,
        control: ControlBlock,
        orphaned: Callable[[], bool],
        service: ServiceBeat | None = None,
        now_s: Callable[[], float] = safety_now_s,
    ) -> None:
        self._control = control
        self._orphaned = orphaned
        self._service = service
        self._now_s = now_s
        self._first: StopReason | None = None

    def reason(self) -> StopReason | None:
        """Return the reason to stop; None if the motion may continue."""
        self._first = self._first or self._find_reason()
        return self._first

    def _find_reason(self) -> StopReason | None:
        control = self._control
        if control.program.stop_code:
            code = StopCode(control.program.stop_code)
            return StopReason(code, TEXT_OF_ORDER.get(code, code.name.lower()))
        if control.recorder.state in (RecorderState.FAILED, RecorderState.ENDING):
            return StopReason(StopCode.RECORDER, str(control.recorder.error))
        if self._orphaned():
            return StopReason(
                StopCode.PROGRAM_GONE, "the program that started the motion has ended"
            )
        return None if self._service is None else self._service.reason(self._now_s())

    def is_stop_ordered(self) -> bool:
        """Return True if a stop was ordered."""
        return self.reason() is not None
