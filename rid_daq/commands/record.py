"""`rid-daq record`: run a motion on a cell and record it."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from pydantic import JsonValue

from acquisition.motion.plan import plan_motion
from acquisition.motion.rehearsal import SLOWER, rehearsal
from acquisition.motion.samples import MotionSamples
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import require_label
from acquisition.session.frame_recorder import require_listenable
from compensation.feedforward.file import LARGEST_FILE_BYTES, read_feedforward
from compensation.feedforward.torque_limits import refuse_torque
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.formats.yaml_tree import MAX_BYTES
from config.load import LoadedCell, load_cell, load_faults, load_motion, to_yaml
from config.motion.motion import (
    AnyMotion,
    CircleMotion,
    ConstantVelocityMotion,
    MultisineMotion,
    ReversedMotion,
)
from config.motion.path_motion import JointPathMotion, JointTableMotion, PathMotion
from config.simulation.faults import NO_SCRIPT, FaultScript
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate
from rid_daq.jobs.accuracy_watch import AccuracyWatch
from rid_daq.jobs.frames import frames_recorded
from rid_daq.jobs.recording_job import (
    RecordedRun,
    how_it_ended,
    judge,
    record_run,
    stop_document,
    tell_verdict,
)
from rid_daq.live.access import DEFAULT_LISTEN
from rid_daq.live.live_page import Certificate, Listen, Live, Token, live_page
from rid_daq.report.result import write_result
from rid_daq.runs.flange import note_flange
from rid_daq.runs.run_quality import RunQuality
from rid_daq.session.cells import CellName, Realtime, Seed, mountable_cell
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder, as_label, unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.clearance import Cleared, require_cleared
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of_stop


def record(
    cell: CellName,
    motion: Annotated[Path, typer.Argument(metavar="MOTION", help="A motion file.")],
    until: Annotated[
        list[str] | None,
        typer.Option(
            metavar="GOAL",
            help="End early once a standard deviation is reached, as sx3<0.01kgm, fv_axis1<5% or"
            " torque<1.5Nm; repeat for more.",
        ),
    ] = None,
    feedforward: Annotated[
        Path | None,
        typer.Option(
            metavar="FEEDFORWARD", help="Pre-compensation of this motion, by `compensate`."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL",
            help="A model by `identify`: a motion that takes more torque than a joint has by it is"
            " refused.",
        ),
    ] = None,
    label: Annotated[
        str | None, typer.Option(help="What to call the run; the motion file's name if not given.")
    ] = None,
    realtime: Realtime = False,
    seed: Seed = 0,
    payload: Annotated[
        str | None,
        typer.Option(help="What a simulated robot carries, by its name in the plant file."),
    ] = None,
    faults: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A fault script: what goes wrong in a simulated cell."),
    ] = None,
    rehearse: Annotated[
        bool,
        typer.Option(
            "--rehearse",
            help="Drive it once at a quarter of its speed first, into a run of its own.",
        ),
    ] = False,
    frames: Annotated[
        bool,
        typer.Option(
            "--frames",
            help="Every frame on the bus goes into frames.blf of the run, for bus analysers.",
        ),
    ] = False,
    cleared: Cleared = False,
    live: Live = False,
    listen: Listen = DEFAULT_LISTEN,
    token: Token = None,
    certificate: Certificate = None,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Run a motion on a cell and record it into a new run folder.

    The motion is checked against every limit before anything moves (exit code 3). Ctrl-C stops the
    robot (a quick stop, then power off) and keeps what was recorded. It is not an emergency stop.
    Where a goal of --until is not reached by the last period, the exit code is 1. Where more than
    2 % of a drive's answers were lost, or more than 5 periods are bad, it is 6.
    """
    console = Console(as_json)
    loaded = load_cell(cell)
    asked = load_motion(motion)
    check_robot(asked, loaded, motion)
    samples = plan_motion(asked, loaded.robot, loaded.config.cycle_time_s)
    if model is not None:
        refuse_torque(asked, samples, estimate_of(model, loaded), loaded.robot)
    if feedforward is not None:
        samples = with_feedforward(feedforward, asked, samples)
    accuracy = None
    if until or samples.samples_per_period is not None:
        accuracy = AccuracyWatch(until or (), loaded.robot, samples)
    name = label or as_label(motion.stem)
    require_label(name)
    require_cleared(loaded.config, cleared)
    if frames:
        require_listenable(loaded.config.can)
    script = NO_SCRIPT if faults is None else _faults(faults, loaded.config, runs)
    with (
        live_page(console, live, listen, token, certificate) as page,
        mountable_cell(loaded, realtime=realtime, seed=seed, payload=payload, faults=script) as (
            reachable,
            simulated,
        ),
    ):
        if rehearse:
            _rehearse(reachable, loaded, samples, runs, name, console)
        folder = RunFolder.create(runs, name, software=software_versions())
        with unfinished(folder):
            facts: dict[str, JsonValue] = {"robot": loaded.robot.name}
            for file_name, content in loaded.files.items():
                folder.write(file_name, content)
            if simulated is not None:
                facts |= note_flange(folder, loaded, simulated.attached)
            whole = isinstance(asked, JointTableMotion)  # with the rows of the file that it names
            text = to_yaml(asked).encode() if whole else read_file(motion, MAX_BYTES)
            folder.write("motion.yaml", text)
            if faults is not None:
                folder.write("faults.yaml", read_file(faults, MAX_BYTES))
            if feedforward is not None:
                folder.write("feedforward.json", read_file(feedforward, LARGEST_FILE_BYTES))
            with frames_recorded(reachable.can, folder, frames, console):
                run = record_run(
                    reachable,
                    loaded.robot,
                    asked,
                    samples,
                    folder,
                    console,
                    accuracy=accuracy,
                    profile=loaded.amplifier_profile,
                    drive_profile=loaded.drive_profile,
                    page=page,
                )
    with unfinished(folder), how_it_ended(run.ended):
        quality = judge(run, folder)
        report = write_result(folder, run.result)
        folder.finish(run.status, facts | {"rows": run.outcome.rows})
    _tell(console, run, asked, folder, report, accuracy, quality)
    stop = run.outcome.stop
    if stop is not None:
        raise typer.Exit(exit_code_of_stop(stop.code, run.outcome.interrupted_by))
    if quality is not None and not quality.good:
        raise typer.Exit(ExitCode.DATA_QUALITY)
    if accuracy is not None and not accuracy.reached:
        raise typer.Exit(ExitCode.VERDICT_FAILED)


