"""`mock`: serve a cell's simulated devices on their bus until stopped."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.ranges import Pace, Seed
from rid_daq.blocks.block import AnyBlock, Next, Text
from rid_daq.operations.end_result import EndResult
from rid_daq.operations.operation import Context, Operation, OperationResult
from rid_daq.requests.option import FILES, Option
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.cell.served_devices import DeviceServer


class MockRequest(Request):
    """Serve a cell's simulated devices until Ctrl-C.

    While the devices are served, other commands that name this cell use them. Any python-can
    program, such as can_logger, can use them too. With --as the devices of another cell are served
    on this cell's bus, to practise with mistakes in wiring and files. With --eds the command only
    writes the EDS files of the drives, one per drive: for the axes' eds keys in the cell file and
    for other CANopen tools.
    """

    cell: Annotated[
        str,
        Field(description="Simulated cell: a bundled name or a cell file."),
        Option(positional=True, metavar="CELL"),
    ]
    devices: Annotated[
        str | None,
        Field(
            description="Serve the devices of this other simulated cell, to practise finding wrong"
            " values in the files of CELL."
        ),
        Option(flag="as", metavar="OTHER"),
    ] = None
    lockstep: Annotated[
        bool,
        Field(
            description="Let the program that commands the drives, not the clock, advance"
            " simulated time (interface rid_sim only)."
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
        Field(description="Fault script: faults of the simulated cell and their times."),
        Option(group=FILES, metavar="FILE"),
    ] = None
    eds: Annotated[
        Path | None,
        Field(
            description="Write the data sheet (EDS) of each drive into this folder; serve nothing."
        ),
        Option(group=FILES, metavar="FOLDER"),
    ] = None

    @property
    def is_in_lockstep(self) -> bool:
        """True if simulated time waits for the program that commands the drives."""
        return self.lockstep or self.pace is not None


@dataclass(frozen=True)
class EdsFiles:
    """EDS files that were written.

    Attributes:
        cell: Name of the cell.
        folder: Folder of the files.
        files: Names of the files.
    """

    cell: str
    folder: Path
    files: tuple[str, ...]

    def document(self) -> dict[str, object]:
        """Return cell, folder and file names."""
        return {"cell": self.cell, "folder": str(self.folder), "files": list(self.files)}

    def blocks(self) -> Iterator[Text]:
        """Yield the file names and their use."""
        yield Text(text=f"{self.folder}: wrote {', '.join(self.files)}.")
        yield Text(
            text="Name each file in its axis of the cell file (key eds), relative to the cell file."
        )


@dataclass(frozen=True)
class MockResult:
    """A cell whose simulated devices are served.

    Attributes:
        served: Server of the devices.
    """

    request: MockRequest
    served: DeviceServer

    def document(self) -> dict[str, object]:
        """Return the addresses of the served devices."""
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
        """Yield the addresses of the served devices, and the next command."""
        request, served, config = self.request, self.served, self.served.loaded.config
        what = ", ".join(f"{axis.joint} node {axis.node_id}" for axis in config.axes)
        if request.devices is not None:
            # The node ids are not shown, because the user practises finding them.
            what = f"with the devices of {request.devices}"
        kept = "lock-step" if request.is_in_lockstep else "real"
        yield Text(text=f"Cell {config.name} is served: {what}; {kept} time.")
        if request.faults is not None:
            yield Text(text=f"Faults:     from {request.faults}")
        if served.listen:
            yield Text(text=f"Bus frames: {served.listen}")
        else:
            yield Text(text=f"Adapter:    {served.channel} (slcan)")
        if served.address and config.plate is not None:
            baud_rate = config.plate.amplifier.baud_rate
            yield Text(text=f"Plate:      {served.address} at {baud_rate} baud")
        if served.registers:
            yield Text(text=f"Registers:  {served.registers}")
        yield Text(text="Press Ctrl-C to end.")
        yield Next(words=("check", request.cell), lead="Next, in another terminal")


def run(request: MockRequest, context: Context) -> OperationResult:
    """Serve the devices until a signal, or write their data sheets."""
    from rid_daq.operations.cell.served_devices import serve_cell, write_eds_files

    if request.eds is not None:
        name, files = write_eds_files(request.devices or request.cell, request.eds)
        return EdsFiles(name, request.eds, tuple(files))
    with serve_cell(request) as served:
        begun = MockResult(request, served)
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
