"""`SimulatedCell`: a cell's simulated drives and robot on a bus, in separate processes."""

from __future__ import annotations

import contextlib
import multiprocessing
import threading
from collections.abc import Callable
from multiprocessing.connection import Connection
from types import TracebackType
from typing import Any

from config.cell.cell import CellConfig
from config.cell.monitor import ModbusTcp, MonitorConfig
from config.errors import TransportError
from mock_hw.bus.hub_process import serve_hub
from mock_hw.bus.served_bus import ONE_PROCESS
from mock_hw.drives_settings import DrivesSettings
from mock_hw.host.device_process import DeviceProcess, wait_until_ready
from mock_hw.host.hosted_process import HostedProcess
from mock_hw.host.program_faults import ProgramFaults
from mock_hw.host.runtime_directory import plate_path, private_folder, registers_path, socket_path
from mock_hw.plant.load_transfer import MotionMarker
from mock_hw.plant.snapshot import AxisSnapshot, SnapshotReader
from mock_hw.registers.server import RegisterSettings
from mock_hw.simulation import CellSimulation, on_pseudo_terminal, with_address


class SimulatedCell:
    """A running simulated cell: ``with SimulatedCell(simulation) as simulated: ...``.

    The cell's `can.interface` selects the bus. `rid_sim` is the simulated bus (hub) with
    transmission times; it supports real time, in which the hub has its own process, and
    lock-step, in which the hub is in the drives' process. `slcan` is a simulated adapter on a
    pseudo-terminal. `virtual` is a bus within this process, for drives only. On any other interface
    of python-can, such as `socketcan` or `udp_multicast`, the drives join the existing bus in real
    time.

    Entering the context starts the hub and the drives, and returns when they are on the bus.
    Leaving the context ends them and removes their files. Hub and drives also end by themselves
    some seconds after the process that started them has died; in this time the drives detect the
    loss of their master and stop.

    Args:
        simulation: The simulated cell and its settings.

    Raises:
        ConfigError: On entering: the cell's bus does not support a setting of the simulation.
        TransportError: On entering: the bus or the drives cannot be started.
    """

    def __init__(self, simulation: CellSimulation) -> None:
        self.simulation = simulation
        self._address = ""
        self._monitor: MonitorConfig | None = None
        self._stack = contextlib.ExitStack()
        self._channel = ""
        self._snapshots: SnapshotReader | None = None
        self._host: DeviceProcess | None = None
        self._marker: MotionMarker | None = None

    @property
    def channel(self) -> str:
        """Value of `can.channel` with which a program opens the simulated bus."""
        return self._channel

    @property
    def cell(self) -> CellConfig:
        """The cell, with the channel and the ports of its simulated devices."""
        described = self.simulation.cell
        can = described.can.model_copy(update={"channel": self._channel})
        update: dict[str, object] = {"can": can}
        if self._monitor is not None:
            update["monitor"] = self._monitor
        return with_address(described.model_copy(update=update), self._address)

    @property
    def address(self) -> str:
        """Path of the plate amplifier's serial port; empty without a plate."""
        return self._address

    @property
    def runs_masters(self) -> bool:
        """True if `create_master` can run a master of the bus in the drives' process."""
        return self._host is not None

    def create_master(self, target: Callable[..., None], args: tuple[Any, ...]) -> HostedProcess:
        """Return a master of the bus, not started, that runs in the drives' process.

        Master, drives and hub then exchange frames by function calls, with the same results as in
        separate processes. One master at a time runs there.

        Args:
            target: Function of a module.
            args: Its arguments.

        Raises:
            TransportError: `runs_masters` is False.
        """
        if self._host is None:
            raise TransportError(
                "this simulated cell runs no masters: it is not running, or runs in real time or"
                " with faults of the program",
                code="RID-API-ARGUMENT",
            )
        return HostedProcess(self._host, target, args)

    def axes(self) -> AxisSnapshot:
        """Return the true state of the axes, at most some milliseconds old.

        Raises:
            TransportError: The simulated cell is not running.
        """
        if self._snapshots is None:
            raise TransportError(
                "this simulated cell is not running: enter its context with 'with' first",
                code="RID-API-ARGUMENT",
            )
        return self._snapshots.read()

    @property
    def payloads(self) -> tuple[str, ...]:
        """Names of the payloads that can be mounted on the flange."""
        return tuple(self.simulation.plant.payloads)

    @property
    def attached(self) -> str | None:
        """Name of the payload on the flange; None if the flange is empty."""
        return self.simulation.plant.attached

    @property
    def motion_marker(self) -> MotionMarker | None:
        """Receiver of the first row of a motion; None if no payload changes during motions."""
        return self._marker if self.simulation.load_transfers else None

    def attach(self, payload: str | None) -> None:
        """Mount a payload on the flange, or remove the payload (None), as a person does.

        Raises:
            ConfigError: The plant has no such payload.
            TransportError: The simulated cell is not running, or a drive is powered, so that a
                person must not enter the cell.
        """
        changed = self.simulation.with_payload(payload)
        if self.axes().enabled.any():
            raise TransportError(
                "a drive is enabled: disable all drives before you mount a payload",
                code="RID-DRIVE-POWERED",
            )
        assert self._snapshots is not None
        names = [None, *self.payloads]
        self._snapshots.request_payload(names.index(payload))
        self.simulation = changed

    def __enter__(self) -> SimulatedCell:
        """Start the hub and the drives."""
        with contextlib.ExitStack() as stack:
            self._start(stack)
            self._stack = stack.pop_all()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        traceback: TracebackType | None,
    ) -> None:
        """End the hub and the drives."""
        self._snapshots = self._host = None
        self._stack.__exit__(kind, error, traceback)

    def _start(self, stack: contextlib.ExitStack) -> None:
        simulation = self.simulation
        folder = simulation.directory
        if folder is None:
            folder = stack.enter_context(private_folder(simulation.name))
        socket = socket_path(str(folder / f"{simulation.name}.sock"))
        bus = simulation.bus(folder)
        drives = DrivesSettings(
            simulation,
            socket,
            simulation.plate(plate_path(str(socket))),
            simulation.registers(registers_path(str(socket))),
            bus,
        )
        if bus is not None and bus.interface == ONE_PROCESS:
            drives_pipe = _launch_thread(stack, drives)
        else:
            hub = None
            if drives.has_hub_process:
                hub = DeviceProcess(serve_hub, simulation.hub(socket))
                stack.callback(hub.end)
            process = DeviceProcess(_serve_drives, drives)
            stack.callback(process.end)
            self._host = process if drives.hosts_masters else None
            drives_pipe = process.pipe
            if hub is not None:
                wait_until_ready("cell's hub", hub.pipe)
        drives_pipe.send(None)
        port = wait_until_ready("cell's drives", drives_pipe)
        self._snapshots = stack.enter_context(SnapshotReader(drives.snapshot))
        self._marker = MotionMarker(drives.snapshot)
        self._channel = str(socket) if bus is None else bus.channel
        self._address = "" if drives.plate is None else str(drives.plate.path)
        self._monitor = _served_monitor(drives.registers, port)
        if simulation.faults.program:
            stack.enter_context(ProgramFaults(simulation.faults.program, drives_pipe))


