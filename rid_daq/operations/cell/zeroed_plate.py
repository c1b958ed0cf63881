"""`zero_plate`: read the force plate, turn axis 1, read it, turn back, read it again."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from acquisition.plate_zero.plate_zero import (
    PlateOffset,
    ZeroTurn,
    find_offset,
    plan_turn,
    rest_samples,
    turn_samples,
)
from acquisition.recording.plate_geometry import PlateGeometry
from acquisition.session.plate_preparation import discharge_plate
from config.arrays import IntArray
from config.cell.cell import CellConfig
from config.cell.plate import PlateConfig, PlateZero
from config.errors import ConfigError, DataQualityError
from config.load import bundled_names, load_cell
from rid_daq.operations.cell.plate_zero import PlateZeroRequest
from rid_daq.operations.operation import Context
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_request import RunRequest
from rid_daq.recording.run_session import Clearance, RunSession, open_session
from rid_daq.report.sections.plate_zero import PlateZeroSection, as_zero, zero_verdict
from rid_daq.runs.plate_zero_lines import ZERO_FILE, write_zero, zero_lines, zero_source
from rid_daq.runs.run_data import RunData

REST_S: Final = 0.5


@dataclass(frozen=True)
class ZeroedPlate:
    """Offsets of a force plate, and the run in which they were measured.

    Attributes:
        run: Run of the turn; if the robot was stopped before the first pose, the approach.
        zero: Offsets; None if the motion was stopped.
        lines: The offsets as lines of a cell file.
        written: Cell file into which the offsets were written; None if not requested, or if the
            zero failed its check.
        approach_only: True if the robot was stopped before the first pose; the run is then not
            kept.
    """

    run: RecordedRun
    zero: PlateZero | None = None
    lines: str = ""
    written: Path | None = None
    approach_only: bool = False


def zero_plate(request: PlateZeroRequest, context: Context) -> ZeroedPlate:
    """Measure the force plate's offsets; if requested and valid, write them into the cell file.

    Raises:
        ConfigError, PreflightError: The request was refused before anything moved.
        DataQualityError: The recording of the plate cannot be used.
        RidDaqError: As raised by `RunSession.recording`.
    """
    loaded = load_cell(request.cell)
    plate = loaded.config.plate
    if plate is None or loaded.amplifier_profile is None:
        raise ConfigError(
            f"cell {loaded.config.name} has no force plate: `plate zero` needs one",
            code="RID-PLATE-MISSING",
        )
    if request.write and request.cell in bundled_names("cells"):
        raise ConfigError(
            f"--write: cell {request.cell} is bundled with the program and cannot be changed;"
            " make your own cell with `rid-daq init`",
            code="RID-PLATE-ZERO-WRITE",
        )
    pose = None if request.pose is None else np.array(request.pose)
    turn = plan_turn(loaded.robot, pose)
    cycle_s = loaded.config.cycle_time_s
    samples, readings = turn_samples(loaded.robot, turn, request.settle_s, request.read_s, cycle_s)
    with open_session(
        loaded,
        request.runs,
        context,
        Clearance(request.cleared, request.practise),
        AxisTestRule(request.axis_test),
        simulation=request.simulation,
    ) as session:
        approach = _drive_to_first_pose(session, turn, context).as_step()
        if approach.outcome.stop is not None:
            return ZeroedPlate(approach, approach_only=True)
        context.say("2 of 4: the amplifier is reset, then operates")
        discharge_plate(_plate_of(session.cell), loaded.amplifier_profile)
        context.say("3 of 4: reading, turn of axis 1, reading, turn back, reading")
        words = (
            "Axis 1 turns to one side, to the other and back, with a reading at rest on each side."
        )
        asked = RunRequest(request.label, words, samples, role="zeroing")
        with replace(session, cell=_without_zero(session.cell)).recording(asked) as run:
            if run.outcome.stop is not None:
                return ZeroedPlate(run)
            found = _estimate_offset(run.data, _plate_of(session.cell), turn, readings)
            judged = zero_verdict(found, turn, plate)
            run.result = run.result.with_sections(
                title=f"Zero of the plate of {loaded.config.name}",
                plate_zero=PlateZeroSection.of(found, turn),
                verdict=judged,
            )
            run.facts["zeroed"] = judged.passed
            zero = as_zero(found, turn)
            source = zero_source(run.folder.run_id)
            lines = zero_lines(zero, source)
            run.folder.write(ZERO_FILE, lines.encode())
    written = None
    if request.write and judged.passed:
        written = Path(request.cell)
        write_zero(written, zero, source)
    return ZeroedPlate(run, zero, lines, written)


def _plate_of(cell: CellConfig) -> PlateConfig:
    assert cell.plate is not None
    return cell.plate


def _without_zero(cell: CellConfig) -> CellConfig:
    """Return the cell without the plate's offsets, so that the raw channels are recorded."""
    return cell.model_copy(update={"plate": _plate_of(cell).model_copy(update={"zero": None})})


def _drive_to_first_pose(session: RunSession, turn: ZeroTurn, context: Context) -> RecordedRun:
    """Move to the first pose and stop there with the drives off; the recording is not kept."""
    context.say(f"1 of 4: moving to the first pose ({', '.join(f'{q:.3f}' for q in turn.first)})")
    bare = session.cell.model_copy(update={"plate": None})
    there = rest_samples(session.loaded.robot, turn.first, REST_S, bare.cycle_time_s)
    with tempfile.TemporaryDirectory(prefix="rid-daq-") as place:
        elsewhere = replace(session, cell=bare, runs=Path(place))
        return elsewhere.record(
            RunRequest("approach", "Motion to the first pose.", there, role="approach")
        )


def _estimate_offset(
    data: RunData | None, plate: PlateConfig, turn: ZeroTurn, readings: Sequence[range]
) -> PlateOffset:
    """Return the offsets from the recorded turn.

    Raises:
        DataQualityError: The recording of the plate cannot be used.
    """
    if data is None:
        raise DataQualityError(
            "no row was recorded: the plate is not zeroed; repeat `rid-daq plate zero`",
            code="RID-RECORDING-EMPTY",
        )
    both = data.recording
    if both.reaction is None:
        raise DataQualityError(
            f"the plate is not zeroed: {'; '.join(data.damage)}", code="RID-RECORDING-ROWS-LOST"
        )
    number: IntArray = np.full(len(both), -1, dtype=np.int64)
    for k, rows in enumerate(readings):
        inside = (both.sample_index >= rows.start) & (both.sample_index < rows.stop)
        number[inside & both.valid] = k
    return find_offset(
        PlateGeometry.from_config(plate),
        turn,
        both.time_s,
        number,
        both.reaction.channels_n,
        both.reaction.valid,
    )
