"""`DriveService`: requests to single drives, outside the cyclic exchange."""

from __future__ import annotations

import contextlib
from collections.abc import Collection, Sequence

from config.cell.cell import CellConfig, DriveAxis
from config.errors import DeviceTimeoutError
from drivers.canopen.nmt import NmtCommand, nmt_frame
from drivers.canopen.sdo import SdoAbort
from drivers.ports.can_link import CanLink
from drivers.ports.clock import Clock
from drivers.servo.bring_up import listen_for_masters
from drivers.servo.cia402 import ControlWord, PowerState, state_of
from drivers.servo.drive_settings import read_objects
from drivers.servo.drive_watch import DriveWatch
from drivers.servo.fault_reset import FaultReset, reset_fault
from drivers.servo.sdo_port import SdoPort
from drivers.settings.object_list import COMMUNICATION_SETTINGS
from drivers.settings.write_log import WriteLog


class DriveService:
    """Requests to single drives by SDO; no request switches power on.

    Args:
        link, cell: The open bus and its cell. The constructor does not use the bus.
        axes: The drives, in the order of the robot's joints.
        watch: Monitor of the drives' other frames.
        write_log: Log of the values that are written by SDO, with the previous values; a reset of
            faults is not logged.
    """

    def __init__(
        self,
        link: CanLink,
        cell: CellConfig,
        axes: Sequence[DriveAxis],
        watch: DriveWatch,
        write_log: WriteLog | None = None,
    ) -> None:
        self._link = link
        self._cell = cell
        self._axes = tuple(axes)
        self._watch = watch
        self._write_log = write_log

    def claim_bus(self) -> None:
        """Make sure that no other master is active on the bus, before the first frame is sent.

        Raises:
            LockedError: Another master is active.
        """
        listen_for_masters(self._link, self._cell, self._watch)

    def ports(self, timeout_s: float = 0.5) -> list[SdoPort]:
        """Return an SDO port for each drive; `timeout_s` is the longest wait for an answer [s]."""
        return [
            SdoPort(self._link, axis.node_id, self._watch.handle, timeout_s, self._write_log)
            for axis in self._axes
        ]

    def leave_operational(self) -> None:
        """Switch every drive to NMT pre-operational, the state in which PDOs can be configured."""
        for axis in self._axes:
            self._link.send(nmt_frame(NmtCommand.ENTER_PRE_OPERATIONAL, axis.node_id))

    def log_before_reset(self) -> None:
        """Log the values that a reset of the communication discards, once for each drive.

        A drive that does not answer is skipped; its bring-up fails afterwards.
        """
        for port in self.ports():
            if self._write_log is None or self._write_log.knows(port.node_id):
                continue
            with contextlib.suppress(DeviceTimeoutError):
                for address, value in read_objects(port, COMMUNICATION_SETTINGS):
                    port.log_change(self._write_log, address, value, None)

    def reset_faults(
        self, codes: Sequence[Collection[int]] | None = None
    ) -> tuple[FaultReset, ...]:
        """Reset the drives that are in fault, on a user's request or after the watchdog test.

        No drive gets power.

        Args:
            codes: For each drive, the error codes (603Fh) of the faults to reset; None to reset
                all faults.

        Raises:
            LockedError: Another master is active on the bus.
            DeviceTimeoutError: A drive does not answer.
            TransportError: The bus is lost.
        """
        self.claim_bus()
        each = [None] * len(self._axes) if codes is None else codes
        return tuple(
            reset_fault(self._link, axis, self._watch.handle, only)
            for axis, only in zip(self._axes, each, strict=True)
        )

    def power_states(self) -> tuple[PowerState, ...]:
        """Return every drive's power state.

        Raises:
            DeviceTimeoutError, TransportError: A drive does not answer, or the bus is lost.
        """
        return tuple(state_of(port.read_int(0x6041, 0)) for port in self.ports())

    def switch_off(self) -> tuple[str, ...]:
        """Switch every drive's power off by SDO, which also reaches drives outside the exchange.

        Returns:
            The joints whose drive still has power.

        Raises:
            DeviceTimeoutError, TransportError: A drive does not answer, or the bus is lost.
        """
        for port in self.ports():
            with contextlib.suppress(SdoAbort):
                port.write(0x6040, 0, ControlWord.DISABLE_VOLTAGE.to_bytes(2, "little"))
        states = zip(self._axes, self.power_states(), strict=True)
        return tuple(axis.joint for axis, state in states if state.powered)

    def error_codes(self) -> tuple[int, ...]:
        """Return every drive's last error code (603Fh); 0 for a drive that does not report it.

        Raises:
            DeviceTimeoutError, TransportError: A drive does not answer, or the bus is lost.
        """
        found = []
        for port in self.ports():
            try:
                found.append(port.read_int(0x603F, 0))
            except SdoAbort:
                found.append(0)
        return tuple(found)

    def silence_drives(self, clock: Clock) -> tuple[float, ...]:
        """Switch off the drives' heartbeats until the next bring-up, to test their monitoring.

        Drives with life guarding send no heartbeat: they are silent while they get no request.

        Returns:
            Time since which each drive is silent [s].

        Raises:
            DeviceTimeoutError, TransportError: A drive does not answer, or the bus is lost.
        """
        since_s = [clock.now_s()] * len(self._axes)
        heartbeats = zip(self.ports(), self._watch.heartbeats, strict=True)
        for number, (port, consumer) in enumerate(heartbeats):
            if not consumer.guarded:
                port.write(0x1017, 0, bytes(2))
                since_s[number] = clock.now_s()
        return tuple(since_s)
