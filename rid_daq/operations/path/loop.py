"""`loop`: measure the velocity loops of the drives."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, TypedDict

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Next, Text, Verdict, note_blocks
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    Option,
    Overwrite,
    RunName,
    RunsFolder,
    Unfinished,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.path.loop_measurement import MeasuredLoops


class LoopRequest(Request):
    """Measure the frequency responses of the velocity loops, and fit gain and integral time.

    The run must be of a motion that `rid-daq design --kind multisine` wrote, or an import of whole
    periods of a multisine with velocity commands. Intervals are two standard deviations, from the
    differences between periods and between realisations. The stability margins are those of
    current, velocity and position loop together. The report of the run contains all values and
    plots.

    In a terminal: exit code 6 if inertia and damping do not explain the response of a joint.
    """

    run: RunName
    output: Annotated[
        Path | None,
        Field(description="Loop file to write; loops.json of the run if not set."),
        Option(short="o", metavar="LOOPS", group=FILES, file="output", endings=(".json",)),
    ] = None
    position_gain: Annotated[
        float | None,
        Field(
            gt=0.0,
            le=200.0,
            description="Gain of the position loop for which margins are computed; only for an"
            " import, because a cell file states its own. The loop's cycle is the sample period of"
            " the recording.",
        ),
        Option(unit="1/s"),
    ] = None
    overwrite: Overwrite = False
    unfinished: Unfinished = False
    runs: RunsFolder = DEFAULT_RUNS


class LoopDocument(TypedDict):
    """Measured velocity loops."""

    run: str
    loops: str
    report: str
    sentence: str
    position_gain_per_s: float
    largest_position_gain_per_s: float | None
    advice: str
    axes: list[dict[str, object]]
    notes: Sequence[str]


@dataclass(frozen=True)
class LoopResult:
    """Velocity loops that were measured and written.

    Attributes:
        found: The loops and the paths of their files.
    """

    found: MeasuredLoops

    @property
    def exit_code(self) -> int:
        """Exit code 6 if inertia and damping do not explain the response of a joint."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.DATA_QUALITY if self.found.section.bad_joints else 0

    def document(self) -> LoopDocument:
        """Return the loops as numbers."""
        found, section = self.found, self.found.section
        return {
            "run": found.run_id,
            "loops": str(found.output),
            "report": str(found.report),
            "sentence": section.sentence,
            "position_gain_per_s": section.position_gain_per_s,
            "largest_position_gain_per_s": section.largest_position_gain_per_s,
            "advice": section.advice,
            "axes": [axis.model_dump(mode="json") for axis in section.axes],
            "notes": found.notes,
        }

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, controllers, margins, advice, files and the next command."""
        from rid_daq.report.section_blocks.velocity_loops import loop_blocks

        found = self.found
        yield from note_blocks(found.notes)
        yield from loop_blocks(found.section)
        if bad := found.section.bad_joints:
            joints = ", ".join(bad)
            text = f"The loop model does not fit {joints}: measure again as the notes on it advise"
            yield Verdict(passed=False, text=text)
        yield Text(text=f"Report: {found.report}", is_for_terminal=True)
        yield Text(text=f"Loops: {found.output}")
        if not self.exit_code:
            words = ("compensate", found.cell, "MOTION", "--model", "MODEL")
            yield Next(words=(*words, "--loop", str(found.output), "-o", "FEEDFORWARD"))


def run(request: LoopRequest, _context: Context) -> LoopResult:
    """Measure the loops and write them."""
    from rid_daq.operations.path.loop_measurement import measure_velocity_loops

    return LoopResult(measure_velocity_loops(request))


OPERATION: Final = Operation(
    name="loop",
    label="Measure the velocity loops",
    request=LoopRequest,
    run=run,
    examples=("loop latest --output loops.json", "loop multisine --overwrite --json"),
    module="rid_daq.operations.path.loop_measurement",
)
