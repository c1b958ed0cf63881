"""`PayloadGuide`: perform the states of a payload session in which the robot moves."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from acquisition.motion.kinds.fourier import FourierMotion
from config.errors import ConfigError, PreflightError
from config.load import to_yaml
from identification.payload.periodic_runs import PeriodicRuns
from rid_daq.operations.payload.payload_estimate import PayloadRequest, periodic_runs
from rid_daq.operations.payload.payload_session import UNLOADED, PayloadSessionRequest
from rid_daq.operations.payload.session_states import (
    EMPTY_FLANGE,
    REHEARSAL,
    STATES,
    WARM_UP,
    SessionFile,
    next_state,
)
from rid_daq.operations.payload.session_watches import MassWatch, WarmUpWatch
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.preflight.last_pose import PoseRule
from rid_daq.preflight.preflight import lines_before_bus, preflight
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_request import RunRequest, Watch
from rid_daq.recording.run_session import RunSession
from rid_daq.report.sections.payload import EmptyFlange
from rid_daq.runs.run_data import MOTION
from rid_daq.terminal.clearance import require_cleared, require_yes
from rid_daq.terminal.context import Context
from rid_daq.terminal.job_events import SessionState as State

PREFLIGHT_S: Final = 0.5
SESSION_MOTION: Final = "Motion of a payload session."
"""Comment of the session's motion file; some steps perform the motion slower or longer."""


def enter(session: SessionFile, state: State, context: Context, *, again: bool = False) -> None:
    """Set the state of a session, and show the state to the person."""
    session.enter(state, again=again)
    context.announce_state(session.folder.run_id, state, STATES[state].text)


