"""A guided payload session: check, rehearse, warm up, run, attach, run, identify."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.motion_file import AnyMotion, motion_content
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import ConfigError
from config.load import LoadedCell, load_cell, load_robot, to_yaml
from identification.payload.file import write_payload
from identification.payload.motion import PayloadSearch, design_payload_motion
from identification.payload.procedures import TORQUE_CONSTANT_SIGMA, PayloadOptions
from identification.payload.rating import refuse_heavier
from identification.payload.verdict import PayloadResult
from rid_daq.operations.cell_files import estimate_for, motion_for
from rid_daq.operations.payload.payload_estimate import PayloadRequest, payload_from_runs
from rid_daq.operations.payload.payload_session import UNLOADED, PayloadSessionRequest
from rid_daq.operations.payload.session_state import STATE, SessionState
from rid_daq.operations.payload.session_steps import SESSION_MOTION, PayloadGuide, StepFailed
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.run_session import open_session
from rid_daq.report.result import Result
from rid_daq.report.sections.payload import PayloadSection, payload_verdict
from rid_daq.report.sections.runs import CellSection, RunSection
from rid_daq.report.sections.timing import Timing
from rid_daq.report.sections.verdict import VerdictSection
from rid_daq.report_page.write import write_result
from rid_daq.requests.cell_options import Simulation
from rid_daq.runs.flange import compared
from rid_daq.runs.origins import note_cell
from rid_daq.runs.run_data import MOTION, ROBOT, require_own
from rid_daq.session.session import unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.choices import PAYLOAD
from rid_daq.terminal.context import Context

PERIOD_S: Final = 7.2


@dataclass(frozen=True)
class SessionIdentified:
    """The payload of a session.

    Attributes:
        state: What was done.
        judged: The payload.
        section: The payload as the report has it.
        verdict: Whether it is as certain as was asked for.
        file, report: Where payload and report are.
    """

    state: SessionState
    judged: PayloadResult
    section: PayloadSection
    verdict: VerdictSection
    file: Path
    report: Path


def run_payload_session(
    request: PayloadSessionRequest, context: Context
) -> SessionIdentified | StepFailed:
    """Lead through a session, or go on with an interrupted one.

    Raises:
        ConfigError, PreflightError: It was refused before anything moved, also for a model of
            another robot, or a person said no.
        LimitError: The payload is said to be heavier than the robot can carry.
        RidDaqError: As `RunSession.recording` and `payload_from_runs`.
    """
    loaded = load_cell(request.cell)
    state: SessionState | None = None
    if request.resume is not None:
        state = SessionState.read(find_run(request.runs, request.resume, having=STATE))
        request = request.as_begun(state.asked)
    known = tuple(each.known() for each in request.known)
    payload_request = PayloadRequest(
        how=PayloadOptions(
            procedure="together" if request.model is None else "model",
            robot=None if request.model is None else estimate_for(request.model, loaded.robot),
            known=known,
            torque_constant_sigma=TORQUE_CONSTANT_SIGMA,
        ),
        limits=request.limits.limits(),
    )
    done: Mapping[str, str] = {} if state is None else state.done
    moves = any(name not in done for name in request.wanted)
    if moves:
        _require_followed(request, payload_request)
        for each in known:
            if each.name == "m":
                refuse_heavier(loaded.robot, each.value)
    if state is None:
        state, motion = _begun(request, loaded)
    else:
        motion = _motion_of(state, loaded)
        context.say(
            f"Session {state.folder.run_id} goes on; done already:"
            f" {', '.join(state.done) or 'nothing'}."
        )
    context.say(motion.describe())
    if moves:
        with (
            unfinished(state.folder),
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
            guide = PayloadGuide(request, session, state, motion, payload_request, context)
            failed = guide.lead()
        if failed is not None:
            return failed
    return _result(state, loaded, payload_request, motion)


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


def _begun(
    request: PayloadSessionRequest, loaded: LoadedCell
) -> tuple[SessionState, FourierMotion]:
    """Return a new session's state and motion."""
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
    state = SessionState(folder, loaded.config.name, asked=request.asked)
    state.write()
    motion.plan(loaded.robot, loaded.config.cycle_time_s)  # within all limits, or refused
    return state, motion


def _motion_of(state: SessionState, loaded: LoadedCell) -> FourierMotion:
    """Return an interrupted session's motion."""
    session = state.folder.run_id
    if state.cell != loaded.config.name:
        raise ConfigError(
            f"--resume {session}: was a session on cell {state.cell}", code="RID-SESSION-OTHER-CELL"
        )
    require_own(state.folder)
    if load_robot(str(state.folder.file(ROBOT))) != loaded.robot:
        raise ConfigError(
            f"--resume {session}: the robot file of cell {state.cell} has changed since: put the"
            " old one back, or begin a new session",
            code="RID-SESSION-OTHER-CELL",
        )
    name = str(state.folder.file(MOTION))
    motion = _periodic(motion_content(state.folder.read(MOTION), name))
    motion.plan(loaded.robot, loaded.config.cycle_time_s)
    return motion


def _periodic(motion: AnyMotion) -> FourierMotion:
    return FourierMotion.require(motion, "a payload session needs a periodic (fourier) motion")


def _result(
    state: SessionState, loaded: LoadedCell, payload_request: PayloadRequest, motion: FourierMotion
) -> SessionIdentified:
    """Identify the payload from the session's runs, judge it, and write the report."""
    data = state.runs()
    carried = [name != UNLOADED for name in state.measurements]
    judged, repeats = payload_from_runs(data, carried, payload_request)
    file = state.folder.file(PAYLOAD)
    write_payload(file, judged)
    state.folder.write(PAYLOAD, file.read_bytes())
    findings = [
        *compared(data, carried, judged),
        *_warm_up_finding(state.facts.get("warm_up")),
    ]
    section = PayloadSection.of(judged, repeats, findings)
    verdict = payload_verdict(judged, state.empty_flange)
    title = f"Payload session on {loaded.config.name}"
    result = Result.new(title, loaded.robot.name).updated(
        cell=CellSection.of(loaded.config),
        payload=section,
        runs=tuple(
            RunSection.of(name, motion.describe(), item.tally, item.robot)
            for name, item in zip(state.measurements, data, strict=True)
        ),
        verdict=verdict,
        timing=Timing(
            created_utc=state.folder.manifest().created_utc, run_ids=tuple(state.done.values())
        ),
    )
    report = write_result(state.folder, result)
    word = "passed" if judged.passed else "failed"
    state.folder.finish(RunStatus.COMPLETE, {"robot": loaded.robot.name, "verdict": word})
    return SessionIdentified(state, judged, section, verdict, file, report)


def _warm_up_finding(warm: Any) -> list[str]:
    if not isinstance(warm, dict):
        return []
    return [
        f"Warm-up: {warm['verdict']} after {warm['periods']} periods; friction still changed by"
        f" {warm['drift_percent'] or 0.0:.2f} % a period."
    ]
