"""`watch`: read a cell's drives for some time without power; nothing moves."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.ranges import WatchS
from rid_daq.blocks.block import AnyBlock, Cells, Text, table
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.cell_options import Simulation
from rid_daq.requests.option import DEFAULT_RUNS, CellName, Option, RunsFolder
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.cell.watched_drives import WatchedDrives

WATCH_S: Final = 600.0


class WatchRequest(Request):
    """Read positions, torques and (with a drive monitor) temperatures at rest, without power.

    The drives are configured and read back as before a motion, and SYNC is sent in every cycle. No
    drive is switched on and nothing moves, but an arm without brakes can be moved by hand. In a
    service, the page of the live signals shows the values. STOP ends the operation. Nothing is
    recorded.

    In a terminal: `rid-daq stop` and Ctrl-C end it too.
    """

    cell: CellName
    seconds: Annotated[
        WatchS, Field(description="Time during which the drives are read."), Option(unit="s")
    ] = WATCH_S
    simulation: Simulation = Simulation()
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class WatchResult:
    """Lowest and highest positions that the drives reported.

    Attributes:
        cell: Name of the cell.
        watched: Extreme positions and missing answers of each joint.
    """

    cell: str
    watched: WatchedDrives

    @property
    def exit_code(self) -> int:
        """Exit code 0."""
        return 0

    def document(self) -> dict[str, object]:
        """Return the extremes of each joint, and the number of missing answers."""
        watched = self.watched
        return {
            "cell": self.cell,
            "cycles": watched.cycles,
            "joints": [
                {
                    "joint": joint.name,
                    "unit": joint.unit,
                    "position_min": joint.position_min,
                    "position_max": joint.position_max,
                    "answers_missing": joint.answers_missing,
                }
                for joint in watched.joints
            ],
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the extremes of each joint, and the number of cycles."""
        yield table(
            self.watched.joints,
            Cells("joint", lambda joint: joint.name),
            Cells("lowest position", lambda joint: joint.format_position(joint.position_min)),
            Cells("highest position", lambda joint: joint.format_position(joint.position_max)),
            Cells("answers missing", lambda joint: str(joint.answers_missing)),
        )
        yield Text(
            text=f"Cell {self.cell}: {self.watched.cycles} cycles were read. Nothing was moved."
        )


def run(request: WatchRequest, context: Context) -> WatchResult:
    """Watch the drives."""
    from config.load import load_cell
    from rid_daq.operations.cell.watched_drives import watch_drives

    loaded = load_cell(request.cell)
    return WatchResult(loaded.config.name, watch_drives(loaded, request, context))


OPERATION: Final = Operation(
    name="watch",
    label="Watch",
    request=WatchRequest,
    run=run,
    examples=("watch ir361 --seconds 10", "watch cell.yaml --service local"),
    opens_cell=True,
    module="rid_daq.operations.cell.watched_drives",
)
