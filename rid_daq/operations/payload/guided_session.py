"""`run_payload_session`: a guided payload session from its preflight to the payload."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from pydantic import JsonValue

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.motion_file import AnyMotion, parse_motion
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import ConfigError
from config.load import LoadedCell, load_cell, load_robot, to_yaml
from identification.payload.motion import PayloadSearch, design_payload_motion
from identification.payload.procedures import TORQUE_CONSTANT_SIGMA, PayloadOptions
from identification.payload.rating import refuse_heavier
from rid_daq.operations.cell_files import estimate_for, motion_for
from rid_daq.operations.payload.payload_estimate import PayloadRequest, payload_from_runs
from rid_daq.operations.payload.payload_session import (
    UNLOADED,
    PayloadSessionRequest,
    StoppedSession,
)
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.operations.payload.session_steps import SESSION_MOTION, PayloadGuide, enter
from rid_daq.operations.payload.shared import IdentifiedPayload
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.run_session import open_session
from rid_daq.report.result import Result
from rid_daq.report.sections.runs import CellSection, RunSection
from rid_daq.report.sections.timing import Timing
from rid_daq.requests.cell_options import Simulation
from rid_daq.requests.option import DEFAULT_RUNS
from rid_daq.runs.origins import note_cell
from rid_daq.runs.run_data import MOTION, ROBOT, SESSION, RunData, require_own
from rid_daq.session.session import unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.context import Context
from rid_daq.terminal.job_events import SessionState

PERIOD_S: Final = 7.2


def run_payload_session(
    request: PayloadSessionRequest, context: Context
) -> IdentifiedPayload | StoppedSession:
    """Lead through a session, or go on with an interrupted one.

    Raises:
        ConfigError, PreflightError: It was refused before anything moved, also for a model of
            another robot, or a person said no.
        LimitError: The payload is said to be heavier than the robot can carry.
        RidDaqError: As `RunSession.recording` and `payload_from_runs`.
    """
    loaded = load_cell(request.cell)
    file: SessionFile | None = None
    if request.resume is not None:
        file = SessionFile.read(find_run(request.runs, request.resume, having=SESSION))
        request = request.as_begun(file.request)
    known = tuple(each.known() for each in request.known)
    robot = None if request.model is None else estimate_for(request.model, loaded.robot)
    how = PayloadOptions(
        procedure="together" if robot is None else "model",
        robot=robot,
        known=known,
        torque_constant_sigma=TORQUE_CONSTANT_SIGMA,
    )
    payload_request = PayloadRequest(how, request.limits.limits())
    done = {} if file is None else file.done
    moves = any(name not in done for name in request.wanted)
    if moves:
        if loaded.plant is not None:
            loaded.plant.with_payload(request.payload)  # refused before anything moves
        _require_followed(request, payload_request)
        for each in known:
            if each.name == "m":
                refuse_heavier(loaded.robot, each.value)
    if file is None:
        file, motion = _begun(request, loaded)
    else:
        motion = _motion_of(file, loaded)
        file.request = request.choices
        context.say(
            f"Session {file.folder.run_id} goes on; done already:"
            f" {', '.join(file.done) or 'nothing'}."
        )
    context.say(motion.describe())
    if moves:
        with (
            unfinished(file.folder),
            open_session(
                loaded,
                request.runs,
                context,
                None,  # its steps ask
                AxisTestRule(request.axis_test),
                simulation=Simulation(seed=request.seed, pace=request.pace),
                live=request.live,
            ) as session,
        ):
            guide = PayloadGuide(request, session, file, motion, payload_request, context)
            failed = guide.lead()
        if failed is not None:
            elsewhere = () if request.runs == DEFAULT_RUNS else ("--runs", str(request.runs))
            words = ("payload", request.cell, "--resume", file.folder.run_id, *elsewhere)
            return StoppedSession(*failed, words)
    enter(file, SessionState.IDENTIFY, context, again=not moves)
    data = file.runs()
    found = payload_from_runs(
        data,
        [name != UNLOADED for name in file.measurements],
        payload_request,
        folder=file.folder,
        result=_result_of(file, loaded, motion, data),
        findings=_warm_up_finding(file.facts.get("warm_up")),
        empty=file.empty_flange,
    )
    enter(file, SessionState.DONE, context)
    word = "passed" if found.verdict.passed else "failed"
    file.folder.finish(RunStatus.COMPLETE, {"robot": loaded.robot.name, "verdict": word})
    return replace(found, session=file)


def _require_followed(request: PayloadSessionRequest, payload_request: PayloadRequest) -> None:
    """Refuse to end runs by a mass that cannot be followed while the robot moves."""
    only_in_time = payload_request.only_in_time
    if only_in_time and request.until_mass_kg is not None:
        raise ConfigError(
            f"--until-mass {request.until_mass_kg:g}: {request.model} says {only_in_time}, which is"
            " made up for once a run is complete: the mass cannot be followed while the robot"
            " moves. Leave --until-mass out, or give a model that `rid-daq identify` writes without"
            " --choose",
            code="RID-OPTION-NO-EFFECT",
        )


def _begun(request: PayloadSessionRequest, loaded: LoadedCell) -> tuple[SessionFile, FourierMotion]:
    """Return a new session's file and motion."""
    if request.motion is not None:
        motion = _periodic(motion_for(request.motion, loaded))
    else:
        cycle_s = loaded.config.cycle_time_s
        period_s = round(PERIOD_S / cycle_s) * cycle_s
        search = PayloadSearch(loaded.robot, period_s, cycle_s, workspace=loaded.config.workspace)
        motion = design_payload_motion(search, seed=request.seed, periods=request.periods)
    folder = RunFolder.create(
        request.runs, request.label, kind="payload session", software=software_versions()
    )
    for name, content in loaded.files.items():
        folder.write(name, content)
    folder.write(MOTION, to_yaml(motion, SESSION_MOTION).encode())
    note_cell(folder, loaded)
    file = SessionFile.begin(folder, loaded.config.name, request.choices)
    motion.plan(loaded.robot, loaded.config.cycle_time_s)  # within all limits, or refused
    return file, motion


