"""`stream_path`: follow a path from a motion file or point by point, and record it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

from acquisition.motion.samples import MotionSamples
from acquisition.runs.manifest import require_label
from acquisition.session.outcome import RecordOutcome
from compensation.online.load_signals import LoadSignals
from compensation.online.online import OnlineFeedforward
from compensation.online.stream import StreamSettings, stream_motion, stream_socket
from compensation.operating_temperature import at_operating_temperature
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from identification.elasticity.gear_torque import has_stiffness
from rid_daq.operations.cell_files import (
    read_loops_for,
    read_motion_and_bytes,
    read_torque_model,
)
from rid_daq.operations.operation import Context
from rid_daq.operations.path.model_doubts import model_doubts
from rid_daq.operations.path.stream import StreamRequest
from rid_daq.operations.rigid_gears import RIGID_GEARS, rigid_gears_notes
from rid_daq.operations.stated_loads import StatedLoads, state_loads
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_request import Record, RunRequest
from rid_daq.recording.run_session import Clearance, open_session
from rid_daq.runs.changed_load import LOAD_CHANGES, load_changes_bytes
from rid_daq.runs.run_data import MOTION, ONLINE_LOOPS, ONLINE_MODEL, ONLINE_PAYLOAD
from rid_daq.session.scenario import Scenario, constant_load_notes, load_transfers
from rid_daq.session.session import as_label

RIGID_STREAM: Final = (
    "`stream` computes the torques of rigid gears and does not correct the deflection of the gears;"
    " for a motion file, `compensate` and `record --feedforward` do"
)


def stream_path(request: StreamRequest, context: Context) -> tuple[RecordedRun, tuple[str, ...]]:
    """Stream a path and record it into a new run folder.

    Returns:
        The run, and notes: reasons to doubt the loops and the model, and effects that are not
        considered.

    Raises:
        ConfigError, EstimationError, PreflightError: The request was refused before anything moved.
        RidDaqError: As raised by `RunSession.recording`.
    """
    loaded = load_cell(request.cell)
    words, samples, files = _plan_path(request, loaded)
    measured = read_loops_for(request.loop, loaded.robot, loaded.config)
    estimate, model_bytes = read_torque_model(
        request.model, loaded.robot, despite_misfit=request.despite_misfit
    )
    stated = (request.model, request.payload, request.load_changes, request.runs)
    loads = state_loads(estimate, *stated)
    if samples is not None:
        samples = loads.planned(samples, signals=True)
    velocity = None if samples is None else samples.whole().velocity
    warm = at_operating_temperature(loads.first.estimate, request.temperature, velocity)
    load = loads.over_time(
        lambda one: at_operating_temperature(one, request.temperature, velocity).estimate
    )
    position = None if samples is None else samples.whole().position
    doubts = model_doubts(request.model, warm.estimate, position, loaded.config)
    constant = constant_load_notes(loads.changes, loaded.config)
    rigid = rigid_gears_notes(request.model, estimate, RIGID_STREAM)
    if not rigid and has_stiffness(loaded.robot):
        rigid = [
            f"robot {loaded.robot.name} has stiffness_nm_rad, but {RIGID_STREAM} ({RIGID_GEARS})"
        ]
    notes = (*measured.notes, *warm.notes, *doubts, *rigid, *constant)
    for note in notes:
        context.say(f"note: {note}")
    forward = OnlineFeedforward.from_model(loaded.config, loaded.robot, load, measured.loops)
    signals = _signals(loads, loaded)
    if signals is not None:
        forward = forward.with_signals(signals)
    name = request.label or as_label("stream" if request.motion is None else request.motion.stem)
    require_label(name)
    if loads.stated is not None:
        files |= loads.stated.files
    options = StreamSettings(**request.options.model_dump())
    if options.compensated:
        files |= {ONLINE_MODEL: model_bytes, ONLINE_LOOPS: measured.content}
        if loads.first.content:
            files[ONLINE_PAYLOAD] = loads.first.content
    with open_session(
        loaded,
        request.runs,
        context,
        Clearance(request.cleared, request.practise, files),
        AxisTestRule(request.axis_test),
        simulation=request.simulation,
        scenario=Scenario(load_transfers=load_transfers(loads.changes)),
    ) as session:
        cell = session.cell

        def drive(record: Record) -> RecordOutcome:
            if samples is not None:
                return stream_motion(cell, forward, samples, record, options)
            path = request.socket or _default_socket(cell)
            listening = _announce_socket(context, path, options.patience_s)
            return stream_socket(cell, forward, path, record, options, listening)

        def observed() -> dict[str, bytes]:
            return {} if signals is None else {LOAD_CHANGES: load_changes_bytes(signals.changes)}

        asked = RunRequest(
            name, words, samples, drive, role="streaming", files=files, observed=observed
        )
        return session.record(asked), notes


def _signals(loads: StatedLoads, loaded: LoadedCell) -> LoadSignals | None:
    """Return the signals at which the load changes; None if it changes at stated times only.

    Raises:
        ConfigError: A drive does not send the digital input at which a change begins.
    """
    if loads.stated is None or not loads.stated.changes.signals:
        return None
    cell, joints = loaded.config, loaded.robot.joint_names
    sending = {axis.joint for axis in cell.axes if cell.servo_of(axis).sends_inputs}
    for number, change in enumerate(loads.stated.changes.changes, start=1):
        if change.signal is not None and change.signal.joint not in sending:
            raise ConfigError(
                f"{loads.stated.file}: change {number} begins at a digital input of joint"
                f" {change.signal.joint}, but only these drives of cell {cell.name} send their"
                f" inputs: {', '.join(sorted(sending)) or 'none'}; correct the joint, or set"
                " digital_inputs in the servo profile of this drive",
                code="RID-LOAD-SIGNAL-INPUT",
            )
    return LoadSignals(loads.stated.changes, joints, cell.cycle_time_s)


def _plan_path(
    request: StreamRequest, loaded: LoadedCell
) -> tuple[str, MotionSamples | None, dict[str, bytes]]:
    """Return a sentence on the path, its rows if they are known, and its file."""
    if request.motion is None:
        if request.load_changes is not None:
            raise ConfigError(
                "--load-changes: the changes are timed from the first row of a motion file, but"
                " another program sends the points: give a motion file",
                code="RID-OPTION-NEEDS",
            )
        return "Points sent by another program.", None, {}
    if "patience_s" in request.options.model_fields_set:
        raise ConfigError(
            "--wait has no effect with a motion file; leave it out", code="RID-OPTION-NO-EFFECT"
        )
    if request.socket is not None:
        raise ConfigError(
            "a motion file and --socket exclude each other: leave one out",
            code="RID-OPTION-EXCLUSIVE",
        )
    motion, text = read_motion_and_bytes(request.motion, loaded)
    samples = motion.plan(loaded.robot, loaded.config.cycle_time_s)
    return motion.describe(), samples, {MOTION: text}


def _default_socket(cell: CellConfig) -> Path:
    from mock_hw.host.runtime_directory import runtime_directory

    return runtime_directory() / f"{cell.name}.points"


def _announce_socket(context: Context, path: Path, patience_s: float) -> Callable[[], None]:
    return lambda: context.say(f"Waiting up to {patience_s:g} s for points at {path}")
