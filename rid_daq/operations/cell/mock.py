"""`mock`: serve a cell's simulated devices on their bus until stopped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.ranges import Pace, Seed
from rid_daq.blocks.block import AnyBlock, Next, Text
from rid_daq.operations.ended import EndResult
from rid_daq.operations.operation import Context, Operation, OperationResult
from rid_daq.requests.option import FILES, Option
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.cell.served_devices import DeviceServer


class MockRequest(Request):
    """Serve a cell's simulated drives and force plate until Ctrl-C.

    Other commands that name this cell join it meanwhile, and so does anything that speaks
    python-can, such as its logger. With --as the devices are another cell's, on this cell's bus:
    mistakes in wiring and files can be practised. With --eds their data sheets are written and
    nothing else is done: one file per drive, for the axes' eds in the cell file and for other
    CANopen tools.
    """

    cell: Annotated[
        str,
        Field(description="A bundled name or a simulated cell's file."),
        Option(positional=True, metavar="CELL"),
    ]
    devices: Annotated[
        str | None,
        Field(
            description="Serve the devices of this other simulated cell, so that CELL's files can"
            " be wrong."
        ),
        Option(flag="as", metavar="OTHER"),
    ] = None
    lockstep: Annotated[
        bool,
        Field(
            description="Let the commanding program advance the simulated time, not the clock"
            " (rid_sim)."
        ),
    ] = False
    pace: Annotated[
        Pace | None,
        Field(
            description="Run at N times real time; simulated time waits for slow processes"
            " (default: real time)."
        ),
        Option(metavar="N"),
    ] = None
    seed: Annotated[Seed, Field(description="Random seed of noise and faults.")] = 0
    payload: Annotated[
        str | None,
        Field(description="Payload of the robot, by its name in the plant file."),
    ] = None
    log: Annotated[
        Path | None,
        Field(description="Write all frames to this file (candump format)."),
        Option(group=FILES, metavar="FILE"),
    ] = None
    faults: Annotated[
        Path | None,
        Field(description="Fault script: what is to go wrong."),
        Option(group=FILES, metavar="FILE"),
    ] = None
    eds: Annotated[
        Path | None,
        Field(description="Write the data sheet (EDS) of each drive here; nothing is served."),
        Option(group=FILES, metavar="FOLDER"),
    ] = None

    @property
    def is_in_lockstep(self) -> bool:
        """True if simulated time waits for the commanding program."""
        return self.lockstep or self.pace is not None


@dataclass(frozen=True)
class EdsFiles:
    """EDS files that were written.

    Attributes:
        cell: The cell's name.
        folder: Their folder.
        files: Their names.
    """

    cell: str
    folder: Path
    files: tuple[str, ...]
    exit_code: int = 0

    def document(self) -> dict[str, object]:
        """Return cell, folder and files."""
        return {"cell": self.cell, "folder": str(self.folder), "files": list(self.files)}

    def blocks(self) -> Iterator[Text]:
        """Yield the files and their use."""
        yield Text(text=f"{self.folder}: wrote {', '.join(self.files)}.")
        yield Text(text="Name each in its axis of the cell file (eds), by its path from there.")


@dataclass(frozen=True)
class MockServed:
    """A cell whose devices are served.

    Attributes:
        served: The cell.
    """

    request: MockRequest
    served: DeviceServer
    exit_code: int = 0

    def document(self) -> dict[str, object]:
        """Return where the devices are served."""
        served, config = self.served, self.served.loaded.config
        document: dict[str, object] = {
            "cell": config.name,
            "devices": self.request.devices or config.name,
            "channel": served.channel,
            "listen": served.listen,
            "registers": served.registers,
        }
        return {**document, "plate": served.address} if served.address else document

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield where the devices are served, and the next command."""
        request, served, config = self.request, self.served, self.served.loaded.config
        what = ", ".join(f"{axis.joint} node {axis.node_id}" for axis in config.axes)
        if request.devices is not None:  # to find out its nodes is part of the practice
            what = f"with the devices of {request.devices}"
        kept = "lock-step" if request.is_in_lockstep else "real"
        yield Text(text=f"Cell {config.name} is served: {what}; {kept} time.")
        if request.faults is not None:
            yield Text(text=f"Faults:     as {request.faults} says")
        if served.listen:
            yield Text(text=f"Listen in:  {served.listen}")
        else:
            yield Text(text=f"Adapter:    {served.channel} (slcan)")
        if served.address and config.plate is not None:
            baud_rate = config.plate.amplifier.baud_rate
            yield Text(text=f"Plate:      {served.address} at {baud_rate} baud")
        if served.registers:
            yield Text(text=f"Registers:  {served.registers}")
        yield Text(text="Ctrl-C ends it.")
        yield Next(words=("check", request.cell), lead="Next, in another terminal")


def run(request: MockRequest, context: Context) -> OperationResult:
    """Serve the devices until a signal, or write their data sheets."""
    from rid_daq.operations.cell.served_devices import serve_cell, write_eds_files

    if request.eds is not None:
        name, files = write_eds_files(request.devices or request.cell, request.eds)
        return EdsFiles(name, request.eds, tuple(files))
    with serve_cell(request) as served:
        begun = MockServed(request, served)
        context.result(begun.document(), begun.blocks())
        served.wait()
    return EndResult("Ended.")


OPERATION: Final = Operation(
    name="mock",
    label="Simulated devices",
    request=MockRequest,
    run=run,
    examples=("mock ir361 --seed 7", "mock ir361 --eds eds-files"),
    opens_cell=True,
    module="rid_daq.operations.cell.served_devices",
)
