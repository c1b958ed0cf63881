"""`rid-daq plate`: the force plate under the robot. `zero` finds its offsets."""

from __future__ import annotations

import tempfile
from pathlib import Path
from typing import Annotated, Any, NoReturn

import numpy as np
import typer

from acquisition.journal.plate import PLATE_RECORDING, read_plate_journal
from acquisition.plate_zero.plate_zero import (
    PlateOffset,
    ZeroTurn,
    find_offset,
    plan_turn,
    rest_samples,
    turn_samples,
)
from acquisition.processing.plate_alignment import with_plate
from acquisition.recording.plate_geometry import PlateGeometry
from acquisition.runs.folder import RunFolder
from acquisition.session.plate_preparation import discharge_plate
from config.arrays import FloatArray, IntArray
from config.cell.cell import CellConfig
from config.cell.plate import PlateConfig
from config.errors import ConfigError, DataQualityError
from config.load import LoadedCell, bundled_names, load_cell
from rid_daq.jobs.recording_job import RecordedRun, how_it_ended, record_run, stop_document
from rid_daq.report.result import write_result
from rid_daq.report.zero_section import as_zero, tell_zero, zero_section, zero_verdict
from rid_daq.runs.plate_zero_lines import write_zero, zero_lines
from rid_daq.session.cells import CellName, Realtime, Seed, reachable_cell
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder, unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.clearance import Cleared, require_cleared
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of_stop

ZERO_FILE = "zero.yaml"
STAND_S = 0.5

plate = typer.Typer(
    add_completion=False,
    rich_markup_mode=None,
    no_args_is_help=True,
    help="The force plate under the robot.",
)


@plate.callback()
def _plate() -> None:
    pass


