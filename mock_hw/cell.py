"""`SimulatedCell`: a cell's drives and robot on a simulated bus, in processes of their own."""

from __future__ import annotations

import contextlib
import multiprocessing
import threading
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType

from config.cell.amplifier_profile import AmplifierProfile
from config.cell.cell import CanBusConfig, CellConfig
from config.cell.drive_profile import DriveProfile
from config.cell.monitor import ModbusRtu, ModbusTcp, MonitorConfig
from config.cell.plate import PlateConfig
from config.errors import ConfigError, TransportError
from config.load import load_bundled_or_path
from config.robot.robot import RobotDescription
from config.simulation.faults import NO_SCRIPT, FaultScript
from config.simulation.plant import PlantConfig, SimulatedPlate
from mock_hw.amplifier.line_faults import NO_FAULTS, LineFaults, line_faults
from mock_hw.amplifier.port import PlateSettings
from mock_hw.bus.hub_process import HubSettings, serve_hub
from mock_hw.bus.served_bus import ONE_PROCESS, SIMULATED, as_served, served_name
from mock_hw.drives_process import DrivesSettings, serve_drives, serve_until
from mock_hw.host.device_process import DeviceProcess, wait_until_ready
from mock_hw.host.fault_clock import refuse_unknown_joints
from mock_hw.host.program_faults import ProgramFaults
from mock_hw.host.runtime_directory import (
    plate_path,
    private_folder,
    registers_path,
    socket_path,
)
from mock_hw.plant.snapshot import AxisSnapshot, SnapshotReader
from mock_hw.registers.registers import (
    NO_REGISTER_FAULTS,
    RegisterFaults,
    script_register_faults,
)
from mock_hw.registers.server import RegisterSettings, ServerCertificates


