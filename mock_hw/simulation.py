"""`CellSimulation`: the simulated parts of a cell, and the settings of each simulated device."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

from config.cell.amplifier_profile import AmplifierProfile
from config.cell.cell import CanBusConfig, CellConfig
from config.cell.drive_profile import DriveProfile
from config.cell.monitor import ModbusRtu, ModbusTcp
from config.cell.plate import PlateConfig
from config.errors import ConfigError
from config.load import load_bundled_or_path
from config.robot.robot import RobotDescription
from config.simulation.faults import NO_SCRIPT, FaultScript
from config.simulation.plant import PlantConfig, SimulatedPlate
from mock_hw.amplifier.settings import PlateSettings
from mock_hw.bus.hub_process import HubSettings
from mock_hw.bus.served_bus import ONE_PROCESS, SIMULATED, served_name, with_served_channel
from mock_hw.host.fault_clock import controlword_places, refuse_unknown_joints
from mock_hw.plant.load_transfer import LoadTransfer
from mock_hw.registers.server import RegisterSettings, ServerCertificates


@dataclass(frozen=True)
class CellSimulation:
    """The simulated parts of a cell, and the settings of the simulation.

    Attributes:
        cell: The cell file: bus, drives, and the other devices that are connected to the computer.
        robot: Description of the robot, as in the robot file.
        plant: True parameters of the robot.
        realtime: True for real time. False for lock-step, in which simulated time advances only
            while master and devices wait.
        pace: In lock-step on `rid_sim`, largest number of simulated seconds per second; None for no
            limit.
        seed: Random seed of all noise. In lock-step, equal seeds give equal bytes on the bus.
        directory: Folder for the socket of the bus, whose name is the channel in the cell file;
            None for a private folder that is removed at the end.
        unmodelled: True to simulate the effects under `unmodelled` in the plant file.
        log: File to which all frames are written in candump's format; None for no file.
        faults: Fault script. The faults in its part `program` affect the process that runs
            `SimulatedCell`, and the processes that this process starts.
        amplifier_profile: Profile of the plate's amplifier; None for the profile that the cell
            names.
        amplifier_baud_rate: Baud rate of the amplifier, if it differs from the cell file [bit/s].
        drive_profile: Profile of the drives' registers; None for the profile that the cell names.
        certificates: TLS certificates of the drives, if the cell's monitor uses TLS.
        tracker_file: File to which the plant's tracker writes its measurements; None for no file.
        load_transfers: Changes of the payload during each motion.

    Raises:
        ValueError: The fault script names joints that the robot does not have.
    """

    cell: CellConfig
    robot: RobotDescription
    plant: PlantConfig
    realtime: bool
    seed: int
    directory: Path | None = None
    unmodelled: bool = True
    log: Path | None = None
    faults: FaultScript = NO_SCRIPT
    amplifier_profile: AmplifierProfile | None = None
    amplifier_baud_rate: int | None = None
    drive_profile: DriveProfile | None = None
    certificates: ServerCertificates | None = None
    pace: float | None = None
    tracker_file: Path | None = None
    load_transfers: tuple[LoadTransfer, ...] = ()

    def __post_init__(self) -> None:
        refuse_unknown_joints(self.faults, self.robot.joint_names)

    @property
    def truth(self) -> PlantConfig:
        """The plant that is simulated, with or without unmodelled effects."""
        return self.plant if self.unmodelled else self.plant.without_unmodelled()

    @property
    def name(self) -> str:
        """Name with which all files of the simulated cell begin."""
        return served_name(self.cell).rsplit("/", 1)[-1]

    @property
    def private(self) -> bool:
        """True if the simulation has a private folder, which is removed at the end."""
        return self.directory is None

    def with_payload(self, payload: str | None) -> CellSimulation:
        """Return the simulation with another payload on the flange; None for an empty flange.

        Raises:
            ConfigError: The plant has no such payload.
        """
        return replace(self, plant=self.plant.with_payload(payload))

    def bus(self, folder: Path) -> CanBusConfig | None:
        """Return the bus that the drives join, with its channel; None for the hub of `rid_sim`.

        Raises:
            ConfigError: The bus does not support a setting of the simulation.
        """
        cell, can = self.cell, self.cell.can
        if can.interface == SIMULATED:
            return None
        refusals = (
            (
                not self.realtime,
                "RID-MOCK-REAL-TIME",
                f"can.interface {can.interface} runs in real time only; for lock-step time use"
                f" {SIMULATED}",
            ),
            (
                self.log is not None,
                "RID-CAN-INTERFACE",
                f"only {SIMULATED} can log frames; on {can.interface} use candump or can_logger",
            ),
            (
                bool(self.faults.bus),
                "RID-FAULT-SCRIPT",
                f"the bus part of a fault script works only on {SIMULATED}, but can.interface is"
                f" {can.interface}; remove it from the script",
            ),
            (
                can.interface == ONE_PROCESS and bool(cell.plate or cell.monitor),
                "RID-CAN-INTERFACE",
                f"can.interface {ONE_PROCESS} supports drives only; remove plate and monitor from"
                " the cell",
            ),
        )
        for refused, code, why in refusals:
            if refused:
                raise ConfigError(f"cell {cell.name}: {why}", code=code)
        if can.interface == "slcan" and self.private:
            return can.model_copy(update={"channel": str(folder / f"{self.name}.tty")})
        return with_served_channel(can)

    def hub(self, socket: Path) -> HubSettings:
        """Return the settings of a hub that listens at `socket`."""
        return HubSettings(
            socket,
            self.cell.can.bitrate,
            self.realtime,
            self.cell.can.channel.rsplit("/", 1)[-1],
            self.log,
            private_folder=self.private,
            faults=self.faults,
            nodes={axis.joint: axis.node_id for axis in self.cell.axes},
            master=self.cell.drive_safety.master_node_id,
            places=controlword_places(self.cell),
            pace=self.pace,
        )

    def plate(self, path: Path) -> PlateSettings | None:
        """Return the settings of the plate with a port at `path`; None if the cell has no plate.

        If the plant file has no plate, the simulated plate has exactly the values in the cell file.

        Raises:
            ConfigError: The amplifier profile that the cell names cannot be read.
        """
        plate = self.cell.plate
        if plate is None:
            return None
        profile = self.amplifier_profile
        if profile is None:
            profile = load_bundled_or_path(plate.amplifier.profile, "profiles", AmplifierProfile)
        return PlateSettings(
            plate,
            profile,
            self.plant.plate or _plate_as_described(plate),
            path,
            self.seed,
            self.amplifier_baud_rate,
            self.faults,
        )

    def registers(self, path: Path) -> RegisterSettings | None:
        """Return the settings of the drives' registers; None if the cell has no monitor.

        Raises:
            ConfigError: The register profile that the cell names cannot be read.
        """
        monitor = self.cell.monitor
        if monitor is None:
            return None
        profile = self.drive_profile
        if profile is None:
            profile = load_bundled_or_path(monitor.profile, "profiles", DriveProfile)
        if self.private and isinstance(monitor.link, ModbusTcp):
            free = monitor.link.model_copy(update={"port": 0})  # any free port
            monitor = monitor.model_copy(update={"link": free})
        return RegisterSettings(monitor, profile, path, self.certificates, self.faults.registers)


def on_pseudo_terminal(link: ModbusRtu, path: Path) -> ModbusRtu:
    """Return a serial link with the path of a pseudo-terminal, which supports no parity."""
    return link.model_copy(update={"address": str(path), "parity": "none"})


def with_address(cell: CellConfig, address: str) -> CellConfig:
    """Return the cell with another address of the plate's amplifier, if the cell has a plate."""
    if cell.plate is None or not address:
        return cell
    amplifier = cell.plate.amplifier.model_copy(update={"address": address})
    plate = cell.plate.model_copy(update={"amplifier": amplifier})
    return cell.model_copy(update={"plate": plate})


def _plate_as_described(plate: PlateConfig) -> SimulatedPlate:
    return SimulatedPlate(
        sensitivity_pc_n=plate.amplifier.sensitivity_pc_n, crosstalk=plate.sensitivity
    )