@dataclass(frozen=True)
class PayloadGuide:
    """Performs the states of a session before `IDENTIFY`.

    Attributes:
        request: Options of the session.
        session: Records the motions.
        file: File of the session, with its completed steps.
        motion: Motion from which the payload is identified.
        payload_request: Options of the payload estimate.
        context: Output for the person, and questions.
    """

    request: PayloadSessionRequest
    session: RunSession
    file: SessionFile
    motion: FourierMotion
    payload_request: PayloadRequest
    context: Context

    def perform_steps(self) -> tuple[str, RecordedRun] | None:
        """Perform the missing steps; if a step fails, return its name and its run.

        Raises:
            ConfigError: A payload is named for a cell that this process does not simulate.
            PreflightError: The preflight has red lines, or a person did not confirm a question.
            RidDaqError: As raised by `preflight` and `RunSession.recording`.
        """
        request, file = self.request, self.file
        if self.session.simulated is None and request.payload is not None:
            raise ConfigError(
                "--payload is only for a simulated cell that this command starts, not for"
                f" {request.cell}",
                code="RID-CELL-NOT-OURS",
            )
        self._run_preflight()
        self._require_cleared(before_start=request.cleared)
        if UNLOADED in self._missing_steps:
            file.note_fact(EMPTY_FLANGE, self._ask_empty_flange().value)
        if not request.warm_up_percent:
            file.note_fact("warm_up", "skipped")
        again = file.state is not State.PREPARE
        state, is_warm = next_state(State.PREPARE, request, file.done, is_warm=False), False
        while state is not State.IDENTIFY:
            enter(file, state, self.context, again=again)
            if state is State.ATTACH:
                self._attach_payload()
            else:
                failed = self._record_state(state)
                if failed is not None:
                    return failed
                is_warm = is_warm or state is not State.REHEARSE
            state = next_state(state, request, file.done, is_warm=is_warm)
            again = False
        return None

    @property
    def _missing_steps(self) -> list[str]:
        return [name for name in self.request.measured_steps if name not in self.file.done]

    @property
    def _asks_person(self) -> bool:
        """False if this process simulates the cell, and --practise is not given."""
        return self.session.simulated is None or self.request.practise

    def _require_cleared(self, *, before_start: bool = False) -> None:
        """Ask if the cell is clear.

        Args:
            before_start: True if a person confirmed that the cell is clear, directly before the
                session was started.

        Raises:
            PreflightError: The cell is not clear, or nobody can be asked.
        """
        config, request = self.session.loaded.config, self.request
        if request.yes and not config.simulated:
            self.context.say(
                f"Confirmed by --yes: nobody is in cell {config.name}, and the"
                " emergency stop is at hand."
            )
        motion = to_yaml(self.motion, SESSION_MOTION).encode()
        require_cleared(
            config,
            request.yes or before_start,
            self.context,
            practise=request.practise,
            files={**self.session.loaded.files, MOTION: motion},
        )

    def _ask_empty_flange(self) -> EmptyFlange:
        """Ask if the flange is empty, because the torques of two runs alone do not show it.

        Raises:
            PreflightError: The flange is not empty, or nobody can be asked.
        """
        if not self._asks_person:
            return EmptyFlange.SIMULATED
        question = "Is the flange empty: no payload, gripper or cable hangs on it?"
        if self.request.yes:
            self.context.say(f"{question} Answered by --yes.")
            return EmptyFlange.BY_FLAG
        if not self.context.can_ask:
            raise PreflightError(
                f"{question} No person can be asked here: answer with --yes",
                code="RID-ANSWER-NOBODY",
            )
        if not self.context.confirm(question):
            raise PreflightError(
                "nothing was moved: remove everything from the flange, then continue with"
                f" --resume {self.file.folder.run_id}; or use a model of the robot with this"
                " flange (--model)",
                code="RID-ANSWER-NO",
            )
        return EmptyFlange.SAID if self.session.simulated is None else EmptyFlange.SIMULATED

    def _run_preflight(self) -> None:
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
                f"the preflight has {len(red)} red lines; see `rid-daq check`",
                code="RID-PREFLIGHT-RED",
            )
        self.context.say(f"Preflight passed: {len(lines)} lines, no red line.")

    def _attach_payload(self) -> None:
        simulated, payload = self.session.simulated, self.request.payload
        if self._asks_person:
            question = (
                "The robot is at rest and its drives are off: attach the payload. Is it attached?"
            )
            require_yes(self.context, question, self.request.yes)
            self._require_cleared()
        if simulated is None:
            return
        simulated.attach(payload)
        self.context.say(f"Payload on the simulated flange: {payload or 'none'}.")

    def _record_state(self, state: State) -> tuple[str, RecordedRun] | None:
        """Record the motion of a state; if the session cannot continue, return step and run."""
        request, motion = self.request, self.motion
        watch: WarmUpWatch | MassWatch | None = None
        match state:
            case State.REHEARSE:
                name, share = REHEARSAL, request.rehearsal_percent / 100.0
                motion = rehearsal_motion(motion, share, self.session.cell.cycle_time_s)
            case State.WARM_UP_WITHOUT | State.WARM_UP_WITH:
                name = WARM_UP
                most = {"periods": request.warm_up_periods, "transient_periods": 0}
                motion = motion.model_copy(update=most)
                watch = WarmUpWatch(request.warm_up_percent, self.context.announce_warm_up)
            case _:
                name = self._missing_steps[0]
                if state is State.RECORD_WITH:
                    robot, goal_kg = self.session.loaded.robot, request.until_mass_kg
                    watch = MassWatch(
                        robot, self._recorded_averages(), self.payload_request, goal_kg
                    )
        is_measured = state in (State.RECORD_WITHOUT, State.RECORD_WITH)
        run = self._record(name, motion, watch)
        if is_measured and run.quality is not None:
            for sentence in run.quality.sentences():
                self.context.say(f"{name}: {sentence}")
        if run.outcome.stop is not None or (is_measured and run.exit_code):
            return name, run
        self.file.note_step(name, run.folder.run_id)
        if isinstance(watch, WarmUpWatch):
            self.file.note_fact("warm_up", watch.fact)
        if run.outcome.late_stop is not None and self._missing_steps:
            return name, run.as_step()
        return None

    def _record(self, name: str, motion: FourierMotion, watch: Watch | None) -> RecordedRun:
        cell, robot = self.session.cell, self.session.loaded.robot
        return self.session.record(
            RunRequest(
                f"{self.request.label} {name}"[:64],
                f"Payload session: {name}. {motion.describe()}",
                motion.plan(robot, cell.cycle_time_s),
                role=name,
                files={MOTION: to_yaml(motion, f"Motion of a payload session: {name}.").encode()},
                watch=watch,
            )
        )

    def _recorded_averages(self) -> PeriodicRuns | None:
        """Return the recorded runs for the running estimate of the mass; None if it has none."""
        if not self.file.measurements or self.payload_request.time_domain_effects:
            return None
        return periodic_runs(
            [item.average for item in self.file.runs()],
            [name != UNLOADED for name in self.file.measurements],
            self.payload_request,
        )


def rehearsal_motion(motion: FourierMotion, speed: float, cycle_s: float) -> FourierMotion:
    """Return one period of the same path at a fraction of its speed (or slightly slower)."""
    cycles = math.ceil(motion.period_s / speed / cycle_s - 1e-9)
    return motion.model_copy(
        update={"period_s": cycles * cycle_s, "periods": 1, "transient_periods": 0}
    )
