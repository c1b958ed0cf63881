"""Files of a completed payload session for which no motion is recorded."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.arrays import FloatArray
from config.load import LoadedCell, load_cell
from drivers.settings.saved_drive import DriveIdentity
from drivers.settings.write_log import DRIVE_WRITES, WriteLog
from identification.choices import PayloadLimits
from identification.payload.body import PayloadBody
from identification.payload.estimate import PayloadEstimate
from identification.payload.file import write_payload
from identification.payload.verdict import PayloadCheck, PayloadResult, check_payload
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.report.result import Result
from rid_daq.report.sections.payload import PayloadSection, payload_verdict
from rid_daq.report_page.write import write_result
from rid_daq.runs.run_data import CELL
from rid_daq.terminal.choices import PAYLOAD
from rid_daq.terminal.job_events import SessionState

MEDIUM = PayloadBody.of_reported(
    np.array([9.579, 0.024, 0.090, -0.202, 0.612, 0.063, 0.637, -0.158, -0.002, -0.008])
)
SIGMA = 5e-3


@dataclass(frozen=True)
class Session:
    """Folder and session file of a payload session, and its payload."""

    folder: RunFolder
    state: SessionFile
    payload: PayloadResult


def certified_session(
    runs: Path, label: str = "gripper 4", *, simulated: bool = True, mass_percent: float = 5.0
) -> Session:
    """Write a payload session that has reached its verdict.

    Args:
        runs: Folder of all runs.
        label: Label of the session.
        simulated: True if the cell file declares a simulated cell.
        mass_percent: Limit of two standard deviations of the mass in the verdict [% of the mass].
    """
    loaded = load_cell("kr15")
    folder = RunFolder.create(runs, label, kind="payload session", software={"rid-daq": "0.1.0"})
    _write_cell(folder, loaded, simulated)
    state = SessionFile.begin(folder, "kr15")
    for number, step in enumerate(("warm-up", "unloaded", "loaded 1"), start=1):
        run = RunFolder.create(runs, f"{label} {number}"[-64:], software={"rid-daq": "0.1.0"})
        _write_cell(run, loaded, simulated)
        run.write("recording.mcap", f"rows of {step}".encode())
        log = WriteLog(run.file(DRIVE_WRITES), durable=False)
        for node in range(1, 6):
            log.add_drive(node, DriveIdentity(vendor=1, serial=7000 + node))
        run.finish(RunStatus.COMPLETE)
        state.note_step(step, run.run_id)
    estimate = estimate_of(loaded, tuple(state.done[name] for name in state.measurements))
    limits = PayloadLimits(mass_percent=mass_percent)
    payload = PayloadResult(estimate, check_payload(estimate, limits))
    note_payload(folder, payload)
    state.state = SessionState.DONE
    state.write()
    folder.finish(RunStatus.COMPLETE)
    return Session(folder, state, payload)


def note_payload(folder: RunFolder, payload: PayloadResult) -> None:
    """Write a payload and its result into a run folder, as a session and `payload identify` do."""
    write_payload(folder.file(PAYLOAD), payload)
    folder.write(PAYLOAD, folder.file(PAYLOAD).read_bytes())
    section = PayloadSection.of(payload, None, ["Warm-up: settled."])
    result = Result.new("Payload", payload.estimate.robot.name)
    write_result(folder, result.with_sections(payload=section, verdict=payload_verdict(payload)))


def estimate_of(loaded: LoadedCell, run_ids: tuple[str, ...]) -> PayloadEstimate:
    """Return a physically consistent estimate with equal uncertainty of all parameters."""
    joints = len(loaded.robot.joints)
    return PayloadEstimate(
        robot=loaded.robot,
        procedure="together",
        values=MEDIUM.parameters,
        covariance=SIGMA**2 * np.eye(10),
        covariance_noise=0.1 * SIGMA**2 * np.eye(10),
        gain_slopes=np.zeros((10, joints)),
        unseen=np.zeros((10, 0)),
        condition_number=3.0,
        known=(),
        residual_nm=np.full(joints, 0.5),
        payload_nm=np.full(joints, 20.0),
        equations=600,
        cell_name=loaded.config.name,
        run_ids=run_ids,
        torque_nm=np.full(joints, 100.0),
        noise_nm=np.full(joints, 0.1),
        contradictions=np.zeros(0),
    )


def without_checks(payload: PayloadResult) -> PayloadResult:
    return replace(payload, checks=())


def with_unseen_inertia(payload: PayloadResult) -> PayloadResult:
    """Return a payload whose parameter Izz is not identifiable."""
    estimate = replace(payload.estimate, unseen=np.eye(10)[:, 9:])
    return PayloadResult(estimate, check_payload(estimate, PayloadLimits()))


def _write_cell(folder: RunFolder, loaded: LoadedCell, simulated: bool) -> None:
    for name, content in loaded.files.items():
        if name == CELL and not simulated:
            content = content.replace(b"simulated: true", b"simulated: false")
        folder.write(name, content)


def write_payload_file(path: Path, parameters: FloatArray) -> Path:
    """Write a payload of the bundled three-axis arm that passed its verdict.

    Args:
        path: Path of the file.
        parameters: Shape (10,). Standard parameters in the frame of the flange.
    """
    estimate = replace(
        estimate_of(load_cell("ir361"), ("weighing",)),
        values=parameters,
        covariance=1e-8 * np.eye(10),
    )
    write_payload(path, PayloadResult(estimate, (PayloadCheck("parameters", 10, "≥", 10),)))
    return path
