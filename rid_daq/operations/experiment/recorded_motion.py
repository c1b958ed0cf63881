"""`record_motion_file`: plan, check, rehearse, drive and judge the motion of a file."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from acquisition.motion.limits import verify_limits
from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.rehearsal import SLOWER, rehearsal
from acquisition.motion.samples import MotionSamples
from acquisition.runs.manifest import require_label
from acquisition.session.frame_recorder import require_listenable
from acquisition.supervision.commanded import commanded_motion, verify_command
from compensation.compensated_motion import refuse_torque
from config.cell.cell import CellConfig
from config.load import load_cell, read_faults
from config.simulation.faults import NO_SCRIPT, FaultScript
from identification.estimation.limit_torque import limit_warmth
from rid_daq.operations.cell_files import add_feedforward, estimate_for, motion_and_bytes
from rid_daq.operations.experiment.record import RecordRequest
from rid_daq.operations.operation import Context
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.accuracy_watch import AccuracyWatch
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_session import Clearance, RunRequest, open_session
from rid_daq.runs.run_data import FEEDFORWARD, MOTION
from rid_daq.session.session import as_label
from rid_daq.terminal.exit_codes import ExitCode

FAULTS: Final = "faults.yaml"
REHEARSAL_ALONE = "That was the rehearsal; nothing else was driven."


@dataclass(frozen=True)
class RecordedMotion:
    """A motion that was driven and recorded.

    Attributes:
        run: The run; that of the rehearsal where the motion was stopped there.
        motion: What was asked for.
        accuracy: What followed the periods.
        rehearsal_only: Whether the rehearsal was stopped, and nothing else was driven.
    """

    run: RecordedRun
    motion: AnyMotion
    accuracy: AccuracyWatch | None
    rehearsal_only: bool = False

    @property
    def exit_code(self) -> ExitCode:
        """What a script is told: also that a goal of the accuracy was not reached."""
        missed = self.accuracy is not None and not self.accuracy.reached
        return self.run.exit_code or (ExitCode.VERDICT_FAILED if missed else ExitCode.DONE)


def record_motion_file(request: RecordRequest, context: Context) -> RecordedMotion:
    """Record a motion on a cell into a new run folder.

    Raises:
        ConfigError, PreflightError: It was refused before anything moved.
        RidDaqError: As `RunSession.recording`.
    """
    loaded = load_cell(request.cell)
    motion, text = motion_and_bytes(request.motion, loaded)
    files = {MOTION: text}  # what the run is made from, beside the cell's own files: read once
    samples = motion.plan(loaded.robot, loaded.config.cycle_time_s)
    if request.feedforward is not None:
        samples, files[FEEDFORWARD] = add_feedforward(request.feedforward, motion, samples)
        verify_limits(samples, loaded.robot)
        verify_command(samples, loaded.config, loaded.robot)
    if request.model is not None:
        estimate = estimate_for(request.model, loaded.robot)
        refuse_torque(motion, samples, estimate, loaded.robot)
        driven = commanded_motion(samples, loaded.config.position_gain_per_s)
        refuse_torque(motion, driven, estimate, loaded.robot)
        warmth = limit_warmth(estimate)
        if warmth:
            context.say(warmth)
    script = _fault_script(request, loaded.config, files)
    accuracy = None
    if request.until or samples.samples_per_period is not None:
        accuracy = AccuracyWatch(request.until, loaded.robot, samples)
    name = request.label or as_label(request.motion.stem)
    require_label(name)
    if request.frames:
        require_listenable(loaded.config.can)
    asked = RunRequest(
        name,
        motion.describe(),
        samples,
        files=files,
        watch=accuracy,
        frames=request.frames,
    )
    with open_session(
        loaded,
        request.runs,
        context,
        Clearance(request.cleared, request.practise, files),
        AxisTestRule(request.axis_test),
        simulation=request.simulation,
        faults=script,
        live=request.live,
    ) as session:
        if request.rehearse:
            run = session.record(_rehearsal(name, samples)).as_step()
            if run.outcome.stop is not None:
                return RecordedMotion(run, motion, accuracy, rehearsal_only=True)
            context.say(f"Rehearsed at 1/{SLOWER:g} of the speed: {run.folder.path}")
        return RecordedMotion(session.record(asked), motion, accuracy)


def _fault_script(request: RecordRequest, cell: CellConfig, files: dict[str, bytes]) -> FaultScript:
    """Load a fault script, whose full disk must be one that may be filled, and keep its bytes."""
    if request.faults is None:
        return NO_SCRIPT
    script, files[FAULTS] = read_faults(request.faults, cell)
    if any(fault.kind == "disk_full" for fault in script.program):
        from mock_hw.host.full_disk import refuse_shared_disk

        refuse_shared_disk(request.runs)
    return script


def _rehearsal(name: str, samples: MotionSamples) -> RunRequest:
    return RunRequest(
        f"{name[:54]} rehearsal",
        f"A rehearsal of {name} at 1/{SLOWER:g} of its speed.",
        rehearsal(samples),
        role="rehearsal",
        epilogue=REHEARSAL_ALONE,
    )