class SimulatedCell:
    """A served simulated cell: ``with SimulatedCell(...) as simulated: ...``.

    The cell's `can.interface` says on which bus: `rid_sim` is the hub, with wire time and both
    clocks; `slcan` a simulated adapter on a pseudo-terminal; `virtual` is in this process, for the
    drives alone; on any other of python-can's, such as `socketcan` or `udp_multicast`, the drives
    are put on the bus that is there, in real time.

    Entering starts the hub and the drives and returns when they are on the bus; leaving ends them
    and removes what they left. They also end by themselves some seconds after the process that
    started them has died - late enough for the drives to notice, and stop.

    Parameters
    ----------
    cell, robot, plant
        What is simulated.
    realtime
        Real time; otherwise lock-step, where the master's waits move time on.
    seed
        Of everything random: in lock-step the same seed gives the same bytes on the bus.
    directory
        Where to serve the bus, under the name that the cell file gives its channel; None for a
        private folder that is removed at the end.
    unmodelled
        Whether the plant has the effects that no estimator's model has.
    log
        Where to write all frames, in candump's format; None for nowhere.
    profile
        What the plate's amplifier speaks; the bundled profile of the cell's name when left out.
    plate_faults
        What goes wrong on the amplifier's line.
    amplifier_baud_rate
        What the amplifier is set to, where that is not what the cell file says.
    drive_profile
        The drives' registers; the bundled profile of the cell's name when left out.
    register_faults
        What goes wrong when registers are read.
    certificates
        What the drives show and want to see, where the cell's monitor uses TLS.
    faults
        What goes wrong, on every line of the cell; its `amplifier` and `registers` parts stand for
        `plate_faults` and `register_faults`, where those are left out. Its `program` part happens
        to this process and the processes that it starts.

    Raises
    ------
    ValueError
        The faults are of joints that the robot does not have.
    TransportError
        The bus or the drives cannot be served.
    """

    def __init__(
        self,
        cell: CellConfig,
        robot: RobotDescription,
        plant: PlantConfig,
        *,
        realtime: bool,
        seed: int,
        directory: Path | None = None,
        unmodelled: bool = True,
        log: Path | None = None,
        profile: AmplifierProfile | None = None,
        plate_faults: LineFaults = NO_FAULTS,
        amplifier_baud_rate: int | None = None,
        drive_profile: DriveProfile | None = None,
        register_faults: RegisterFaults = NO_REGISTER_FAULTS,
        certificates: ServerCertificates | None = None,
        faults: FaultScript = NO_SCRIPT,
    ) -> None:
        refuse_unknown_joints(faults, robot.joint_names)
        self._faults = faults
        self._cell = cell
        self._robot = robot
        self._plant = plant if unmodelled else plant.without_unmodelled()
        self._realtime = realtime
        self._seed = seed
        self._directory = directory
        self._log = log
        self._profile = profile
        self._plate_faults = plate_faults
        if faults.amplifier and plate_faults is NO_FAULTS:
            self._plate_faults = line_faults(faults)
        self._amplifier_baud_rate = amplifier_baud_rate
        self._drive_profile = drive_profile
        self._register_faults = register_faults
        if faults.registers and register_faults is NO_REGISTER_FAULTS:
            self._register_faults = script_register_faults(faults)
        self._certificates = certificates
        self._address = ""
        self._monitor: MonitorConfig | None = None
        self._stack = contextlib.ExitStack()
        self._channel = ""
        self._snapshots: SnapshotReader | None = None

    @property
    def channel(self) -> str:
        """What to put into the cell's `can.channel`."""
        return self._channel

    @property
    def cell(self) -> CellConfig:
        """The cell with the channel and the ports under which it is served."""
        can = self._cell.can.model_copy(update={"channel": self._channel})
        update: dict[str, object] = {"can": can}
        if self._monitor is not None:
            update["monitor"] = self._monitor
        return with_address(self._cell.model_copy(update=update), self._address)

    @property
    def address(self) -> str:
        """The path of the plate amplifier's serial port; empty where there is no plate."""
        return self._address

    def axes(self) -> AxisSnapshot:
        """Return where the axes really are, at most some milliseconds old.

        Raises
        ------
        TransportError
            The cell is not served.
        """
        if self._snapshots is None:
            raise TransportError("this simulated cell is not running; enter it with 'with' first")
        return self._snapshots.read()

    @property
    def payloads(self) -> tuple[str, ...]:
        """The bodies that can be mounted on the flange."""
        return tuple(self._plant.payloads)

    @property
    def attached(self) -> str | None:
        """What hangs on the flange."""
        return self._plant.attached

    def attach(self, payload: str | None) -> None:
        """Mount a payload on the flange, or take off what hangs there (None), as a person would.

        Raises
        ------
        ConfigError
            The plant has no such payload.
        TransportError
            The cell is not served, or a drive is powered: nobody may reach into the cell then.
        """
        plant = self._plant.with_payload(payload)
        if self.axes().enabled.any():
            raise TransportError("a payload is mounted while the drives are without power only")
        assert self._snapshots is not None
        names = [None, *plant.payloads]
        self._snapshots.ask_for_payload(names.index(payload))
        self._plant = plant

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
        self._snapshots = None
        self._stack.__exit__(kind, error, traceback)

    def _start(self, stack: contextlib.ExitStack) -> None:
        name = served_name(self._cell).rsplit("/", 1)[-1]
        folder = self._directory
        if folder is None:
            folder = stack.enter_context(private_folder(name))
        socket = socket_path(str(folder / f"{name}.sock"))
        snapshot = socket.with_suffix(".axes")
        bus = self._other_bus(folder, name)
        drives = DrivesSettings(
            self._cell,
            self._robot,
            self._plant,
            self._seed,
            self._realtime,
            socket,
            snapshot,
            self._plate_settings(plate_path(str(socket))),
            self._register_settings(registers_path(str(socket))),
            self._faults,
            bus,
            private_folder=bus is not None and self._directory is None,
        )
        if bus is not None and bus.interface == ONE_PROCESS:
            drives_pipe = _launch_thread(stack, drives)
        else:
            hub = None if bus is not None else DeviceProcess(serve_hub, self._hub(socket))
            if hub is not None:
                stack.callback(hub.end)
            process = DeviceProcess(serve_drives, drives)
            stack.callback(process.end)
            drives_pipe = process.pipe
            if hub is not None:
                wait_until_ready("cell's hub", hub.pipe)
        drives_pipe.send(None)
        port = wait_until_ready("cell's drives", drives_pipe)
        self._snapshots = stack.enter_context(SnapshotReader(snapshot))
        self._channel = str(socket) if bus is None else bus.channel
        self._address = "" if drives.plate is None else str(drives.plate.path)
        self._monitor = _reachable(drives.registers, port)
        if self._faults.program:
            stack.enter_context(ProgramFaults(self._faults.program, drives_pipe))

    def _hub(self, socket: Path) -> HubSettings:
        return HubSettings(
            socket,
            self._cell.can.bitrate,
            self._realtime,
            self._cell.can.channel.rsplit("/", 1)[-1],
            self._log,
            private_folder=self._directory is None,
            faults=self._faults,
            nodes={axis.joint: axis.node_id for axis in self._cell.axes},
            master=self._cell.drive_safety.master_node_id,
        )

    def _other_bus(self, folder: Path, name: str) -> CanBusConfig | None:
        """Return the bus to be served, with its channel; None for the simulated one."""
        can = self._cell.can
        if can.interface == SIMULATED:
            return None
        if not self._realtime:
            raise ConfigError(
                f"cell {self._cell.name}: on can.interface {can.interface} there is real time only;"
                f" simulated (lock-step) time is of {SIMULATED}"
            )
        if self._log is not None:
            raise ConfigError(
                f"cell {self._cell.name}: frames are logged on {SIMULATED} only; on"
                f" {can.interface} use candump or can_logger"
            )
        if self._faults.bus:
            raise ConfigError(
                f"cell {self._cell.name}: a fault script's bus part is for {SIMULATED} only, this"
                f" is {can.interface}; leave it out"
            )
        if can.interface == ONE_PROCESS and (self._cell.plate or self._cell.monitor):
            raise ConfigError(
                f"cell {self._cell.name}: on can.interface {ONE_PROCESS} there are drives only;"
                " leave out plate and monitor"
            )
        if can.interface == "slcan" and self._directory is None:
            return can.model_copy(update={"channel": str(folder / f"{name}.tty")})
        return as_served(can)

    def _plate_settings(self, path: Path) -> PlateSettings | None:
        """Return what the plate is; a plant without a plate has one that obeys its description."""
        plate = self._cell.plate
        if plate is None:
            return None
        profile = self._profile
        if profile is None:
            profile = load_bundled_or_path(plate.amplifier.profile, "profiles", AmplifierProfile)
        truth = self._plant.plate or _as_described(plate)
        return PlateSettings(
            plate,
            profile,
            truth,
            path,
            self._seed,
            self._amplifier_baud_rate,
            self._plate_faults,
        )

    def _register_settings(self, path: Path) -> RegisterSettings | None:
        monitor = self._cell.monitor
        if monitor is None:
            return None
        profile = self._drive_profile
        if profile is None:
            profile = load_bundled_or_path(monitor.profile, "profiles", DriveProfile)
        if self._directory is None and isinstance(monitor.link, ModbusTcp):
            free = monitor.link.model_copy(update={"port": 0})  # any that is free
            monitor = monitor.model_copy(update={"link": free})
        return RegisterSettings(
            monitor, profile, path, self._certificates, faults=self._register_faults
        )


