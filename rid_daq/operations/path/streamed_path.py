"""`stream_path`: follow a path from a motion file or point by point, and record it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from acquisition.motion.samples import MotionSamples
from acquisition.runs.manifest import require_label
from acquisition.session.outcome import RecordOutcome
from compensation.online.online import OnlineFeedforward
from compensation.online.stream import StreamSettings, stream_motion, stream_socket
from compensation.operating_temperature import at_operating_temperature
from config.cell.cell import CellConfig
from config.errors import ConfigError
from config.load import LoadedCell, load_cell
from rid_daq.operations.cell_files import (
    read_estimate_and_bytes,
    read_loops_and_bytes,
    read_motion_and_bytes,
)
from rid_daq.operations.operation import Context
from rid_daq.operations.path.stream import StreamRequest
from rid_daq.operations.stated_payload import state_payload
from rid_daq.preflight.axis_test import AxisTestRule
from rid_daq.recording.recorded_run import RecordedRun
from rid_daq.recording.run_session import Clearance, Record, RunRequest, open_session
from rid_daq.runs.run_data import MOTION, ONLINE_LOOPS, ONLINE_MODEL, ONLINE_PAYLOAD
from rid_daq.session.session import as_label


def stream_path(request: StreamRequest, context: Context) -> RecordedRun:
    """Stream a path and record it into a new run folder.

    Raises:
        ConfigError, PreflightError: The request was refused before anything moved.
        RidDaqError: As raised by `RunSession.recording`.
    """
    loaded = load_cell(request.cell)
    words, samples, files = _plan_path(request, loaded)
    loops, loops_bytes = read_loops_and_bytes(request.loop, loaded)
    estimate, model_bytes = read_estimate_and_bytes(request.model, loaded.robot)
    carrying = state_payload(estimate, request.model, request.payload, request.runs)
    velocity = None if samples is None else samples.whole().velocity
    warm = at_operating_temperature(carrying.estimate, request.temperature, velocity)
    for note in warm.notes:
        context.say(f"note: {note}")
    forward = OnlineFeedforward.from_model(loaded.config, loaded.robot, warm.estimate, loops)
    name = request.label or as_label("stream" if request.motion is None else request.motion.stem)
    require_label(name)
    options = StreamSettings(**request.options.model_dump())
    if options.compensated:
        files |= {ONLINE_MODEL: model_bytes, ONLINE_LOOPS: loops_bytes}
        if carrying.content:
            files[ONLINE_PAYLOAD] = carrying.content
    with open_session(
        loaded,
        request.runs,
        context,
        Clearance(request.cleared, request.practise, files),
        AxisTestRule(request.axis_test),
        simulation=request.simulation,
    ) as session:
        cell = session.cell

        def drive(record: Record) -> RecordOutcome:
            if samples is not None:
                return stream_motion(cell, forward, samples, record, options)
            path = request.socket or _default_socket(cell)
            listening = _announce_socket(context, path, options.patience_s)
            return stream_socket(cell, forward, path, record, options, listening)

        asked = RunRequest(name, words, samples, drive, role="streaming", files=files)
        return session.record(asked)


def _plan_path(
    request: StreamRequest, loaded: LoadedCell
) -> tuple[str, MotionSamples | None, dict[str, bytes]]:
    """Return a sentence on the path, its rows if they are known, and its file."""
    if request.motion is None:
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