def _served_monitor(registers: RegisterSettings | None, port: int | None) -> MonitorConfig | None:
    """Return the monitor, with the address at which the drives' registers can be reached."""
    if registers is None:
        return None
    link = registers.monitor.link
    if isinstance(link, ModbusTcp):
        return registers.monitor.model_copy(update={"link": link.model_copy(update={"port": port})})
    return registers.monitor.model_copy(update={"link": on_pseudo_terminal(link, registers.path)})


def _serve_drives(settings: DrivesSettings, pipe: Connection) -> None:
    """Run a cell's drives; see `mock_hw.drives_process.serve_drives`."""
    from mock_hw.drives_process import serve_drives  # numba and other libraries of the drives only

    serve_drives(settings, pipe)


def _launch_thread(stack: contextlib.ExitStack, settings: DrivesSettings) -> Connection:
    """Start the drives in a thread, for the bus `virtual`, which exists within one process."""
    from mock_hw.drives_process import serve_until  # see `_serve_drives`

    ours, theirs = multiprocessing.Pipe()
    ended = threading.Event()
    thread = threading.Thread(
        target=serve_until,
        args=(settings, theirs, ended.is_set),
        kwargs={"alone": False},
        name="simulated drives",
        daemon=True,
    )
    thread.start()
    stack.callback(ours.close)
    stack.callback(thread.join)
    stack.callback(ended.set)
    return ours
