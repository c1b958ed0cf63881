"""Serve a cell's simulated devices for other commands, and write their data sheets."""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Iterator
from dataclasses import dataclass, replace
from datetime import datetime
from pathlib import Path
from typing import Final

from config.cell.cell import CellConfig
from config.errors import ConfigError, LockedError, TransportError
from config.load import LoadedCell, load_cell, load_faults
from config.process.termination import ending_signals, ignore_termination
from config.simulation.faults import NO_SCRIPT
from config.simulation.plant import PlantConfig
from mock_hw.bus.served_bus import SIMULATED
from mock_hw.cell import SimulatedCell
from mock_hw.drive.eds import drive_eds
from mock_hw.drive.objects import SimulatedIdentity
from mock_hw.host.runtime_directory import runtime_directory
from mock_hw.simulation import CellSimulation
from rid_daq.operations.cell.mock import MockRequest
from rid_daq.runs.output_file import require_writable, write_new_files
from rid_daq.session.cells import is_served, refuse_one_process

LOOK_S: Final = 2.0


@dataclass(frozen=True)
class DeviceServer:
    """Server of a cell's simulated devices.

    Attributes:
        loaded: Cell of the devices and its files, with the bus of the served cell.
        cell: Configuration of the cell with the ports on which its devices are served.
        channel: Channel of the cell's bus.
        address: Address of the plate's serial port; empty without a plate.
    """

    loaded: LoadedCell
    cell: CellConfig
    channel: str
    address: str

    @property
    def listen(self) -> str:
        """Command that prints the frames on the bus.

        Empty for slcan (only one program opens a port).
        """
        interface, channel = self.cell.can.interface, self.loaded.config.can.channel
        if interface == "slcan":
            return ""
        if interface == "socketcan":
            return f"candump {channel}"
        group, _, port = channel.partition("@")
        options = f" --bus-kwargs port={port}" if port else ""
        return f"can_logger -i {interface} -c {group}{options}"

    @property
    def registers(self) -> str:
        """Address of the drives' Modbus registers; empty if they are not served."""
        if self.cell.monitor is None:
            return ""
        link = self.cell.monitor.link
        if link.kind == "tcp":
            return f"Modbus TCP {link.host}:{link.port}"
        return f"Modbus RTU {link.address}, {link.baud_rate} baud"

    def wait(self) -> None:
        """Wait for a signal that ends the program; an ignored hang-up (nohup) stays ignored.

        Raises:
            TransportError: The simulated bus has ended.
            RecordingError: The state of the bus cannot be read.
        """
        ending = set(ending_signals())
        came: list[int] = []
        for number in ending:  # the kernel may deliver a signal to another thread
            signal.signal(number, lambda came_in, _frame: came.append(came_in))
        signal.pthread_sigmask(signal.SIG_BLOCK, ending)
        while not came and signal.sigtimedwait(ending, LOOK_S) is None:
            if not is_served(self.loaded.config):
                raise TransportError(
                    f"cell {self.cell.name}: its simulated bus has ended; start `rid-daq mock`"
                    " again",
                    code="RID-MOCK-ENDED",
                )
        ignore_termination()


@contextlib.contextmanager
def serve_cell(request: MockRequest) -> Iterator[DeviceServer]:
    """Serve a cell's simulated devices until the `with` block ends.

    Raises:
        ConfigError, LockedError: The cell is not simulated, cannot be served, or is served already.
        RidDaqError: As raised by `SimulatedCell`.
    """
    loaded, plant = _cell_to_simulate(request)
    script = NO_SCRIPT if request.faults is None else load_faults(request.faults, loaded.config)
    if script.program:
        raise ConfigError(
            f"{request.faults}: program: this fault acts on a program that simulates the cell"
            " itself, but `mock` simulates the cell for other programs: remove the key"
            " `program`, or give the script to `rid-daq record --faults`",
            code="RID-FAULT-SCRIPT",
        )
    _check_channel(loaded.config)
    if request.log is not None:
        require_writable(request.log)
    simulation = CellSimulation(
        loaded.config,
        loaded.robot,
        plant if request.payload is None else plant.with_payload(request.payload),
        realtime=not request.is_in_lockstep,
        pace=request.pace,
        seed=request.seed,
        directory=runtime_directory(),
        log=request.log,
        amplifier_profile=loaded.amplifier_profile,
        drive_profile=loaded.drive_profile,
        faults=script,
    )
    with SimulatedCell(simulation) as simulated:
        yield DeviceServer(loaded, simulated.cell, simulated.channel, simulated.address)


def write_eds_files(cell: str, folder: Path) -> tuple[str, list[str]]:
    """Write the data sheet of every simulated drive of a cell; refuse to overwrite a file.

    Returns:
        The cell's name, and the names of the files.

    Raises:
        ConfigError: The cell is not simulated, or one of the files exists already.
        RecordingError: The files cannot be written.
    """
    loaded, plant = _load_simulated(cell)
    created = datetime.now()
    eds_files = {}
    for axis, joint, simulated in zip(
        loaded.config.axes, loaded.robot.joints, plant.axes, strict=True
    ):
        name = f"node{axis.node_id}.eds"
        identity = SimulatedIdentity.of_axis(loaded.config, axis, joint, simulated)
        eds_files[name] = drive_eds(identity, name, created).encode("ascii")
    write_new_files(folder, eds_files)
    return loaded.config.name, [*eds_files]


def _load_simulated(cell: str) -> tuple[LoadedCell, PlantConfig]:
    loaded = load_cell(cell)
    if not loaded.config.simulated or loaded.plant is None:
        raise ConfigError(
            f"cell {loaded.config.name} is not simulated: set `simulated: true` and name a plant"
            " in the cell file",
            code="RID-CELL-NOT-SIMULATED",
        )
    return loaded, loaded.plant


def _cell_to_simulate(request: MockRequest) -> tuple[LoadedCell, PlantConfig]:
    """Return the cell to simulate, on the bus of the served cell.

    With `--as`, robot, plant, drives and all other devices are those of the other cell. The bus and
    its protocol settings are those of the served cell.
    """
    loaded, plant = _load_simulated(request.cell)
    if request.devices is None:
        return loaded, plant
    other, plant = _load_simulated(request.devices)
    cell, devices = loaded.config, other.config
    monitor = devices.monitor
    if monitor is not None and cell.monitor is not None:
        monitor = monitor.model_copy(update={"link": cell.monitor.link})
    hung = {
        "axes": devices.axes,
        "servo": devices.servo,
        "torque_filter": devices.torque_filter,
        "plate": devices.plate,
        "monitor": monitor,
    }
    return replace(other, config=cell.model_copy(update=hung)), plant


def _check_channel(cell: CellConfig) -> None:
    """Refuse a channel that cannot be served, or is served already."""
    refuse_one_process(cell)
    if cell.can.interface == SIMULATED and os.sep in cell.can.channel:
        raise ConfigError(
            f"cell {cell.name}: can.channel {cell.can.channel}: interface {SIMULATED} needs a"
            f" plain channel name without {os.sep}",
            code="RID-CELL-VALUE",
        )
    if is_served(cell):
        raise LockedError(
            f"cell {cell.name}: channel {cell.can.channel} is served already",
            code="RID-MOCK-SERVED",
        )
