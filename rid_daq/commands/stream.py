"""`rid-daq stream`: follow a path with the compensation computed on line."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from acquisition.motion.plan import plan_motion
from acquisition.motion.samples import MotionSamples
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import require_label
from acquisition.session.record import RecordOutcome
from acquisition.task.set_points import SetPointSource
from compensation.loops import loop_file
from compensation.loops.loop_file import read_loops
from compensation.online.online import OnlineFeedforward
from compensation.online.point_source import BUFFER_S
from compensation.online.stream import (
    CLIENT_PATIENCE_S,
    StreamOptions,
    stream_motion,
    stream_socket,
)
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.formats.bounded_file import read_file
from config.formats.yaml_tree import MAX_BYTES
from config.load import LoadedCell, load_cell, load_motion, to_yaml
from config.motion.motion import AnyMotion
from config.motion.path_motion import JointTableMotion
from identification.estimation import file as estimate_file
from identification.estimation.file import read_estimate
from rid_daq.commands.record import check_robot
from rid_daq.jobs.recording_job import (
    RecordedRun,
    how_it_ended,
    judge,
    record_run,
    stop_document,
    tell_verdict,
)
from rid_daq.report.result import write_result
from rid_daq.runs.run_quality import RunQuality
from rid_daq.session.cells import CellName, Realtime, Seed, reachable_cell
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder, as_label, unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.clearance import Cleared, require_cleared
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of_stop
from rid_daq.terminal.unread_options import refuse_unread


def stream(
    context: typer.Context,
    cell: CellName,
    model: Annotated[Path, typer.Option(metavar="MODEL", help="A model by `identify`.")],
    loop: Annotated[Path, typer.Option(metavar="LOOPS", help="Velocity loops by `loop`.")],
    motion: Annotated[
        Path | None,
        typer.Argument(
            metavar="[MOTION]",
            help="A motion file; points from another program if not given.",
            show_default=False,
        ),
    ] = None,
    socket: Annotated[
        Path | None,
        typer.Option(
            metavar="PATH",
            help="Where to listen for the program that sends points, in a folder of your own; a"
            " place in the runtime directory if not given.",
        ),
    ] = None,
    wait: Annotated[
        float, typer.Option(min=0.0, metavar="SECONDS", help="How long to wait for its points.")
    ] = CLIENT_PATIENCE_S,
    buffer: Annotated[
        float,
        typer.Option(
            min=0.0, metavar="SECONDS", help="How much of the path is taken in ahead, at least."
        ),
    ] = BUFFER_S,
    plain: Annotated[
        bool, typer.Option("--plain", help="Without compensation: velocity feedforward alone.")
    ] = False,
    label: Annotated[
        str | None, typer.Option(help="What to call the run; the motion file's name if not given.")
    ] = None,
    realtime: Realtime = False,
    seed: Seed = 0,
    cleared: Cleared = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Follow a path more closely: the compensation is computed while the robot moves.

    The path comes from a motion file, or point by point from another program over a local socket.
    Every point is checked before it is driven. When points stop coming, or a bad one comes, the
    robot is slowed down along the points that it has until it rests (exit code 4 or 5).
    """
    console = Console(as_json)
    loaded = load_cell(cell)
    if motion is not None:
        refuse_unread(context, {"wait"}, "with a motion file")
    asked, samples = _planned(loaded, motion, socket)
    robot, loops = read_loops(loop)
    if robot != loaded.robot.name:
        raise ConfigError(f"{loop}: is of robot {robot!r}, the cell has {loaded.robot.name!r}")
    forward = OnlineFeedforward.identified(loaded.config, loaded.robot, read_estimate(model), loops)
    options = StreamOptions(compensated=not plain, buffer_s=buffer, patience_s=wait)
    name = label or as_label("stream" if motion is None else motion.stem)
    require_label(name)
    require_cleared(loaded.config, cleared)
    with reachable_cell(loaded, realtime=realtime, seed=seed) as reachable:
        folder = RunFolder.create(runs, name, software=software_versions())
        with unfinished(folder):
            for file_name, content in loaded.files.items():
                folder.write(file_name, content)
            folder.write("model.json", read_file(model, estimate_file.LARGEST_FILE_BYTES))
            folder.write("loops.json", read_file(loop, loop_file.LARGEST_FILE_BYTES))
            if asked is not None and motion is not None:
                whole = isinstance(asked, JointTableMotion)
                text = to_yaml(asked).encode() if whole else read_file(motion, MAX_BYTES)
                folder.write("motion.yaml", text)
            run = _streamed(
                loaded, reachable, forward, options, folder, console, asked, samples, socket
            )
    with unfinished(folder), how_it_ended(run.ended):
        quality = judge(run, folder)
        report = write_result(folder, run.result)
        folder.finish(run.status, {"robot": loaded.robot.name, "rows": run.outcome.rows})
    _tell(console, run, quality, folder, report, compensated=not plain, planned=asked is not None)
    stop = run.outcome.stop
    if stop is not None:
        raise typer.Exit(exit_code_of_stop(stop.code, run.outcome.interrupted_by))
    if quality is not None and not quality.good:
        raise typer.Exit(ExitCode.DATA_QUALITY)


