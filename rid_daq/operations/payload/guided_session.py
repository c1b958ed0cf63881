"""`run_payload_session`: guided payload session, from the preflight to the identified payload."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Final

from pydantic import JsonValue

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.motion_file import AnyMotion, parse_motion
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import ConfigError
from config.load import LoadedCell, load_cell, load_robot, to_yaml
from identification.payload.file import write_payload
from identification.payload.motion import PayloadSearch, design_payload_motion
from identification.payload.procedures import TORQUE_CONSTANT_SIGMA, PayloadOptions
from identification.payload.rating import refuse_heavier
from rid_daq.operations.cell_files import read_motion_for, read_torque_model, rejection_notes
from rid_daq.operations.payload.payload_estimate import (
    PayloadRequest,
    estimate_payload,
    gear_findings,
    report_payload,
)
from rid_daq.operations.payload.payload_session import (
    UNLOADED,
    PayloadSessionRequest,
    StoppedSession,
)
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.operations.payload.session_steps import SESSION_MOTION, PayloadGuide, enter
from rid_daq.operations.payload.session_watches import warm_up_findings
from rid_daq.operations.payload.shared import IdentifiedPayload
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.run_session import open_session
from rid_daq.report.result import Result
from rid_daq.report.sections.runs import CellSection, RunSection
from rid_daq.report.sections.timing import Timing
from rid_daq.requests.cell_options import Simulation
from rid_daq.requests.option import DEFAULT_RUNS
from rid_daq.runs.flange import compare_with_truth
from rid_daq.runs.origins import write_cell_origin
from rid_daq.runs.run_data import MOTION, ROBOT, SESSION, RunData, require_own
from rid_daq.session.session import mark_unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.choices import PAYLOAD
from rid_daq.terminal.context import Context
from rid_daq.terminal.job_events import SessionState

PERIOD_S: Final = 7.2


def run_payload_session(
    request: PayloadSessionRequest, context: Context
) -> IdentifiedPayload | StoppedSession:
    """Lead through a payload session, or continue an interrupted one.

    Raises:
        ConfigError, PreflightError: The session was refused before anything moved, for example
            because the model is of another robot; or a person answered no.
        LimitError: The stated mass of the payload exceeds the robot's limit.
        RidDaqError: As raised by `RunSession.recording`, `estimate_payload` and `report_payload`.
    """
    loaded = load_cell(request.cell)
    file: SessionFile | None = None
    if request.resume is not None:
        file = SessionFile.read(find_run(request.runs, request.resume, having=(SESSION,)))
        request = request.with_original_options(file.request)
    known = tuple(each.known() for each in request.known)
    robot = None
    if request.model is not None:
        misfit = request.despite_misfit
        robot = read_torque_model(request.model, loaded.robot, despite_misfit=misfit)[0]
        for note in rejection_notes(request.model, robot):
            context.say(f"note: {note}")
    how = PayloadOptions(
        procedure="together" if robot is None else "model",
        robot=robot,
        known=known,
        torque_constant_sigma=TORQUE_CONSTANT_SIGMA,
    )
    payload_request = PayloadRequest(how, request.limits.limits())
    done = {} if file is None else file.done
    moves = any(name not in done for name in request.measured_steps)
    if moves:
        if loaded.plant is not None:
            loaded.plant.with_payload(request.payload)  # raises an error for an unknown payload
        _refuse_until_mass(request, payload_request)
        for each in known:
            if each.name == "m":
                refuse_heavier(loaded.robot, each.value)
    if file is None:
        file, motion = _begin_session(request, loaded, context)
    else:
        motion = _load_motion(file, loaded, request.motion)
        file.request = request.choices
        context.say(
            f"Session {file.folder.run_id} continues; completed steps:"
            f" {', '.join(file.done) or 'none'}."
        )
    context.say(motion.describe())
    if moves:
        with (
            mark_unfinished(file.folder),
            open_session(
                loaded,
                request.runs,
                context,
                None,  # no question here: the steps of the session ask if the cell is clear
                AxisTestRule(request.axis_test),
                simulation=Simulation(seed=request.seed, pace=request.pace),
                live=request.live,
            ) as session,
        ):
            session = replace(session, session_id=file.folder.run_id)
            guide = PayloadGuide(request, session, file, motion, payload_request, context)
            failed = guide.perform_steps()
        if failed is not None:
            elsewhere = () if request.runs == DEFAULT_RUNS else ("--runs", str(request.runs))
            words = ("payload", request.cell, "--resume", file.folder.run_id, *elsewhere)
            return StoppedSession(*failed, words)
    enter(file, SessionState.IDENTIFY, context, again=not moves)
    data = file.runs()
    carried = [name != UNLOADED for name in file.measurements]
    payload, repeats = estimate_payload(data, carried, payload_request)
    path = file.folder.file(PAYLOAD)
    write_payload(path, payload)
    found = report_payload(
        payload,
        repeats,
        path,
        folder=file.folder,
        result=_session_result(file, loaded, motion, data),
        findings=[
            *compare_with_truth(data, carried, payload),
            *gear_findings(data, payload_request),
            *warm_up_findings(file.facts.get("warm_up")),
        ],
        empty=file.empty_flange,
    )
    enter(file, SessionState.DONE, context)
    file.folder.finish(RunStatus.COMPLETE)
    return replace(found, session=file)


def _refuse_until_mass(request: PayloadSessionRequest, payload_request: PayloadRequest) -> None:
    """Refuse --until-mass if the mass cannot be estimated while the robot moves."""
    time_domain_effects = payload_request.time_domain_effects
    if time_domain_effects and request.until_mass_kg is not None:
        raise ConfigError(
            f"--until-mass {request.until_mass_kg:g}: {request.model} contains"
            f" {time_domain_effects}; the mass can then be estimated only after a run is"
            " complete. Leave --until-mass out, or give a model that `rid-daq identify` writes"
            " without --choose",
            code="RID-OPTION-NO-EFFECT",
        )


def _begin_session(
    request: PayloadSessionRequest, loaded: LoadedCell, context: Context
) -> tuple[SessionFile, FourierMotion]:
    """Return the file and the motion of a new session."""
    if request.motion is not None:
        motion = _require_periodic(read_motion_for(request.motion, loaded))
    else:
        cycle_s = loaded.config.cycle_time_s
        period_s = round(PERIOD_S / cycle_s) * cycle_s
        search = PayloadSearch(loaded.robot, period_s, cycle_s, workspace=loaded.config.workspace)
        context.say("Designing a motion for payloads; this can take a minute.")
        with context.progress("Designing", 100.0, "%") as shown:
            motion = design_payload_motion(
                search,
                seed=request.seed,
                periods=request.periods,
                watch=lambda done, total: shown.update(100.0 * done / total, ""),
            )
    facts: dict[str, JsonValue] = {"robot": loaded.robot.name, "cell": loaded.config.name}
    folder = RunFolder.create(
        request.runs,
        request.label,
        kind="payload session",
        software=software_versions(),
        facts=facts | ({"operator": context.operator} if context.operator else {}),
    )
    for name, content in loaded.files.items():
        folder.write(name, content)
    folder.write(MOTION, to_yaml(motion, SESSION_MOTION).encode())
    write_cell_origin(folder, loaded)
    file = SessionFile.begin(folder, loaded.config.name, request.choices)
    motion.plan(loaded.robot, loaded.config.cycle_time_s)  # checks the limits
    return file, motion


def _load_motion(file: SessionFile, loaded: LoadedCell, stated: Path | None) -> FourierMotion:
    """Return the motion of an interrupted session; refuse another `stated` motion."""
    session = file.folder.run_id
    if file.cell != loaded.config.name:
        raise ConfigError(
            f"--resume {session}: this session is of cell {file.cell}, not of"
            f" {loaded.config.name}: give cell {file.cell}",
            code="RID-SESSION-OTHER-CELL",
        )
    require_own(file.folder)
    if load_robot(str(file.folder.file(ROBOT))) != loaded.robot:
        raise ConfigError(
            f"--resume {session}: the robot file of cell {file.cell} has changed since the"
            " session began: restore the old file, or begin a new session",
            code="RID-SESSION-OTHER-CELL",
        )
    name = str(file.folder.file(MOTION))
    motion = _require_periodic(parse_motion(file.folder.read(MOTION), name))
    if stated is not None and read_motion_for(stated, loaded) != motion:
        raise ConfigError(
            f"--motion {stated}: differs from the motion of session {session}, which --resume"
            " continues: leave --motion out, or begin a new session",
            code="RID-OPTION-NO-EFFECT",
        )
    motion.plan(loaded.robot, loaded.config.cycle_time_s)
    return motion


def _require_periodic(motion: AnyMotion) -> FourierMotion:
    return FourierMotion.require(motion, "a payload session needs a periodic (fourier) motion")


def _session_result(
    file: SessionFile, loaded: LoadedCell, motion: FourierMotion, data: Sequence[RunData]
) -> Result:
    """Return the result of the session, without the payload."""
    return Result.new(f"Payload session on {loaded.config.name}", loaded.robot.name).with_sections(
        cell=CellSection.of(loaded.config),
        runs=tuple(
            RunSection.of(name, motion.describe(), item.tally, item.robot)
            for name, item in zip(file.measurements, data, strict=True)
        ),
        timing=Timing(
            created_utc=file.folder.manifest().created_utc, run_ids=tuple(file.done.values())
        ),
    )
