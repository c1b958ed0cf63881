"""`rid-daq mock`: serve a cell's simulated devices on their bus until stopped."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from rid_daq.terminal.console import Console
from rid_daq.terminal.options import PACE_HELP, AsJson

if TYPE_CHECKING:
    from rid_daq.jobs.mock_job import MockRequest, ServedCell


def mock(
    cell: Annotated[
        str, typer.Argument(metavar="CELL", help="A bundled name or a simulated cell's file.")
    ],
    devices: Annotated[
        str | None,
        typer.Option(
            "--as",
            metavar="OTHER",
            help="Serve this other simulated cell's devices, so that CELL's files can be wrong.",
        ),
    ] = None,
    lockstep: Annotated[
        bool,
        typer.Option(
            "--lockstep",
            help="Simulated time that the commanding program moves on, not the clock (rid_sim).",
        ),
    ] = False,
    pace: Annotated[
        float | None,
        typer.Option(
            min=0.1, max=100.0, metavar="TIMES", help=f"{PACE_HELP} Real time if not given."
        ),
    ] = None,
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
    python-can, such as its logger. With --as the devices are another cell's, on this cell's bus:
    mistakes in wiring and files can be practised. With --eds their data sheets are written and
    nothing else is done: one file a drive, for the axes' eds in the cell file and for other
    CANopen tools.
    """
    from rid_daq.jobs.mock_job import MockRequest, serve_cell, write_eds_files

    console = Console(as_json)
    if eds is not None:
        name, files = write_eds_files(devices or cell, eds)
        console.document({"cell": name, "folder": str(eds), "files": files})
        console.say(f"{eds}: wrote {', '.join(files)}.")
        console.say("Name each in its axis of the cell file (eds), by its path from there.")
        return
    request = MockRequest(cell, lockstep, seed, payload, log, faults, devices, pace)
    with serve_cell(request) as served:
        _print(console, request, served)
        served.wait()
    console.say("Ended.")


def _print(console: Console, request: MockRequest, served: ServedCell) -> None:
    config = served.loaded.config
    document: dict[str, object] = {
        "cell": config.name,
        "devices": request.devices or config.name,
        "channel": served.channel,
        "listen": served.listen,
        "registers": served.registers,
    }
    if served.address:
        document["plate"] = served.address
    console.document(document)
    what = ", ".join(f"{axis.joint} node {axis.node_id}" for axis in config.axes)
    if request.devices is not None:  # which nodes those are is for whoever practises to find out
        what = f"with the devices of {request.devices}"
    kept = "lock-step" if request.in_lockstep else "real"
    console.say(f"Cell {config.name} is served: {what}; {kept} time.")
    if request.faults is not None:
        console.say(f"Faults:     as {request.faults} says")
    if served.listen:
        console.say(f"Listen in:  {served.listen}")
    else:
        console.say(f"Adapter:    {served.channel} (slcan)")
    if served.address and config.plate is not None:
        baud_rate = config.plate.amplifier.baud_rate
        console.say(f"Plate:      {served.address} at {baud_rate} baud")
    if served.registers:
        console.say(f"Registers:  {served.registers}")
    console.say("Ctrl-C ends it.")
    console.next_step("check", request.cell, lead="Next, in another terminal")
