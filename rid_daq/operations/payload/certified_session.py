"""`write_certificate`: check the session or run of a payload, and write its certificate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from acquisition.runs.catalogue import find_run, find_run_inside
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import Manifest, RunStatus
from config.cell.cell import CellConfig
from config.errors import ConfigError, DataQualityError, RecordingError
from config.formats.whole_file import write_whole
from config.load import load_bundled_or_path
from drivers.settings.write_log import DRIVE_WRITES, read_write_log
from identification.payload.file import PayloadDocument, read_payload
from identification.payload.verdict import PayloadResult
from rid_daq.operations.payload.payload_certificate import PayloadCertificateRequest
from rid_daq.operations.payload.session_state import STATE, SessionState
from rid_daq.report.certificate import Certificate, CertifiedFile, CertifiedRun, Device
from rid_daq.report.result import Result
from rid_daq.report.result_file import RESULT, read_result
from rid_daq.report.sections.runs import CellSection
from rid_daq.report_page.printed_page import print_pdf
from rid_daq.report_page.render import render_certificate
from rid_daq.runs import made_file
from rid_daq.runs.flange import FACT
from rid_daq.runs.origins import cell_of
from rid_daq.runs.output_file import refuse_output
from rid_daq.runs.run_data import CELL, READ, note_output, require_own
from rid_daq.session.versions import program_version
from rid_daq.terminal.choices import CERTIFICATE, PAYLOAD

_LISTED: Final = (STATE, PAYLOAD, RESULT, *READ, DRIVE_WRITES)


def write_certificate(request: PayloadCertificateRequest) -> tuple[Certificate, Path]:
    """Write a payload's certificate; return what it says, and the file.

    Raises:
        ConfigError: No run is meant.
        DataQualityError: It is not finished, or has no payload with a verdict.
        RecordingError: A file is not what was written, cannot be read, or cannot be written.
    """
    if request.output is not None and request.output.suffix not in (".html", ".pdf"):
        raise ConfigError(
            f"{request.output}: a certificate ends in .html or .pdf: give such a name",
            code="RID-OUTPUT-ENDING",
        )
    made = made_file.REPORT if request.is_page else made_file.CERTIFICATE
    refuse_output(request.output, request.overwrite, made)
    folder = find_run(request.runs, request.session)
    output = request.output or folder.file(CERTIFICATE)
    certificate = certificate_of(folder, None if request.by is None else request.by.strip())
    page = output.with_suffix(".html")
    if page != output:
        refuse_output(request.output and page, request.overwrite, made_file.REPORT)
    write_whole(page, render_certificate(certificate).encode())
    note_output(folder, page)
    if page != output:
        print_pdf(page, output)
        note_output(folder, output)
    return certificate, output


def certificate_of(folder: RunFolder, by: str | None) -> Certificate:
    """Return what the certificate of a payload says; every file that it lists has been compared.

    Args:
        folder: A payload session, or a run that `payload identify` has written a payload into.
        by: Who answers for it.

    Raises:
        DataQualityError, RecordingError, ConfigError: As `write_certificate`.
    """
    manifest = folder.manifest()
    state = SessionState.read(folder) if folder.file(STATE).exists() else None
    _require_finished(folder, manifest, state)
    payload, result = _payload_of(folder, manifest, state)
    assert result.payload is not None
    ids = payload.estimate.run_ids
    steps = [("", name) for name in ids] if state is None else list(state.done.items())
    folders = [find_run_inside(folder.path.parent, run_id) for _, run_id in steps]
    all_folders = folders if folder in folders else [folder, *folders]
    for each in all_folders:
        _require_ended(each, each.manifest())
        require_own(each)
    files = tuple(file for each in all_folders for file in _files(each))
    cells = [cell for each in all_folders if (cell := _cell(each)) is not None]
    made = {} if result.timing is None else result.timing.made or {}
    document = PayloadDocument.model_validate_json(folder.read(PAYLOAD))
    return Certificate(
        run_id=folder.run_id,
        label=manifest.label,
        is_session=state is not None,
        payload=payload,
        how=result.payload.sentence,
        findings=(*result.payload.findings, *(result.notes or ())),
        by=by,
        begun_utc=manifest.created_utc,
        ended_utc=manifest.finished_utc or manifest.created_utc,
        identified_utc=made.get("payload"),
        cell=CellSection.of(cells[0]) if cells else None,
        simulated=any(cell.simulated for cell in cells)
        or any(FACT in each.manifest().facts for each in all_folders),
        devices=_devices(payload.estimate.robot.name, cells, folders),
        runs=tuple(_run(step, each) for (step, _), each in zip(steps, folders, strict=True)),
        files=files,
        software=tuple(manifest.software.items()),
        identified_with=document.software,
        written_with=f"rid-daq {program_version()}",
        empty=None if state is None else state.empty_flange,
    )


def _require_finished(folder: RunFolder, manifest: Manifest, state: SessionState | None) -> None:
    """Refuse a session that has not come to its payload.

    Raises:
        DataQualityError: It has not.
    """
    has_payload = PAYLOAD in manifest.files
    if state is None:
        if not has_payload:
            raise DataQualityError(
                f"{folder.path}: has no {PAYLOAD} of its own, so there is nothing to certify:"
                f" `rid-daq payload identify --loaded {folder.run_id} ...` without -o writes it",
                code="RID-CERTIFICATE-NOT-READY",
            )
        return
    if manifest.status == RunStatus.UNFINISHED or not has_payload:
        done = ", ".join(state.done) or "nothing"
        raise DataQualityError(
            f"{folder.path}: the session is not finished (done: {done}) and has no verdict: go on"
            f" with it: rid-daq payload {cell_of(folder, state.cell)} --resume {folder.run_id}",
            code="RID-CERTIFICATE-NOT-READY",
        )


def _require_ended(folder: RunFolder, manifest: Manifest) -> None:
    """Refuse a run whose recording has no SHA-256.

    Raises:
        DataQualityError: It was never finished.
    """
    if manifest.status == RunStatus.UNFINISHED or manifest.finished_utc is None:
        raise DataQualityError(
            f"{folder.path}: was never finished, so its files cannot be certified: write what is"
            f" readable as a new run with `rid-daq recover {folder.path}`, and identify the payload"
            " from that",
            code="RID-RUN-UNFINISHED",
        )


def _payload_of(
    folder: RunFolder, manifest: Manifest, state: SessionState | None
) -> tuple[PayloadResult, Result]:
    """Return a payload and the result that was written with it.

    Raises:
        DataQualityError: Nothing was judged, or files are of different payloads.
        RecordingError: A file is not what was written.
    """
    folder.read(PAYLOAD)  # refused where it is not what was written
    payload, result = read_payload(folder.file(PAYLOAD)), read_result(folder)
    if not payload.checks:
        raise DataQualityError(
            f"{folder.file(PAYLOAD)}: has no verdict: nothing was held against a limit; identify"
            " the payload again",
            code="RID-CERTIFICATE-NOT-READY",
        )
    ids = payload.estimate.run_ids
    wanted = None if state is None else tuple(state.done[name] for name in state.measurements)
    if wanted is not None and ids != wanted:
        raise DataQualityError(
            f"{folder.path}: its runs are not those that {PAYLOAD} was identified from: finish the"
            f" session: rid-daq payload {cell_of(folder)} --resume {folder.run_id}",
            code="RID-CERTIFICATE-NOT-READY",
        )
    told = None if result.payload is None else [each.value for each in result.payload.parameters]
    reported = payload.estimate.reported.tolist()
    if told is None or not all(
        math.isnan(value) if said is None else math.isclose(said, value, rel_tol=1e-9)
        for said, value in zip(told, reported, strict=True)
    ):
        raise DataQualityError(
            f"{folder.path}: {RESULT} and {PAYLOAD} are not of the same payload: identify it again,"
            " without -o",
            code="RID-CERTIFICATE-NOT-READY",
        )
    if state is None and folder.run_id not in ids:
        raise DataQualityError(
            f"{folder.path}: {PAYLOAD} is of other runs ({', '.join(ids)}): name one of those",
            code="RID-CERTIFICATE-NOT-READY",
        )
    return payload, result


def _files(folder: RunFolder) -> list[CertifiedFile]:
    """Return a folder's files that matter, each compared with its entry in the manifest.

    Raises:
        RecordingError: One of them is not what was written.
    """
    found = []
    for name in _LISTED:
        entry = folder.manifest().files.get(name)
        if entry is None:
            continue
        if not folder.holds(name, entry):
            raise RecordingError(
                f"{folder.file(name)}: is not what was written (its SHA-256 differs): put the"
                " original back",
                code="RID-RUN-CHANGED",
            )
        found.append(CertifiedFile(folder.run_id, name, entry.sha256))
    return found


def _cell(folder: RunFolder) -> CellConfig | None:
    path = folder.file(CELL)
    return load_bundled_or_path(str(path), "cells", CellConfig) if path.exists() else None


def _devices(
    robot: str, cells: Sequence[CellConfig], folders: Sequence[RunFolder]
) -> tuple[Device, ...]:
    """Return robot and drives with their serial numbers, as far as runs have recorded them."""
    serials: dict[int, list[str]] = {}
    for folder in folders:
        if DRIVE_WRITES not in folder.manifest().files:
            continue
        for drive in read_write_log(folder.file(DRIVE_WRITES)):
            serial = drive.identity.serial
            known = serials.setdefault(drive.node_id, [])
            if serial is not None and str(serial) not in known:
                known.append(str(serial))
    axes = {axis.node_id: axis.joint for cell in cells for axis in cell.axes}
    return (
        Device(f"robot {robot}", None),
        *(
            Device(f"drive of {axes[node]} (node {node})", ", ".join(serials.get(node, ())) or None)
            for node in axes
        ),
    )


def _run(step: str, folder: RunFolder) -> CertifiedRun:
    manifest = folder.manifest()
    return CertifiedRun(
        step=step,
        run_id=folder.run_id,
        label=manifest.label,
        status=manifest.status,
        created_utc=manifest.created_utc,
        finished_utc=manifest.finished_utc or "",
    )
