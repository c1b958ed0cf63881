"""`StopOrders`: whether the task must stop, by person, program, service or recorder."""

from __future__ import annotations

from collections.abc import Callable

from acquisition.supervision.stop_reason import StopCode, StopReason
from acquisition.task.control_block import ControlBlock
from acquisition.task.service_beat import CLIENT_LOST_TEXT, ServiceBeat
from acquisition.task.states import RecorderState
from config.process.safety_clock import safety_now_s

TEXT_OF_ORDER = {
    StopCode.INTERRUPTED: "stopped by the operator",
    StopCode.STOP_COMMAND: "stopped by `rid-daq stop`",
    StopCode.STOP_BUTTON: "stopped by the page's stop button",
    StopCode.CLIENT_LOST: CLIENT_LOST_TEXT,
    StopCode.RECORDER: "the recorder process has died; what it had written is kept",
    StopCode.PLATE_LINE: "the force plate's rows have ended",
    StopCode.PLATE_OVERLOAD: "the force plate was overloaded in more periods than can be left out",
}


class StopOrders:
    """Orders to stop; the first one stays.

    Args:
        control: Where requests to stop, and the recorder's troubles, are found.
        orphaned: Whether the program that started the task is gone.
        service: Signs of life of the service that has ordered the motion, if one has.
        now_s: The safety clock [s].
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
        """Return why the task must stop; None if it may go on."""
        self._first = self._first or self._look()
        return self._first

    def _look(self) -> StopReason | None:
        control = self._control
        if control.program.stop_code:
            code = StopCode(control.program.stop_code)
            return StopReason(code, TEXT_OF_ORDER.get(code, code.name.lower()))
        if control.recorder.state in (RecorderState.FAILED, RecorderState.ENDING):
            return StopReason(StopCode.RECORDER, str(control.recorder.error))
        if self._orphaned():
            return StopReason(StopCode.PROGRAM_GONE, "the program that started the motion is gone")
        return None if self._service is None else self._service.reason(self._now_s())

    def given(self) -> bool:
        """Return whether there is an order to stop."""
        return self.reason() is not None
