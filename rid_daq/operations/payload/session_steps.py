"""`PayloadGuide`: the motions of a payload session, one after the other, and what was asked."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from pydantic import JsonValue

from acquisition.motion.kinds.fourier import FourierMotion
from config.errors import ConfigError, PreflightError
from config.load import to_yaml
from identification.payload.periodic_runs import PeriodicRuns
from rid_daq.operations.payload.payload_estimate import PayloadRequest, periodic_runs
from rid_daq.operations.payload.payload_session import UNLOADED, PayloadSessionRequest
from rid_daq.operations.payload.session_state import (
    EMPTY_FLANGE,
    SessionState,
    is_measurement,
)
from rid_daq.operations.payload.session_watches import MassWatch, WarmUpWatch
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.preflight.last_pose import PoseRule
from rid_daq.preflight.preflight import lines_before_bus, preflight
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_session import RunRequest, RunSession, Watch
from rid_daq.report.sections.payload import EmptyFlange
from rid_daq.runs.run_data import MOTION
from rid_daq.terminal.clearance import require_cleared, require_yes
from rid_daq.terminal.context import Context

PREFLIGHT_S: Final = 0.5
REHEARSAL: Final = "rehearsal"
SESSION_MOTION: Final = "Of a payload session."
"""The comment of the motion that a session keeps; its steps drive it, or slower or longer."""
WARM_UP: Final = "warm-up"


@dataclass(frozen=True)
class Step:
    """One motion of a session: its name, what is driven, and what follows it."""

    name: str
    motion: FourierMotion
    watch: Watch | None = None


@dataclass(frozen=True)
class StepFailed:
    """A step that was stopped, or after it, or lost too much; the session can be resumed."""

    name: str
    run: RecordedRun
    session_id: str


@dataclass(frozen=True)
class PayloadGuide:
    """Does the steps of a session, and keeps what is done.

    Attributes:
        request: What was asked for.
        session: Records the motions.
        state: What is done.
        motion: What is asked about the payload.
        payload_request: How it will be estimated.
        context: Where it is told, and a person asked.
    """

    request: PayloadSessionRequest
    session: RunSession
    state: SessionState
    motion: FourierMotion
    payload_request: PayloadRequest
    context: Context

    def lead(self) -> StepFailed | None:
        """Do what is left to do; return the step that failed, where one did."""
        request, session = self.request, self.session
        if session.simulated is None and request.payload is not None:
            raise ConfigError(
                f"--payload is for a simulated cell that is started here, not for {request.cell}",
                code="RID-CELL-NOT-OURS",
            )
        self._preflight()
        self._require_cleared()
        if UNLOADED in request.wanted and UNLOADED not in self.state.done:
            self.state.note_fact(EMPTY_FLANGE, self._empty_flange().value)
        for step in self._steps():
            run = self._recorded(step)
            measurement = is_measurement(step.name)
            if measurement and run.quality is not None:
                for sentence in run.quality.sentences():
                    self.context.say(f"{step.name}: {sentence}")
            if run.outcome.stop is not None or (measurement and run.exit_code):
                return StepFailed(step.name, run, self.state.folder.run_id)
            self.state.note_step(step.name, run.folder.run_id)
            if run.outcome.late_stop is not None and self._is_left:
                return StepFailed(step.name, run.as_step(), self.state.folder.run_id)
        return None

    @property
    def _is_left(self) -> bool:
        """Whether a motion is still to come."""
        return any(name not in self.state.done for name in self.request.wanted)

    @property
    def _asks(self) -> bool:
        """Whether a person is asked: on a real cell, and where a session is practised."""
        return self.session.simulated is None or self.request.practise

    def _require_cleared(self) -> None:
        config, request = self.session.loaded.config, self.request
        if request.yes and not config.simulated:
            self.context.say(f"Nobody in cell {config.name}, the emergency stop at hand: by --yes.")
        motion = to_yaml(self.motion, SESSION_MOTION).encode()
        require_cleared(
            config,
            request.yes,
            self.context,
            practise=request.practise,
            files={**self.session.loaded.files, MOTION: motion},
        )

    def _empty_flange(self) -> EmptyFlange:
        """Ask whether nothing hangs on the flange: the torques of two runs alone cannot tell.

        Raises:
            PreflightError: Something hangs there, or nobody can be asked.
        """
        if not self._asks:
            return EmptyFlange.SIMULATED
        question = "Is the flange empty: no payload, gripper or cable hangs on it?"
        if self.request.yes:
            self.context.say(f"{question} Answered by --yes.")
            return EmptyFlange.BY_FLAG
        if not self.context.can_ask:
            raise PreflightError(
                f"{question} Nobody can be asked here: answer by the flags (--yes)",
                code="RID-ANSWER-NOBODY",
            )
        if not self.context.confirm(question):
            raise PreflightError(
                "nothing was moved: take off what hangs on the flange, then go on with --resume"
                f" {self.state.folder.run_id}; or weigh against a model of the robot as it stands"
                " (--model)",
                code="RID-ANSWER-NO",
            )
        return EmptyFlange.SAID if self.session.simulated is None else EmptyFlange.SIMULATED

    def _preflight(self) -> None:
        request, session = self.request, self.session
        before = lines_before_bus(session.loaded, request.runs, AxisTestRule(request.axis_test))
        pose = PoseRule.COMPARED if session.simulated is None else PoseRule.LEFT_OUT
        lines, problem = preflight(
            session.loaded, session.cell, before, PREFLIGHT_S, cleared=True, pose=pose
        )
        red = [line for line in lines if line.verdict == "red"]
        for line in red:
            self.context.say(f"RED {line.where}, {line.what}: {line.next_action}")
        if problem is not None:
            raise problem
        if red:
            raise PreflightError(
                f"red lines in the preflight: {len(red)}; see `rid-daq check`",
                code="RID-PREFLIGHT-RED",
            )
        self.context.say(f"Preflight: {len(lines)} lines, none red.")

    def _steps(self) -> Iterator[Step]:
        """Yield the steps that are left; between them the payload is attached."""
        request, done = self.request, self.state.done
        if request.rehearsal_percent and REHEARSAL not in done:
            share, cycle_s = request.rehearsal_percent / 100.0, self.session.cell.cycle_time_s
            yield Step(REHEARSAL, rehearsal_of(self.motion, share, cycle_s))
        warm = UNLOADED in request.wanted and UNLOADED not in done
        if warm:
            yield from self._warm_up()
            yield Step(UNLOADED, self.motion)
        self._attach()
        if not warm:
            yield from self._warm_up()
        for name in request.wanted:
            if name not in done:
                before, goal_kg = self._averages(), request.until_mass_kg
                robot = self.session.loaded.robot
                watch = MassWatch(robot, before, self.payload_request, goal_kg)
                yield Step(name, self.motion, watch)

    def _warm_up(self) -> Iterator[Step]:
        request = self.request
        if not request.warm_up_percent:
            self.state.note_fact("warm_up", "skipped")
            return
        watch = WarmUpWatch(request.warm_up_percent, self.context.warms_up)
        most = {"periods": request.warm_up_periods, "transient_periods": 0}
        yield Step(WARM_UP, self.motion.model_copy(update=most), watch)
        fact: JsonValue = {
            "drift_percent": watch.drift_percent,
            "periods": watch.periods,
            "verdict": "settled" if watch.settled else "NOT settled",
            "settled_percent": request.warm_up_percent,
        }
        self.state.note_fact("warm_up", fact)

    def _attach(self) -> None:
        simulated, payload = self.session.simulated, self.request.payload
        if self._asks:
            self.context.say("The robot stands still, its power is off. Attach the payload.")
            require_yes(self.context, "Is the payload attached?", self.request.yes)
            self._require_cleared()
        if simulated is None:
            return
        simulated.attach(payload)
        self.context.say(f"On the simulated flange: {payload or 'nothing'}.")

    def _recorded(self, step: Step) -> RecordedRun:
        cell, loaded = self.session.cell, self.session.loaded
        text = to_yaml(step.motion, f"Of a payload session: {step.name}.")
        return self.session.record(
            RunRequest(
                f"{self.request.label} {step.name}"[:64],
                f"Payload session: {step.name}. {step.motion.describe()}",
                step.motion.plan(loaded.robot, cell.cycle_time_s),
                role=step.name,
                files={MOTION: text.encode()},
                watch=step.watch,
            )
        )

    def _averages(self) -> PeriodicRuns | None:
        """Return the runs so far that the mass is followed from."""
        if not self.state.measurements or self.payload_request.only_in_time:
            return None
        return periodic_runs(
            [item.average for item in self.state.runs()],
            [name != UNLOADED for name in self.state.measurements],
            self.payload_request,
        )


def rehearsal_of(motion: FourierMotion, speed: float, cycle_s: float) -> FourierMotion:
    """Return one period of the same path at a share of its speed, or a little less."""
    cycles = math.ceil(motion.period_s / speed / cycle_s - 1e-9)
    return motion.model_copy(
        update={"period_s": cycles * cycle_s, "periods": 1, "transient_periods": 0}
    )
