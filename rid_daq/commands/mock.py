"""`rid-daq mock`: serve a cell's simulated devices on their bus until stopped."""

from __future__ import annotations

import os
import signal
from datetime import datetime
from pathlib import Path
from typing import Annotated

import typer

from config.cell.cell import CellConfig
from config.errors import ConfigError, LockedError, RecordingError, TransportError
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell, load_faults
from config.process.termination import ending_signals, ignore_termination
from config.simulation.faults import NO_SCRIPT
from mock_hw.bus.served_bus import SIMULATED
from mock_hw.cell import SimulatedCell
from mock_hw.drive.eds import drive_eds
from mock_hw.drive.objects import DriveIdentity
from mock_hw.host.runtime_directory import runtime_directory
from mock_hw.simulation import CellSimulation
from rid_daq.session.cells import is_served, refuse_one_process
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.output_file import refuse_output

_LOOK_S = 2.0


def mock(
    cell: Annotated[
        str, typer.Argument(metavar="CELL", help="A bundled name or a simulated cell's file.")
    ],
    lockstep: Annotated[
        bool,
        typer.Option(
            "--lockstep",
            help="Simulated time that the commanding program moves on, not the clock (rid_sim).",
        ),
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of everything random.")] = 0,
    payload: Annotated[
        str | None, typer.Option(help="What the robot carries, by its name in the plant file.")
    ] = None,
    log: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write all frames there (candump format).")
    ] = None,
    faults: Annotated[
        Path | None, typer.Option(metavar="FILE", help="A fault script: what is to go wrong.")
    ] = None,
    eds: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", help="Write each drive's data sheet (EDS) there; nothing is served."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Serve a cell's simulated drives and force plate until Ctrl-C.

    Other commands that name this cell join it meanwhile, and so does anything that speaks
    python-can, such as its logger. With --eds their data sheets are written and nothing else is
    done: one file a drive, for the axes' eds in the cell file and for other CANopen tools.
    """
    console = Console(as_json)
    loaded = load_cell(cell)
    if not loaded.config.simulated or loaded.plant is None:
        raise ConfigError(
            f"cell {loaded.config.name}: is not simulated; say simulated: true and name a plant"
        )
    if eds is not None:
        _write_sheets(loaded, eds, console)
        return
    script = NO_SCRIPT if faults is None else load_faults(faults, loaded.config)
    if script.program:
        raise ConfigError(
            f"{faults}: program: happens to the program that works with a cell which it serves"
            " itself, and `mock` serves one for others: leave it out here, or give the script to"
            " `rid-daq record --faults`"
        )
    _check_channel(loaded.config)
    refuse_output(log, overwrite=True)
    with SimulatedCell(
        CellSimulation(
            loaded.config,
            loaded.robot,
            loaded.plant if payload is None else loaded.plant.with_payload(payload),
            realtime=not lockstep,
            seed=seed,
            directory=runtime_directory(),
            log=log,
            amplifier_profile=loaded.amplifier_profile,
            drive_profile=loaded.drive_profile,
            faults=script,
        )
    ) as simulated:
        listen = _listen(simulated.cell, loaded.config.can.channel)
        registers = _registers(simulated.cell)
        document = {
            "cell": loaded.config.name,
            "channel": simulated.channel,
            "listen": listen,
            "registers": registers,
        }
        if simulated.address:
            document["plate"] = simulated.address
        console.document(document)
        nodes = ", ".join(f"{axis.joint} node {axis.node_id}" for axis in loaded.config.axes)
        console.say(
            f"Cell {loaded.config.name} is served: {nodes};"
            f" {'lock-step' if lockstep else 'real'} time. Ctrl-C ends it."
        )
        if faults is not None:
            console.say(f"Faults:     as {faults} says")
        if listen:
            console.say(f"Listen in:  {listen}")
        else:
            console.say(f"Adapter:    {simulated.channel} (slcan)")
        if simulated.address and loaded.config.plate is not None:
            baud_rate = loaded.config.plate.amplifier.baud_rate
            console.say(f"Plate:      {simulated.address} at {baud_rate} baud")
        console.say(f"Use it:     rid-daq check {cell}")
        if registers:
            console.say(f"Registers:  {registers}")
        _wait(loaded.config)
    console.say("Ended.")


def _write_sheets(loaded: LoadedCell, folder: Path, console: Console) -> None:
    """Write the data sheet of every simulated drive; nothing is overwritten.

    Raises
    ------
    ConfigError
        There are such files already.
    RecordingError
        They cannot be written.
    """
    if loaded.plant is None:
        raise ConfigError(f"cell {loaded.config.name}: a simulated cell needs plant")
    created = datetime.now()
    sheets = {}
    for axis, joint, simulated in zip(
        loaded.config.axes, loaded.robot.joints, loaded.plant.axes, strict=True
    ):
        name = f"node{axis.node_id}.eds"
        identity = DriveIdentity.of_axis(axis, joint, simulated)
        sheets[name] = drive_eds(identity, name, created).encode("ascii")
    present = [name for name in sheets if (folder / name).exists()]
    if present:
        raise ConfigError(
            f"{folder}: {', '.join(present)} is already there; nothing was written. Give another"
            " folder, or move the files away."
        )
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise RecordingError(f"{folder}: cannot make the folder: {error.strerror}") from None
    for name, content in sheets.items():
        write_whole(folder / name, content)
    console.document({"cell": loaded.config.name, "folder": str(folder), "files": [*sheets]})
    console.say(f"{folder}: wrote {', '.join(sheets)}.")
    console.say("Name each in its axis of the cell file (eds), by its path from there.")


def _listen(served: CellConfig, channel: str) -> str:
    """Say how to see the frames; an slcan adapter's port is for one program alone."""
    interface = served.can.interface
    if interface == "slcan":
        return ""
    if interface == "socketcan":
        return f"candump {channel}"
    group, _, port = channel.partition("@")
    options = f" --bus-kwargs port={port}" if port else ""
    return f"can_logger -i {interface} -c {group}{options}"


def _registers(cell: CellConfig) -> str:
    """Say where the drives' Modbus registers are served; nothing where they are not."""
    if cell.monitor is None:
        return ""
    link = cell.monitor.link
    if link.kind == "tcp":
        return f"Modbus TCP {link.host}:{link.port}"
    return f"Modbus RTU {link.address}, {link.baud_rate} baud"


def _wait(cell: CellConfig) -> None:
    """Wait for a signal to end; a hang-up that is ignored (nohup) stays ignored.

    Raises
    ------
    TransportError
        The simulated bus is not served any more.
    """
    ending = set(ending_signals())
    came: list[int] = []
    for number in ending:  # for those that the kernel hands to another thread
        signal.signal(number, lambda came_in, _frame: came.append(came_in))
    signal.pthread_sigmask(signal.SIG_BLOCK, ending)
    while not came and signal.sigtimedwait(ending, _LOOK_S) is None:
        if not is_served(cell):
            raise TransportError(f"cell {cell.name}: its simulated bus died; start it again")
    ignore_termination()


def _check_channel(cell: CellConfig) -> None:
    """Refuse a channel that cannot be served, or is served already."""
    refuse_one_process(cell)
    if cell.can.interface == SIMULATED and os.sep in cell.can.channel:
        raise ConfigError(
            f"cell {cell.name}: can.channel {cell.can.channel}: on interface {SIMULATED} simulated"
            " devices are served under a plain channel name"
        )
    if is_served(cell):
        raise LockedError(f"cell {cell.name}: channel {cell.can.channel} is served already")
