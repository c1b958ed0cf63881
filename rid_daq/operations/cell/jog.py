"""`jog`: move a cell's robot manually, while a key is held."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.ranges import JogPercent
from rid_daq.blocks.block import AnyBlock
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.cell_options import Cleared, Practise, Simulation
from rid_daq.requests.option import DEFAULT_RUNS, FILES, CellName, Option, RunsFolder
from rid_daq.requests.request import Request
from rid_daq.terminal.choices import JOG_PERCENT

if TYPE_CHECKING:
    from rid_daq.recording.recorded_run import RecordedRun


class JogRequest(Request):
    """Move one joint at a time while a key is held; the robot stops when the key is released.

    The path is checked before it is driven: it ends before a joint's limit, and before two bodies
    come too close. A key counts as held from its second repeat on, and for 0.2 s after the last
    repeat. The process of the cyclic task checks the key in every cycle. The robot therefore also
    stops if this program is suspended, and its drives are switched off if this program is killed.
    After a minute without a key the drives are switched off. STOP is a quick stop. The key is not
    an enabling device.

    In a terminal: digits choose a joint, + and - move it while they are held, h goes to the home
    pose, q ends. Ctrl-C is a quick stop.
    """

    cell: CellName
    home: Annotated[bool, Field(description="Only go to the home pose of the cell file.")] = False
    speed_percent: Annotated[
        JogPercent,
        Field(
            description="Speed, relative to each joint's velocity limit; the tool point is"
            " commanded at most 250 mm/s."
        ),
        Option(flag="speed", unit="%", metavar="PERCENT"),
    ] = JOG_PERCENT
    simulation: Simulation = Simulation()
    cleared: Cleared = False
    practise: Practise = False
    label: Annotated[str, Field(description="Name of the run."), Option(group=FILES)] = "jog"
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class JogResult:
    """A run in which a person moved the robot manually."""

    run: RecordedRun

    @property
    def exit_code(self) -> int:
        """Exit code of the run."""
        return self.run.exit_code

    def document(self) -> dict[str, object]:
        """Return the document of the run."""
        return self.run.document()

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the motion's outcome."""
        yield from self.run.blocks()


def run(request: JogRequest, context: Context) -> JogResult:
    """Jog the robot."""
    from rid_daq.operations.cell.jogging import jog

    return JogResult(jog(request, context))


OPERATION: Final = Operation(
    name="jog",
    label="Jog",
    request=JogRequest,
    run=run,
    examples=("jog cell.yaml --speed 2", "jog ir361 --home --realtime"),
    opens_cell=True,
    moves=True,
    is_held=True,
    module="rid_daq.operations.cell.jogging",
)
