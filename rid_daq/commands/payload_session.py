"""`rid-daq payload CELL`: a guided session from preflight to a payload with its verdict."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from acquisition.motion.plan import plan_motion
from acquisition.processing.periods import average_periods
from acquisition.runs.catalogue import find_run
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.cell.cell import CellConfig
from config.errors import ConfigError, PreflightError
from config.load import LoadedCell, load_cell, load_motion, load_robot, to_yaml
from config.motion.motion import FourierMotion
from identification.estimation.file import read_estimate
from identification.payload.file import write_payload
from identification.payload.motion import PayloadSearch, design_payload_motion
from identification.payload.periodic_runs import PeriodicRuns
from identification.payload.procedures import PayloadOptions
from identification.payload.verdict import PayloadLimits
from rid_daq.commands.check import preflight
from rid_daq.commands.payload_identify import PAYLOAD, known_quantity
from rid_daq.commands.record import check_robot
from rid_daq.jobs.payload_job import PayloadRequest, weigh_runs
from rid_daq.jobs.payload_steps import (
    PayloadSteps,
    SessionState,
    new_run,
    rehearsal_of,
    require_yes,
)
from rid_daq.jobs.payload_watch import MassWatch, WarmUpWatch, Watch
from rid_daq.jobs.recording_job import stop_document
from rid_daq.live.access import DEFAULT_LISTEN
from rid_daq.live.live_page import Certificate, Listen, Live, Token, live_page
from rid_daq.report.payload_section import payload_section, payload_verdict, tell_payload
from rid_daq.report.result import new_result, write_result
from rid_daq.report.sections import cell_section, motion_sentence, run_section
from rid_daq.runs.flange import compared
from rid_daq.runs.run_data import ROBOT, read_run, require_own
from rid_daq.runs.run_quality import run_quality
from rid_daq.session.cells import CellName, mountable_cell
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder, unfinished
from rid_daq.session.versions import software_versions
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode, exit_code_of_stop

PERIOD_S = 7.2
WEIGHED = ("unloaded", "loaded")
"""How the names of the steps begin that the payload is estimated from."""


def session(
    cell: CellName,
    motion: Annotated[
        Path | None,
        typer.Option(metavar="MOTION", help="A periodic motion; one is searched if not given."),
    ] = None,
    periods: Annotated[int, typer.Option(min=2, help="Periods measured in each run at most.")] = 18,
    repeats: Annotated[int, typer.Option(min=1, max=20, help="Runs with the payload.")] = 1,
    model: Annotated[
        Path | None,
        typer.Option(metavar="MODEL", help="The unloaded robot, in place of the unloaded run."),
    ] = None,
    payload: Annotated[
        str | None,
        typer.Option(help="What is hung on a simulated robot, by its name in the plant file."),
    ] = None,
    known: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=VALUE[+-SIGMA]", help="Known otherwise, as m=2.805+-0.005."),
    ] = None,
    until_mass_kg: Annotated[
        float | None,
        typer.Option("--until-mass", min=1e-4, help="End the loaded run at this 2σ of the mass."),
    ] = None,
    rehearsal_percent: Annotated[
        float,
        typer.Option("--rehearsal", min=0.0, max=100.0, help="Its speed [%]; 0 skips it."),
    ] = 25.0,
    warm_up_percent: Annotated[
        float,
        typer.Option("--warm-up", min=0.0, help="Warm at this change a period [%]; 0 skips it."),
    ] = 1.0,
    warm_up_periods: Annotated[
        int, typer.Option("--warm-up-periods", min=3, help="Periods of the warm-up at most.")
    ] = 30,
    mass_limit_percent: Annotated[
        float, typer.Option("--mass-limit", min=0.0, help="2σ of the mass at most [%].")
    ] = PayloadLimits.mass_percent,
    centre_limit_mm: Annotated[
        float, typer.Option("--centre-limit", min=0.0, help="2σ of the centre at most [mm].")
    ] = PayloadLimits.centre_mm,
    inertia_limit_percent: Annotated[
        float, typer.Option("--inertia-limit", min=0.0, help="2σ of inertia at most [%].")
    ] = PayloadLimits.inertia_percent,
    label: Annotated[str, typer.Option(help="What to call the session and its runs.")] = "payload",
    resume: Annotated[
        str | None,
        typer.Option(metavar="SESSION", help="Go on with an interrupted session (its folder, id)."),
    ] = None,
    yes: Annotated[
        bool,
        typer.Option(
            "--yes",
            help="Every question is answered with yes: the cell is clear, the payload is attached.",
        ),
    ] = False,
    seed: Annotated[int, typer.Option(min=0, help="Of the motion and a simulated cell.")] = 0,
    live: Live = False,
    listen: Listen = DEFAULT_LISTEN,
    token: Token = None,
    certificate: Certificate = None,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Lead through a payload session: check, rehearse, warm up, run, attach, run, weigh.

    An interrupted session goes on with --resume: what was recorded counts.
    """
    console = Console(as_json)
    loaded = load_cell(cell)
    weighing = PayloadRequest(
        how=PayloadOptions(
            procedure="together" if model is None else "model",
            robot=None if model is None else read_estimate(model),
            known=tuple(known_quantity(text) for text in known or []),
        ),
        limits=PayloadLimits(mass_limit_percent, centre_limit_mm, inertia_limit_percent),
    )
    state, asked = _begin(loaded, motion, periods, seed, label, resume, runs, console)
    wanted = [
        *(["unloaded"] if model is None else []),
        *(f"loaded {i + 1}" for i in range(repeats)),
    ]
    if any(name not in state.done for name in wanted):
        with (
            unfinished(state.folder),
            live_page(console, live, listen, token, certificate) as page,
            mountable_cell(loaded, seed=seed) as (reachable, simulated),
        ):
            if simulated is None and payload is not None:
                raise ConfigError(
                    f"--payload is for a simulated cell that is started here, not for {cell}"
                )
            _preflight(loaded, reachable, runs, console)
            steps = PayloadSteps(loaded, reachable, console, simulated, page)
            guide = _Guide(steps, state, asked, label)
            empty = ", no payload attached" if "unloaded" in wanted else ""
            clear = f"Nobody in cell {loaded.config.name}, emergency stop at hand{empty}?"
            require_yes(console, clear, yes or loaded.config.simulated)
            if rehearsal_percent and "rehearsal" not in state.done:
                slow = rehearsal_of(asked, rehearsal_percent / 100.0, reachable.cycle_time_s)
                guide.step("rehearsal", slow)
            warm = False
            if "unloaded" in wanted and "unloaded" not in state.done:
                _warm_up(guide, warm_up_percent, warm_up_periods)
                warm = True
                guide.step("unloaded", asked)
            if simulated is None:
                attach = "The robot stands still, its power is off. Attach the payload; leave."
                require_yes(console, attach, yes)
            else:
                simulated.attach(payload)
                console.say(f"On the simulated flange: {payload or 'nothing'}.")
            if not warm:
                _warm_up(guide, warm_up_percent, warm_up_periods)
            for name in wanted:
                if name not in state.done:
                    before = guide.averages(weighing)
                    watch = MassWatch(loaded.robot, before, weighing, until_mass_kg)
                    guide.step(name, asked, watch)
    _finish(state, loaded, weighing, asked, runs, console)


