"""`DriveService`: what is asked of the drives one by one, outside the cyclic exchange."""

from __future__ import annotations

from collections.abc import Sequence

from config.cell.cell import CellConfig, DriveAxis
from drivers.ports.can_link import CanLink
from drivers.servo.bring_up import listen_for_masters
from drivers.servo.cia402 import PowerState, state_of
from drivers.servo.drive_watch import DriveWatch
from drivers.servo.fault_reset import FaultReset, reset_fault
from drivers.servo.sdo_port import SdoPort


class DriveService:
    """Questions and orders by SDO that switch no power on.

    Parameters
    ----------
    link, cell : CanLink, CellConfig
        The open bus and its cell. The constructor does not use the bus.
    axes : sequence of DriveAxis
        The drives, in the order of the robot's joints.
    watch : DriveWatch
        Takes what else comes from the drives meanwhile.
    """

    def __init__(
        self, link: CanLink, cell: CellConfig, axes: Sequence[DriveAxis], watch: DriveWatch
    ) -> None:
        self._link = link
        self._cell = cell
        self._axes = tuple(axes)
        self._watch = watch

    def reset_faults(self) -> tuple[FaultReset, ...]:
        """Reset the drives that are in fault, as a person has asked; no power, no motion.

        Raises
        ------
        LockedError
            Another master is active on the bus.
        DeviceTimeoutError
            A drive does not answer.
        TransportError
            The bus is gone.
        """
        listen_for_masters(self._link, self._cell, self._watch)
        return tuple(reset_fault(self._link, axis, self._watch.handle) for axis in self._axes)

    def power_states(self) -> tuple[PowerState, ...]:
        """Ask every drive for its state.

        Raises
        ------
        DeviceTimeoutError, TransportError
            A drive does not answer, or the bus is gone.
        """
        return tuple(state_of(port.read_int(0x6041, 0)) for port in self._ports())

    def silence_drives(self) -> None:
        """Switch the drives' own heartbeats off until the next bring-up: a trial of our watch.

        Raises
        ------
        DeviceTimeoutError, TransportError
            A drive does not answer, or the bus is gone.
        """
        for port in self._ports():
            port.write(0x1017, 0, bytes(2))

    def _ports(self) -> list[SdoPort]:
        return [SdoPort(self._link, axis.node_id, self._watch.handle) for axis in self._axes]
