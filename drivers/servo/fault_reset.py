"""Reset of a drive's fault: on a user's command, or of a fault that the watchdog test caused.

The reset is a rising edge of bit 7 of 6040h (CiA 402-2, T15), written by SDO, without power and
before the cyclic exchange. It enables no drive: a motion needs the complete bring-up afterwards.
"""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from config.cell.cell import DriveAxis
from drivers.canopen.emcy import code_text
from drivers.canopen.frames import Frame
from drivers.canopen.sdo import SdoAbort, abort_text
from drivers.ports.can_link import CanLink
from drivers.servo.cia402 import ControlWord, PowerState, state_of
from drivers.servo.sdo_port import SdoPort

RESET_TIMEOUT_S = 1.0
LOOK_S = 0.02


@dataclass(frozen=True, slots=True)
class FaultReset:
    """A drive's states before and after a reset of its fault.

    Attributes:
        joint, node_id: The drive.
        before, after: The drive's power state. If the drive was not in fault, nothing was sent, and
            both are equal. If it does not state its power state or error code, both are
            `NOT_READY_TO_SWITCH_ON`.
        error: The drive's error code, in words; empty if there was no fault.
        refusal: Reason why a fault was not reset: the drive refused to read or write an object, or
            the fault was not to be reset; otherwise empty.
    """

    joint: str
    node_id: int
    before: PowerState
    after: PowerState
    error: str = ""
    refusal: str = ""

    @property
    def was_faulty(self) -> bool:
        """True if the drive was in fault before."""
        return self.before.faulty

    @property
    def is_faulty(self) -> bool:
        """True if the drive is still in fault."""
        return self.after.faulty


def reset_fault(
    link: CanLink,
    axis: DriveAxis,
    others: Callable[[Frame, float], None],
    codes: Collection[int] | None = None,
) -> FaultReset:
    """Reset a drive's fault, if it has one.

    Args:
        link: The bus.
        axis: The drive.
        others: Handler of frames that are not this drive's SDO answers, with their time [s].
        codes: Error codes (603Fh) of the faults to reset; None to reset every fault.

    Raises:
        DeviceTimeoutError: The drive does not answer.
        TransportError: The bus is lost.
    """
    port = SdoPort(link, axis.node_id, others)
    joint, node = axis.joint, axis.node_id
    try:
        before = state_of(port.read_int(0x6041, 0))
        if not before.faulty:
            return FaultReset(joint, node, before, before)
        code = port.read_int(0x603F, 0)
    except SdoAbort as abort:
        unknown = PowerState.NOT_READY_TO_SWITCH_ON
        return FaultReset(joint, node, unknown, unknown, refusal=abort_text(abort.code))
    error = f"{code_text(code)} ({code:04X}h)"
    if codes is not None and code not in codes:
        return FaultReset(joint, node, before, before, error, "not the fault to reset")
    try:
        for word in (ControlWord.DISABLE_VOLTAGE, ControlWord.FAULT_RESET):
            port.write(0x6040, 0, word.to_bytes(2, "little"))
        after = _wait_until_reset(link, port, others)
        port.write(0x6040, 0, ControlWord.DISABLE_VOLTAGE.to_bytes(2, "little"))
    except SdoAbort as abort:
        return FaultReset(joint, node, before, before, error, abort_text(abort.code))
    return FaultReset(joint, node, before, after, error)


def _wait_until_reset(
    link: CanLink, port: SdoPort, others: Callable[[Frame, float], None]
) -> PowerState:
    """Wait until the drive is no longer in fault, at most `RESET_TIMEOUT_S`; return its state."""
    until_s = link.clock.now_s() + RESET_TIMEOUT_S
    while (state := state_of(port.read_int(0x6041, 0))).faulty:
        if link.clock.now_s() >= until_s:
            break
        look_s = link.clock.now_s() + LOOK_S
        while (frame := link.receive(look_s)) is not None:
            others(frame, link.last_time_s)
    return state