class _Guide:
    """Does the steps of a session, and keeps what is done."""

    def __init__(
        self, steps: PayloadSteps, state: SessionState, motion: FourierMotion, label: str
    ) -> None:
        self._steps, self._state, self._label = steps, state, label
        self.motion = motion

    def step(self, name: str, motion: FourierMotion, watch: Watch | None = None) -> None:
        """Record one step; where it is stopped the session can be resumed."""
        folder = new_run(self._state.folder, self._label, name)
        outcome = self._steps.record(motion, folder, name, watch)
        if outcome.stop is not None:
            console = self._steps.console
            console.document({"step": name, "folder": str(folder.path), **stop_document(outcome)})
            console.verdict(False, f"Stopped in step {name}: {outcome.stop.text}")
            console.say(f"Go on with: {self._resume}")
            raise typer.Exit(exit_code_of_stop(outcome.stop.code, outcome.interrupted_by))
        if name.startswith(WEIGHED):
            self._require_good(name, folder)
        self._state.done[name] = folder.run_id
        self._state.write()

    def _require_good(self, name: str, folder: RunFolder) -> None:
        """Leave a run that lost too much out of the session: it has to be driven again."""
        quality = run_quality(read_run(folder).recording)
        console = self._steps.console
        for sentence in quality.sentences():
            console.say(f"{name}: {sentence}")
        if not quality.good:
            told = {"step": name, "folder": str(folder.path), "quality": quality.to_dict()}
            console.document(told)
            console.verdict(False, f"Step {name} is not good enough to weigh by: {quality.trouble}")
            console.say(f"Drive it again with: {self._resume}")
            raise typer.Exit(ExitCode.DATA_QUALITY)

    @property
    def _resume(self) -> str:
        return f"rid-daq payload CELL --resume {self._state.folder.run_id}"

    def note(self, name: str, fact: Any) -> None:
        """Keep a fact of the session."""
        self._state.facts[name] = fact
        self._state.write()

    def averages(self, weighing: PayloadRequest) -> PeriodicRuns | None:
        """Return the runs so far that the payload is estimated from."""
        names = [name for name in self._state.done if name.startswith(WEIGHED)]
        if not names:
            return None
        root = self._state.folder.path.parent
        data = [read_run(find_run(root, self._state.done[name])) for name in names]
        return PeriodicRuns(
            tuple(average_periods(item.recording) for item in data),
            tuple(name != "unloaded" for name in names),
            weighing.band_hz,
            weighing.standstill_rad_s,
        )


