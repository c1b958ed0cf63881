"""`measure_velocity_loops`: fit the velocity loops with a multisine run, and write them."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from acquisition.maps.command_timing import CommandTiming
from acquisition.motion.kinds.multisine import MultisineMotion
from acquisition.motion.motion_file import load_motion
from acquisition.runs.catalogue import find_run
from compensation.loops.cascade import advise
from compensation.loops.imported_spectra import imported_spectra
from compensation.loops.loop_file import write_loops
from compensation.loops.loop_measurement import (
    LoopMeasurement,
    measure_loops,
    measure_spectra,
)
from compensation.loops.plausible_inertia import refuse_light_axes
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.load import load_bundled_or_path
from rid_daq.operations.path.loop import LoopRequest
from rid_daq.report.sections.velocity_loops import VelocityLoopsSection
from rid_daq.report_page.write import write_result
from rid_daq.requests.request import refuse_unused
from rid_daq.runs import made_file
from rid_daq.runs.origins import cell_argument
from rid_daq.runs.output_file import refuse_output, register_output
from rid_daq.runs.run_data import RunData, data_defects, result_of


@dataclass(frozen=True)
class MeasuredLoops:
    """Velocity loops that were measured and written.

    Attributes:
        run_id: Id of the run.
        section: Section of the report.
        output: Path of the loop file.
        report: Path of the report.
        notes: Defects of the run's data.
        cell: Cell of the run, as a command's argument.
    """

    run_id: str
    section: VelocityLoopsSection
    output: Path
    report: Path
    notes: list[str]
    cell: str


def measure_velocity_loops(request: LoopRequest) -> MeasuredLoops:
    """Measure the frequency responses of the drives' velocity loops, and write loops and report.

    Raises:
        ConfigError: The run is of another kind of motion, the output file exists already, or the
            position gain is missing for an import or given for a run of a cell.
        RidDaqError: The run cannot be used.
    """
    refuse_output(request.output, request.overwrite, made_file.LOOPS)
    data = RunData.load(find_run(request.runs, request.run), unfinished=request.unfinished)
    notes = data_defects([data])
    found = _measure_import(request, data) if data.import_map else _measure_run(request, data)
    refuse_light_axes(found.cascades, data.robot, data.recording.position.mean(axis=0))
    section = VelocityLoopsSection.of(data.robot, found, advise(found.cascades))
    output = request.output or data.folder.file("loops.json")
    cell = "" if data.cell is None else data.cell.name
    write_loops(output, found.loops, data.robot.name, data.folder.run_id, cell)
    register_output(data.folder, output)
    report = write_result(data.folder, result_of(data, notes).with_sections(velocity_loops=section))
    return MeasuredLoops(
        data.folder.run_id, section, output, report, notes, cell_argument(data.folder)
    )


def _measure_run(request: LoopRequest, data: RunData) -> LoopMeasurement:
    refuse_unused(request, ("position_gain",), "with a run of a cell, whose file states it")
    motion = _multisine_motion(data)
    cell = load_bundled_or_path(str(data.folder.file("cell.yaml")), "cells", CellConfig)
    return measure_loops(data.recording, motion, data.robot, cell.position_gain_per_s)


def _measure_import(request: LoopRequest, data: RunData) -> LoopMeasurement:
    assert data.import_map is not None
    if request.position_gain is None:
        raise ConfigError(
            "an import has no cell, so the gain of the position loop is not known: give"
            " --position-gain, the gain in 1/s for which margins are wanted",
            code="RID-OPTION-NEEDS",
        )
    timing = data.import_map.command_timing or CommandTiming()
    spectra = imported_spectra(data.recording, data.robot, timing)
    return measure_spectra(spectra, request.position_gain)


def _multisine_motion(data: RunData) -> MultisineMotion:
    path = data.folder.file("motion.yaml")
    which = f"run {data.folder.run_id} is"
    instead = "record a motion of `rid-daq design --kind multisine`"
    if not path.exists():
        raise ConfigError(
            f"{which} a recording of an unknown motion: {instead}", code="RID-RUN-FOREIGN"
        )
    motion = load_motion(path)
    return MultisineMotion.require(motion, f"{which} of a {motion.kind} motion: {instead}")
