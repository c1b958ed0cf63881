"""Serving a cell's simulated devices for other commands, and writing their data sheets."""

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
from config.errors import ConfigError, LockedError, RecordingError, TransportError
from config.formats.whole_file import write_whole
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
from rid_daq.runs.output_file import require_writable
from rid_daq.session.cells import is_served, refuse_one_process

LOOK_S: Final = 2.0


@dataclass(frozen=True)
class DeviceServer:
    """A cell whose simulated devices are served.

    Attributes:
        loaded: The devices' cell and its files, on the bus that commands join.
        cell: The cell as it is served.
        channel, address: Of its bus, and of its plate's serial port; empty without one.
    """

    loaded: LoadedCell
    cell: CellConfig
    channel: str
    address: str

    @property
    def listen(self) -> str:
        """How to see the frames; empty for an slcan adapter, whose port is for one program."""
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
        """Where the drives' Modbus registers are served; empty where they are not."""
        if self.cell.monitor is None:
            return ""
        link = self.cell.monitor.link
        if link.kind == "tcp":
            return f"Modbus TCP {link.host}:{link.port}"
        return f"Modbus RTU {link.address}, {link.baud_rate} baud"

    def wait(self) -> None:
        """Wait for a signal to end; a hang-up that is ignored (nohup) stays ignored.

        Raises:
            TransportError: The simulated bus is not served any more.
        """
        ending = set(ending_signals())
        came: list[int] = []
        for number in ending:  # for those that the kernel hands to another thread
            signal.signal(number, lambda came_in, _frame: came.append(came_in))
        signal.pthread_sigmask(signal.SIG_BLOCK, ending)
        while not came and signal.sigtimedwait(ending, LOOK_S) is None:
            if not is_served(self.loaded.config):
                raise TransportError(
                    f"cell {self.cell.name}: its simulated bus died; start it again",
                    code="RID-MOCK-ENDED",
                )
        ignore_termination()


@contextlib.contextmanager
def serve_cell(request: MockRequest) -> Iterator[DeviceServer]:
    """Serve a cell's simulated devices as long as the `with` lasts.

    Raises:
        ConfigError, LockedError: The cell is not simulated, cannot be served, or is served already.
        RidDaqError: As `SimulatedCell`.
    """
    loaded, plant = _devices(request)
    script = NO_SCRIPT if request.faults is None else load_faults(request.faults, loaded.config)
    if script.program:
        raise ConfigError(
            f"{request.faults}: program: happens to the program that works with a cell which it"
            " serves itself, and `mock` serves one for others: leave it out here, or give the"
            " script to `rid-daq record --faults`",
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
    """Write the data sheet of every simulated drive of a cell; nothing is overwritten.

    Returns:
        The cell's name, and the names of the files.

    Raises:
        ConfigError: The cell is not simulated, or there are such files already.
        RecordingError: They cannot be written.
    """
    loaded, plant = _simulated(cell)
    created = datetime.now()
    eds_files = {}
    for axis, joint, simulated in zip(
        loaded.config.axes, loaded.robot.joints, plant.axes, strict=True
    ):
        name = f"node{axis.node_id}.eds"
        identity = SimulatedIdentity.of_axis(loaded.config, axis, joint, simulated)
        eds_files[name] = drive_eds(identity, name, created).encode("ascii")
    present = [name for name in eds_files if (folder / name).exists()]
    if present:
        raise ConfigError(
            f"{folder}: {', '.join(present)} is already there; nothing was written. Give another"
            " folder, or move the files away.",
            code="RID-FILE-EXISTS",
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(
            f"{folder}: cannot make the folder: {error.strerror}", code="RID-FILE-WRITE"
        ) from None
    for name, content in eds_files.items():
        write_whole(folder / name, content)
    return loaded.config.name, [*eds_files]


def _simulated(cell: str) -> tuple[LoadedCell, PlantConfig]:
    loaded = load_cell(cell)
    if not loaded.config.simulated or loaded.plant is None:
        raise ConfigError(
            f"cell {loaded.config.name}: is not simulated; say simulated: true and name a plant",
            code="RID-CELL-NOT-SIMULATED",
        )
    return loaded, loaded.plant


def _devices(request: MockRequest) -> tuple[LoadedCell, PlantConfig]:
    """Return the cell that is simulated, where commands that name the served cell look for it.

    Of another cell come robot, plant, drives and everything else that hangs on the lines; the lines
    themselves, and what a program says on them, are the served cell's.
    """
    loaded, plant = _simulated(request.cell)
    if request.devices is None:
        return loaded, plant
    other, plant = _simulated(request.devices)
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
            f"cell {cell.name}: can.channel {cell.can.channel}: on interface {SIMULATED} simulated"
            " devices are served under a plain channel name",
            code="RID-CELL-VALUE",
        )
    if is_served(cell):
        raise LockedError(
            f"cell {cell.name}: channel {cell.can.channel} is served already",
            code="RID-MOCK-SERVED",
        )