@plate.command("zero")
def zero(
    cell: CellName,
    pose: Annotated[
        str | None,
        typer.Option(
            metavar="RAD,...",
            help="The pose about which axis 1 is turned; the middle of every range if not given.",
        ),
    ] = None,
    read_s: Annotated[
        float, typer.Option("--read", min=1.0, max=600.0, help="How long each reading lasts [s].")
    ] = 5.0,
    settle_s: Annotated[
        float, typer.Option("--settle", min=0.0, max=600.0, help="Rest before each reading [s].")
    ] = 2.0,
    write: Annotated[
        bool,
        typer.Option(
            "--write", help="Put the zero into the cell file; everything else in it is kept."
        ),
    ] = False,
    label: Annotated[str, typer.Option(help="What to call the run.")] = "plate zero",
    realtime: Realtime = False,
    seed: Seed = 0,
    cleared: Cleared = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Find the plate's offsets: read it, turn axis 1 by half a turn, read it, go back, read it.

    The robot moves. The amplifier is reset at rest in the first pose, and operates from then on.
    Half the sum of the readings is the offset, half their difference the moment of gravity; the
    third reading tells the drift. The lines for the cell file are printed. Exit code 1 where the
    zero does not hold.
    """
    console = Console(as_json)
    loaded = load_cell(cell)
    if loaded.config.plate is None or loaded.amplifier_profile is None:
        raise ConfigError(f"cell {loaded.config.name} has no plate: there is nothing to zero")
    if write and cell in bundled_names("cells"):
        raise ConfigError(
            f"--write: {cell} is bundled with the program; `rid-daq init` makes a cell of your own"
        )
    turn = plan_turn(loaded.robot, _pose(pose))
    steps = turn_samples(loaded.robot, turn, settle_s, read_s, loaded.config.cycle_time_s)
    require_cleared(loaded.config, cleared)
    with reachable_cell(loaded, realtime=realtime, seed=seed) as reachable:
        _approach(reachable, loaded, turn, console)
        console.say("2 of 4: the amplifier is reset and operates")
        discharge_plate(_plate_of(reachable), loaded.amplifier_profile)
        console.say("3 of 4: reading, axis 1 there, reading, back, reading")
        folder = RunFolder.create(runs, label, software=software_versions())
        with unfinished(folder):
            for name, content in loaded.files.items():
                folder.write(name, content)
            run = record_run(
                _without_zero(reachable),
                loaded.robot,
                "Axis 1 to one side, to the other and back, with a reading at rest on each.",
                steps[0],
                folder,
                console,
                role="zeroing",
                profile=loaded.amplifier_profile,
            )
        if run.outcome.stop is not None:
            _stopped(run, folder, console)
        with unfinished(folder):
            found = _evaluate(run, folder, _plate_of(reachable), turn, steps[1])
    _conclude(console, run, folder, found, turn, loaded, Path(cell) if write else None)


def _pose(text: str | None) -> FloatArray | None:
    if text is None:
        return None
    try:
        return np.array([float(word) for word in text.split(",")])
    except ValueError:
        raise ConfigError(f"--pose {text}: give one number a joint, such as 0,0.2,-0.4") from None


def _plate_of(cell: CellConfig) -> PlateConfig:
    assert cell.plate is not None
    return cell.plate


def _without_zero(cell: CellConfig) -> CellConfig:
    """Return the cell with its plate as the channels show it."""
    return cell.model_copy(update={"plate": _plate_of(cell).model_copy(update={"zero": None})})


def _approach(cell: CellConfig, loaded: LoadedCell, turn: ZeroTurn, console: Console) -> None:
    """Go to the first pose and stop there, drives off, without a recording to keep.

    Raises
    ------
    typer.Exit
        It was stopped.
    """
    console.say(f"1 of 4: to the first pose ({', '.join(f'{q:.3f}' for q in turn.first)})")
    there = rest_samples(loaded.robot, turn.first, STAND_S, cell.cycle_time_s)
    bare = cell.model_copy(update={"plate": None})
    with tempfile.TemporaryDirectory(prefix="rid-daq-") as place:
        folder = RunFolder.create(Path(place), "approach", software=software_versions())
        run = record_run(
            bare, loaded.robot, "To the first pose.", there, folder, console, role="approach"
        )
    if run.outcome.stop is not None:
        console.document(stop_document(run.outcome))
        console.verdict(False, run.stop_sentence)
        raise typer.Exit(exit_code_of_stop(run.outcome.stop.code, run.outcome.interrupted_by))


def _evaluate(
    run: RecordedRun,
    folder: RunFolder,
    plate: PlateConfig,
    turn: ZeroTurn,
    readings: tuple[range, ...],
) -> PlateOffset:
    """Return what the recorded turn shows.

    Raises
    ------
    DataQualityError, RecordingError
        The plate's side of it cannot be used.
    """
    recording = run.recording
    if recording is None:
        raise DataQualityError("nothing was recorded: the plate is not zeroed")
    both = with_plate(recording, read_plate_journal(folder.file(PLATE_RECORDING)))
    assert both.reaction is not None
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


def _stopped(run: RecordedRun, folder: RunFolder, console: Console) -> NoReturn:
    """Say that it was stopped, and leave."""
    stop = run.outcome.stop
    assert stop is not None
    with unfinished(folder), how_it_ended(run.ended):
        report = write_result(folder, run.result)
        folder.finish(run.status, {"rows": run.outcome.rows})
    console.document({"folder": str(folder.path), **stop_document(run.outcome)})
    console.verdict(False, run.stop_sentence)
    console.say("The plate is not zeroed: start again, or `record` measures from a wrong zero.")
    console.say(f"Report: {report}")
    raise typer.Exit(exit_code_of_stop(stop.code, run.outcome.interrupted_by))


def _conclude(
    console: Console,
    run: RecordedRun,
    folder: RunFolder,
    found: PlateOffset,
    turn: ZeroTurn,
    loaded: LoadedCell,
    target: Path | None,
) -> None:
    """Write report and zero, say them, and leave with 1 where the zero does not hold."""
    described = loaded.config.plate
    assert described is not None
    section = zero_section(found, turn)
    judged = zero_verdict(found, turn, described)
    result: dict[str, Any] = {**run.result, "title": f"Zero of the plate of {loaded.config.name}"}
    result["plate_zero"], result["verdict"] = section, judged
    zero = as_zero(found, turn)
    lines = zero_lines(zero, f"found by `rid-daq plate zero`, run {folder.run_id}")
    folder.write(ZERO_FILE, lines.encode())
    report = write_result(folder, result)
    folder.finish(run.status, {"rows": run.outcome.rows, "zeroed": judged["passed"]})
    written = target is not None and judged["passed"]
    if target is not None and written:
        write_zero(target, zero, f"found by `rid-daq plate zero`, run {folder.run_id}")
    console.document(
        {
            "folder": str(folder.path),
            "report": str(report),
            "zero": zero.model_dump(mode="json"),
            "plate_zero": section,
            "verdict": judged,
            "written": str(target) if written else None,
        }
    )
    tell_zero(console, section)
    console.verdict(judged["passed"], f"{judged['headline']}. {judged['sentence']}")
    console.say(f"Report: {report}")
    if not judged["passed"]:
        raise typer.Exit(ExitCode.VERDICT_FAILED)
    if written:
        console.say(f"4 of 4: written into {target}")
        return
    console.say("4 of 4: put these lines under `plate:` in the cell file (--write does it):")
    console.say(lines.rstrip("\n"))