def _planned(
    loaded: LoadedCell, motion: Path | None, socket: Path | None
) -> tuple[AnyMotion | None, MotionSamples | None]:
    if motion is None:
        return None, None
    if socket is not None:
        raise ConfigError("points come from the motion file or over --socket: give one of them")
    asked = load_motion(motion)
    check_robot(asked, loaded, motion)
    return asked, plan_motion(asked, loaded.robot, loaded.config.cycle_time_s)


def _streamed(
    loaded: LoadedCell,
    cell: CellConfig,
    forward: OnlineFeedforward,
    options: StreamOptions,
    folder: RunFolder,
    console: Console,
    asked: AnyMotion | None,
    samples: MotionSamples | None,
    socket: Path | None,
) -> RecordedRun:
    """Stream, and return the run."""
    done: list[RecordedRun] = []
    words: AnyMotion | str = "Points that another program sent." if asked is None else asked

    def record(source: SetPointSource) -> RecordOutcome:
        run = record_run(
            cell,
            loaded.robot,
            words,
            samples,
            folder,
            console,
            source=source,
            role="streaming",
            profile=loaded.amplifier_profile,
            drive_profile=loaded.drive_profile,
        )
        done.append(run)
        return run.outcome

    if samples is not None:
        stream_motion(cell, forward, samples, record, options)
    else:
        path = socket or _default_socket(cell)
        listening = _listening(console, path, options.patience_s)
        stream_socket(cell, forward, path, record, options, listening)
    return done[0]


def _default_socket(cell: CellConfig) -> Path:
    from mock_hw.host.runtime_directory import runtime_directory

    return runtime_directory() / f"{cell.name}.points"


def _listening(console: Console, path: Path, patience_s: float) -> Callable[[], None]:
    return lambda: console.say(f"Waiting up to {patience_s:g} s for points at {path}")


def _tell(
    console: Console,
    run: RecordedRun,
    quality: RunQuality | None,
    folder: RunFolder,
    report: Path,
    *,
    compensated: bool,
    planned: bool,
) -> None:
    outcome = run.outcome
    console.document(
        {
            "run": folder.run_id,
            "folder": str(folder.path),
            "report": str(report),
            "status": run.status.value,
            "rows": outcome.rows,
            "compensated": compensated,
            **stop_document(outcome),
            "quality": None if quality is None else quality.to_dict(),
            "statistics": outcome.statistics.to_dict(),
        }
    )
    console.say(run.timing_sentence)
    if tell_verdict(console, run, quality, folder, report) and planned:
        console.next_step("tracking", folder.path)
