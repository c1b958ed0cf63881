"""`CellSimulation`: what of a cell is simulated and how, and the settings of each device of it."""

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
from mock_hw.amplifier.port import PlateSettings
from mock_hw.bus.hub_process import HubSettings
from mock_hw.bus.served_bus import ONE_PROCESS, SIMULATED, as_served, served_name
from mock_hw.host.fault_clock import refuse_unknown_joints
from mock_hw.registers.server import RegisterSettings, ServerCertificates


@dataclass(frozen=True)
class CellSimulation:
    """What is simulated, and how.

    Attributes:
        cell: Bus, drives, and what else hangs on the computer.
        robot: What everybody knows of the robot.
        plant: What is true of it.
        realtime: Real time; otherwise lock-step, where the master's waits move time on.
        pace: In lock-step on `rid_sim`, how many simulated seconds a second has at most; as many as
            the computer can if None.
        seed: Of everything random: in lock-step the same seed gives the same bytes on the bus.
        directory: Where to serve the bus, under the name that the cell file gives its channel; None
            for a private folder that is removed at the end.
        unmodelled: Whether the plant has the effects that no estimator's model has.
        log: Where to write all frames, in candump's format; None for nowhere.
        faults: What goes wrong, on every line of the cell. Its `program` part happens to the
            process that enters the cell and to the processes that it starts.
        amplifier_profile: What the plate's amplifier speaks; by default the bundled profile of the
            cell's name.
        amplifier_baud_rate: What the amplifier is set to, where that is not what the cell file says
            [bit/s].
        drive_profile: The drives' registers; by default the bundled profile of the cell's name.
        certificates: What the drives show and want to see, where the cell's monitor uses TLS.

    Raises:
        ValueError: The faults are of joints that the robot does not have.
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

    def __post_init__(self) -> None:
        refuse_unknown_joints(self.faults, self.robot.joint_names)

    @property
    def truth(self) -> PlantConfig:
        """The plant as it is simulated."""
        return self.plant if self.unmodelled else self.plant.without_unmodelled()

    @property
    def name(self) -> str:
        """The name of the files that are served beside the bus."""
        return served_name(self.cell).rsplit("/", 1)[-1]

    @property
    def private(self) -> bool:
        """Whether the folder is the simulation's own, to be removed at the end."""
        return self.directory is None

    def with_payload(self, payload: str | None) -> CellSimulation:
        """Return the simulation with another body of the plant on the flange, or none (None).

        Raises:
            ConfigError: The plant has no such payload.
        """
        return replace(self, plant=self.plant.with_payload(payload))

    def bus(self, folder: Path) -> CanBusConfig | None:
        """Return the bus to be served, with its channel; None for the hub of `rid_sim`.

        Raises:
            ConfigError: The bus cannot do what is asked of the simulation.
        """
        cell, can = self.cell, self.cell.can
        if can.interface == SIMULATED:
            return None
        refusals = (
            (
                not self.realtime,
                f"on can.interface {can.interface} there is real time only;"
                f" simulated (lock-step) time is of {SIMULATED}",
            ),
            (
                self.log is not None,
                f"frames are logged on {SIMULATED} only; on {can.interface} use candump or"
                " can_logger",
            ),
            (
                bool(self.faults.bus),
                f"a fault script's bus part is for {SIMULATED} only, this is {can.interface};"
                " leave it out",
            ),
            (
                can.interface == ONE_PROCESS and bool(cell.plate or cell.monitor),
                f"on can.interface {ONE_PROCESS} there are drives only; leave out plate and"
                " monitor",
            ),
        )
        for refused, why in refusals:
            if refused:
                raise ConfigError(f"cell {cell.name}: {why}", code="RID-CELL-NOT-SIMULATED")
        if can.interface == "slcan" and self.private:
            return can.model_copy(update={"channel": str(folder / f"{self.name}.tty")})
        return as_served(can)

    def hub(self, socket: Path) -> HubSettings:
        """Return the settings of the hub that listens at `socket`."""
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
            pace=self.pace,
        )

    def plate(self, path: Path) -> PlateSettings | None:
        """Return the settings of the plate at a port; None where the cell has none.

        A plant without a plate has one that obeys its description.
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
            self.plant.plate or _as_described(plate),
            path,
            self.seed,
            self.amplifier_baud_rate,
            self.faults,
        )

    def registers(self, path: Path) -> RegisterSettings | None:
        """Return the settings of the drives' registers; None where the cell has no monitor."""
        monitor = self.cell.monitor
        if monitor is None:
            return None
        profile = self.drive_profile
        if profile is None:
            profile = load_bundled_or_path(monitor.profile, "profiles", DriveProfile)
        if self.private and isinstance(monitor.link, ModbusTcp):
            free = monitor.link.model_copy(update={"port": 0})  # any that is free
            monitor = monitor.model_copy(update={"link": free})
        return RegisterSettings(monitor, profile, path, self.certificates, self.faults.registers)


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