def _motion_of(file: SessionFile, loaded: LoadedCell) -> FourierMotion:
    """Return an interrupted session's motion."""
    session = file.folder.run_id
    if file.cell != loaded.config.name:
        raise ConfigError(
            f"--resume {session}: was a session on cell {file.cell}", code="RID-SESSION-OTHER-CELL"
        )
    require_own(file.folder)
    if load_robot(str(file.folder.file(ROBOT))) != loaded.robot:
        raise ConfigError(
            f"--resume {session}: the robot file of cell {file.cell} has changed since: put the"
            " old one back, or begin a new session",
            code="RID-SESSION-OTHER-CELL",
        )
    name = str(file.folder.file(MOTION))
    motion = _periodic(parse_motion(file.folder.read(MOTION), name))
    motion.plan(loaded.robot, loaded.config.cycle_time_s)
    return motion


def _periodic(motion: AnyMotion) -> FourierMotion:
    return FourierMotion.require(motion, "a payload session needs a periodic (fourier) motion")


def _result_of(
    file: SessionFile, loaded: LoadedCell, motion: FourierMotion, data: Sequence[RunData]
) -> Result:
    """Return the session's result, without the payload."""
    return Result.new(f"Payload session on {loaded.config.name}", loaded.robot.name).updated(
        cell=CellSection.of(loaded.config),
        runs=tuple(
            RunSection.of(name, motion.describe(), item.tally, item.robot)
            for name, item in zip(file.measurements, data, strict=True)
        ),
        timing=Timing(
            created_utc=file.folder.manifest().created_utc, run_ids=tuple(file.done.values())
        ),
    )


def _warm_up_finding(warm: JsonValue) -> list[str]:
    if not isinstance(warm, dict):
        return []
    return [
        f"Warm-up: {warm['verdict']} after {warm['periods']} periods; friction still changed by"
        f" {warm['drift_percent'] or 0.0:.2f} % a period."
    ]