def _begin(
    loaded: LoadedCell,
    motion: Path | None,
    periods: int,
    seed: int,
    label: str,
    resume: str | None,
    runs: Path,
    console: Console,
) -> tuple[SessionState, FourierMotion]:
    """Return a new session's state or an interrupted one's, and its motion."""
    state: SessionState | None = None
    if resume is not None:
        state = SessionState.read(find_run(runs, resume))
        if state.cell != loaded.config.name:
            raise ConfigError(f"--resume {resume}: was a session on cell {state.cell}")
        require_own(state.folder)
        if load_robot(str(state.folder.file(ROBOT))) != loaded.robot:
            raise ConfigError(
                f"--resume {resume}: the robot file of cell {state.cell} has changed since: put the"
                " old one back, or begin a new session"
            )
        asked = load_motion(state.folder.file("motion.yaml"))
        console.say(f"Resumed; done already: {', '.join(state.done) or 'nothing'}.")
    elif motion is not None:
        asked = load_motion(motion)
        check_robot(asked, loaded, motion)
    else:
        cycle_s = loaded.config.cycle_time_s
        search = PayloadSearch(
            loaded.robot,
            round(PERIOD_S / cycle_s) * cycle_s,
            cycle_s,
            workspace=loaded.config.workspace,
        )
        asked = design_payload_motion(search, seed=seed, periods=periods)
    if not isinstance(asked, FourierMotion):
        raise ConfigError("a payload session needs a periodic (fourier) motion")
    if state is None:
        folder = RunFolder.create(runs, label, kind="payload session", software=software_versions())
        for name, content in loaded.files.items():
            folder.write(name, content)
        folder.write("motion.yaml", to_yaml(asked, "Of a payload session.").encode())
        state = SessionState(folder, loaded.config.name)
        state.write()
    plan_motion(asked, loaded.robot, loaded.config.cycle_time_s)  # within all limits, or refused
    console.say(motion_sentence(asked))
    return state, asked


def _preflight(loaded: LoadedCell, reachable: CellConfig, runs: Path, console: Console) -> None:
    lines, problem = preflight(loaded, reachable, runs, 0.5)
    red = [line for line in lines if line.verdict == "red"]
    for line in red:
        console.say(f"RED {line.where}, {line.what}: {line.next_action}")
    if problem is not None:
        raise problem
    if red:
        raise PreflightError(f"red lines in the preflight: {len(red)}; see `rid-daq check`")
    console.say(f"Preflight: {len(lines)} lines, none red.")


def _warm_up(guide: _Guide, percent: float, most: int) -> None:
    if not percent:
        guide.note("warm_up", "skipped")
        return
    watch = WarmUpWatch(percent)
    longer = guide.motion.model_copy(update={"periods": most, "transient_periods": 0})
    guide.step("warm-up", longer, watch)
    settled = "settled" if watch.settled else "NOT settled"
    guide.note(
        "warm_up",
        {"drift_percent": watch.drift_percent, "periods": watch.periods, "verdict": settled},
    )


def _finish(
    state: SessionState,
    loaded: LoadedCell,
    weighing: PayloadRequest,
    asked: FourierMotion,
    runs: Path,
    console: Console,
) -> None:
    """Weigh the payload from the session's runs, judge it, and write the report."""
    names = [name for name in state.done if name.startswith(WEIGHED)]
    data = [read_run(find_run(runs, state.done[name])) for name in names]
    judged, repeats = weigh_runs(data, [name != "unloaded" for name in names], weighing)
    file = state.folder.file(PAYLOAD)
    write_payload(file, judged)
    state.folder.write(PAYLOAD, file.read_bytes())
    result = new_result(f"Payload session on {loaded.config.name}", loaded.robot.name)
    result["cell"] = cell_section(loaded.config)
    section = payload_section(judged, repeats)
    section["findings"] += compared(data, [name != "unloaded" for name in names], judged)
    warm = state.facts.get("warm_up")
    if isinstance(warm, dict):
        section["findings"].append(
            f"Warm-up: {warm['verdict']} after {warm['periods']} periods; friction still changed by"
            f" {warm['drift_percent'] or 0.0:.2f} % a period."
        )
    result["payload"] = section
    result["runs"] = [
        run_section(name, motion_sentence(asked), item.recording, item.robot)
        for name, item in zip(names, data, strict=True)
    ]
    result["verdict"] = payload_verdict(judged)
    result["timing"] = {
        "created_utc": state.folder.manifest().created_utc,
        "run_ids": list(state.done.values()),
    }
    report = write_result(state.folder, result)
    word = "passed" if judged.passed else "failed"
    state.folder.finish(RunStatus.COMPLETE, {"robot": loaded.robot.name, "verdict": word})
    console.document(
        {
            "session": state.folder.run_id,
            "file": str(file),
            "payload": section,
            "verdict": result["verdict"],
            "done": state.done,
            "facts": state.facts,
            "report": str(report),
        }
    )
    tell_payload(console, section)
    console.verdict(judged.passed, result["verdict"]["headline"])
    console.say(f"Payload: {file}")
    console.say(f"Report: {report}")
    if not judged.passed:
        raise typer.Exit(ExitCode.VERDICT_FAILED)
