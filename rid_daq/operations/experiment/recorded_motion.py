"""`record_motion_file`: plan, check, rehearse, perform and record the motion of a file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from acquisition.motion.limits import verify_limits
from acquisition.motion.load_changes import LoadChanges
from acquisition.motion.motion_file import AnyMotion
from acquisition.motion.rehearsal import SLOWER, rehearsal
from acquisition.motion.samples import MotionSamples
from acquisition.motion.stop_distance import late_stop_note
from acquisition.runs.manifest import require_label
from acquisition.session.frame_recorder import require_listenable
from acquisition.supervision.commanded import commanded_motion, verify_command
from compensation.compensated_motion import refuse_torque
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.load import LoadedCell, load_cell, read_faults
from config.simulation.faults import NO_SCRIPT, FaultScript
from identification.elasticity.limit_torque import limit_temperature_note
from rid_daq.operations.cell_files import (
    add_feedforward,
    read_motion_and_bytes,
    read_torque_model,
    rejection_notes,
)
from rid_daq.operations.experiment.record import RecordRequest
from rid_daq.operations.operation import Context
from rid_daq.operations.stated_loads import (
    read_stated_changes,
    require_same_changes,
    state_loads,
)
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.accuracy_watch import AccuracyWatch
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_request import RunRequest
from rid_daq.recording.run_session import Clearance, open_session
from rid_daq.requests.cell_options import Simulation
from rid_daq.runs.changed_load import LOAD_CHANGES, load_changes_bytes
from rid_daq.runs.made_file import TRACKED
from rid_daq.runs.output_file import refuse_output
from rid_daq.runs.run_data import FEEDFORWARD, MOTION
from rid_daq.session.scenario import Scenario, constant_load_notes, load_transfers
from rid_daq.session.session import as_label
from rid_daq.terminal.exit_codes import ExitCode

FAULTS: Final = "faults.yaml"
REHEARSAL_ALONE = "Only the rehearsal was performed, not the motion itself."


@dataclass(frozen=True)
class RecordedMotion:
    """A motion that was performed and recorded.

    Attributes:
        run: The run; if the rehearsal was stopped, the run of the rehearsal.
        motion: The requested motion.
        accuracy: Estimate that was updated during the motion; None if the motion is not periodic
            and no goal was given.
        rehearsal_only: True if the rehearsal was stopped, so that the motion itself was not
            performed.
    """

    run: RecordedRun
    motion: AnyMotion
    accuracy: AccuracyWatch | None
    rehearsal_only: bool = False

    @property
    def exit_code(self) -> ExitCode:
        """Exit code of the run; if that is 0 and an accuracy goal was missed, 1."""
        missed = self.accuracy is not None and not self.accuracy.reached
        return self.run.exit_code or (ExitCode.VERDICT_FAILED if missed else ExitCode.DONE)


@dataclass(frozen=True)
class _PlannedMotion:
    """A motion before it is checked with a model.

    Attributes:
        motion, samples: The motion, and its set-points.
        files: Files of the run in addition to the cell's files, by name; each is read only once.
        changes: Changes of the payload during the motion; None if there are none.
    """

    motion: AnyMotion
    samples: MotionSamples
    files: dict[str, bytes]
    changes: LoadChanges | None = None


def record_motion_file(request: RecordRequest, context: Context) -> RecordedMotion:
    """Record a motion on a cell into a new run folder.

    Raises:
        ConfigError, PreflightError: The request was refused before anything moved.
        RidDaqError: As raised by `RunSession.recording`.
    """
    loaded = load_cell(request.cell)
    simulation = _simulation(request)
    refuse_output(request.tracker, overwrite=False, made=TRACKED)
    motion, text = read_motion_and_bytes(request.motion, loaded)
    planned = _PlannedMotion(
        motion, motion.plan(loaded.robot, loaded.config.cycle_time_s), {MOTION: text}
    )
    planned = _add_loads_and_feedforward(planned, request, loaded)
    samples, files, changes = planned.samples, planned.files, planned.changes
    if request.feedforward is not None:
        verify_limits(samples, loaded.robot)
        verify_command(samples, loaded.config, loaded.robot)
    if request.model is not None:
        _refuse_excessive_torque(request.model, request, planned, loaded, context)
    script = _load_fault_script(request, loaded.config, files)
    if changes is not None and request.rehearse:
        raise ConfigError(
            "--rehearse: the payload changes during the motion, but a rehearsal at a quarter of"
            " the speed would reach these times at other places: leave --rehearse out",
            code="RID-OPTION-EXCLUSIVE",
        )
    late = late_stop_note(samples, loaded.config, loaded.robot)
    for note in (*constant_load_notes(changes, loaded.config), *([late] if late else [])):
        context.say(f"note: {note}")
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
        simulation=simulation,
        scenario=Scenario(
            script, request.tracker and request.tracker.resolve(), load_transfers(changes)
        ),
        live=request.live,
    ) as session:
        if request.rehearse:
            run = session.record(_rehearsal_request(name, samples)).as_step()
            if run.outcome.stop is not None:
                return RecordedMotion(run, motion, accuracy, rehearsal_only=True)
            context.say(f"Rehearsal at 1/{SLOWER:g} of the speed is done: {run.folder.path}")
        return RecordedMotion(session.record(asked), motion, accuracy)


def _add_loads_and_feedforward(
    planned: _PlannedMotion, request: RecordRequest, loaded: LoadedCell
) -> _PlannedMotion:
    """Return a motion with the feedforward and the changes of its payload that a request states."""
    samples, files, changes = planned.samples, dict(planned.files), planned.changes
    stated = None if request.load_changes is None else read_stated_changes(request.load_changes)
    if stated is not None:
        samples, changes = stated.planned(samples), stated.changes
        files |= stated.files
    if request.feedforward is not None:
        made = add_feedforward(request.feedforward, planned.motion, samples)
        samples, files[FEEDFORWARD], changes = made
        if stated is not None or request.model is not None:
            named = None if stated is None else stated.changes
            require_same_changes(named, changes, str(request.feedforward))
        if changes is not None:
            files[LOAD_CHANGES] = load_changes_bytes(changes)
    return _PlannedMotion(planned.motion, samples, files, changes)


def _refuse_excessive_torque(
    model: Path,
    request: RecordRequest,
    planned: _PlannedMotion,
    loaded: LoadedCell,
    context: Context,
) -> None:
    """Refuse a motion if a model predicts torques beyond the limits, as planned or as driven."""
    motion, samples = planned.motion, planned.samples
    estimate = read_torque_model(model, loaded.robot, despite_misfit=request.despite_misfit)[0]
    for note in rejection_notes(model, estimate):
        context.say(f"note: {note}")
    stated = (model, request.payload, request.load_changes, request.runs)
    load = state_loads(estimate, *stated).over_time(lambda one: one)
    refuse_torque(motion, samples, load, loaded.robot)
    driven = commanded_motion(samples, loaded.config.position_gain_per_s)
    refuse_torque(motion, driven, load, loaded.robot)
    warmth = limit_temperature_note(estimate)
    if warmth:
        context.say(warmth)


def _simulation(request: RecordRequest) -> Simulation:
    """Return the options of the simulation; without a model, the robot carries `payload`."""
    if request.payload is None or request.model is not None:
        return request.simulation
    if request.simulation.payload is not None:
        raise ConfigError(
            "--payload and --mounted exclude each other without --model: leave one out",
            code="RID-OPTION-EXCLUSIVE",
        )
    return request.simulation.model_copy(update={"payload": request.payload})


def _load_fault_script(
    request: RecordRequest, cell: CellConfig, files: dict[str, bytes]
) -> FaultScript:
    """Load a fault script and add its bytes to `files`.

    A fault that fills the disk is refused if other programs use the disk of the run folders.
    """
    if request.faults is None:
        return NO_SCRIPT
    script, files[FAULTS] = read_faults(request.faults, cell)
    if any(fault.kind == "disk_full" for fault in script.program):
        from mock_hw.host.full_disk import refuse_shared_disk

        refuse_shared_disk(request.runs)
    return script


def _rehearsal_request(name: str, samples: MotionSamples) -> RunRequest:
    return RunRequest(
        f"{name[:54]} rehearsal",
        f"Rehearsal of {name} at 1/{SLOWER:g} of its speed.",
        rehearsal(samples),
        role="rehearsal",
        epilogue=REHEARSAL_ALONE,
    )