def _reachable(registers: RegisterSettings | None, port: int | None) -> MonitorConfig | None:
    """Return the monitor with the address that its drives are served at."""
    if registers is None:
        return None
    link: ModbusTcp | ModbusRtu = registers.monitor.link
    if isinstance(link, ModbusTcp):
        link = link.model_copy(update={"port": port})
    else:
        link = on_pseudo_terminal(link, registers.path)
    return registers.monitor.model_copy(update={"link": link})


def on_pseudo_terminal(link: ModbusRtu, path: Path) -> ModbusRtu:
    """Return a serial line that is a pseudo-terminal, which has no parity to be set."""
    return link.model_copy(update={"address": str(path), "parity": "none"})


def with_address(cell: CellConfig, address: str) -> CellConfig:
    """Return a cell whose plate, if it has one, is found at another address."""
    if cell.plate is None or not address:
        return cell
    amplifier = cell.plate.amplifier.model_copy(update={"address": address})
    plate = cell.plate.model_copy(update={"amplifier": amplifier})
    return cell.model_copy(update={"plate": plate})


def _as_described(plate: PlateConfig) -> SimulatedPlate:
    return SimulatedPlate(
        sensitivity_pc_n=plate.amplifier.sensitivity_pc_n, crosstalk=plate.sensitivity
    )


def _launch_thread(stack: contextlib.ExitStack, settings: DrivesSettings) -> Connection:
    """Start the drives in this process, on the only bus that does not leave it."""
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