def _faults(path: Path, cell: CellConfig, runs: Path) -> FaultScript:
    """Load a fault script, whose full disk must be one that may be filled."""
    script = load_faults(path, cell)
    if any(fault.kind == "disk_full" for fault in script.program):
        from mock_hw.host.full_disk import refuse_shared_disk

        refuse_shared_disk(runs)
    return script


def _rehearse(
    cell: CellConfig,
    loaded: LoadedCell,
    samples: MotionSamples,
    runs: Path,
    name: str,
    console: Console,
) -> None:
    """Drive a motion slowly once; the command ends here where that is stopped."""
    folder = RunFolder.create(runs, f"{name[:54]} rehearsal", software=software_versions())
    with unfinished(folder):
        for file, content in loaded.files.items():
            folder.write(file, content)
        run = record_run(
            cell,
            loaded.robot,
            f"A rehearsal of {name} at 1/{SLOWER:g} of its speed.",
            rehearsal(samples),
            folder,
            console,
            role="rehearsal",
            profile=loaded.amplifier_profile,
            drive_profile=loaded.drive_profile,
        )
    alone = "That was the rehearsal; nothing else was driven."
    with unfinished(folder), how_it_ended(f"{run.ended} {alone}"):
        write_result(folder, run.result)
        folder.finish(run.status, {"robot": loaded.robot.name, "rows": run.outcome.rows})
    stop = run.outcome.stop
    if stop is None:
        console.say(f"Rehearsed at 1/{SLOWER:g} of the speed: {folder.path}")
        return
    console.document({"rehearsal": str(folder.path), **stop_document(run.outcome)})
    console.verdict(False, f"{run.stop_sentence} {alone}")
    raise typer.Exit(exit_code_of_stop(stop.code, run.outcome.interrupted_by))


def with_feedforward(path: Path, motion: AnyMotion, samples: MotionSamples) -> MotionSamples:
    """Return a planned motion with the feedforward of a file.

    Raises
    ------
    ConfigError
        The file is of another motion, or for another cell.
    """
    file = read_feedforward(path)
    if file.motion != motion:
        raise ConfigError(
            f"{path}: pre-compensates another motion than the one given: make it again with"
            " `rid-daq compensate`"
        )
    return file.onto(samples)


def estimate_of(path: Path, loaded: LoadedCell) -> Estimate:
    """Return the model of a file, of the robot of a cell.

    Raises
    ------
    ConfigError
        It is of another robot.
    """
    estimate = read_estimate(path)
    if estimate.robot.name != loaded.robot.name:
        raise ConfigError(
            f"{path}: is of robot {estimate.robot.name!r}, the cell has {loaded.robot.name!r}"
        )
    return estimate


def check_robot(motion: AnyMotion, loaded: LoadedCell, path: Path) -> None:
    """Refuse a motion file that was written for another robot.

    Raises
    ------
    ConfigError
        The motion names another robot than the cell has.
    """
    if motion.robot != loaded.robot.name:
        raise ConfigError(
            f"{path}: robot: is for {motion.robot!r}, cell {loaded.config.name} has"
            f" {loaded.robot.name!r}; make one with `rid-daq design`, or change the name if the"
            " robots are the same"
        )


def _tell(
    console: Console,
    run: RecordedRun,
    asked: AnyMotion,
    folder: RunFolder,
    report: Path,
    accuracy: AccuracyWatch | None,
    quality: RunQuality | None,
) -> None:
    outcome = run.outcome
    console.document(
        {
            "run": folder.run_id,
            "folder": str(folder.path),
            "report": str(report),
            "status": run.status.value,
            "rows": outcome.rows,
            **stop_document(outcome),
            "accuracy": None
            if accuracy is None
            else {
                "relative_percent": None
                if accuracy.running is None
                else accuracy.running.relative_percent.tolist(),
                "reached": accuracy.reached if accuracy.goals else None,
                "periods": accuracy.periods,
                "goals": accuracy.sentences(),
            },
            "quality": None if quality is None else quality.to_dict(),
            "statistics": outcome.statistics.to_dict(),
        }
    )
    console.say(run.timing_sentence)
    if accuracy is not None and accuracy.running is not None:
        console.say(f"Running estimate: {accuracy.running_sentence()}")
    for sentence in [] if accuracy is None else accuracy.sentences():
        console.say(sentence)
    if not tell_verdict(console, run, quality, folder, report):
        return
    if isinstance(asked, ConstantVelocityMotion | ReversedMotion):
        console.next_step("friction", folder.path)
    elif isinstance(asked, MultisineMotion):
        console.next_step("loop", folder.path)
    elif isinstance(asked, CircleMotion | PathMotion | JointPathMotion | JointTableMotion):
        console.next_step("tracking", folder.path)
    elif run.is_periodic:
        console.next_step("identify", folder.path)
    else:
        console.next_step("validate", "MODEL", folder.path)
