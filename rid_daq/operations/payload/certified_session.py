"""`write_certificate`: check the session or run of a payload, and write its certificate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Final

from acquisition.runs.catalogue import find_run, find_run_below
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.cell.cell import CellConfig
from config.errors import ConfigError, DataQualityError, RecordingError
from config.formats.whole_file import write_whole
from config.load import load_bundled_or_path
from drivers.settings.write_log import DRIVE_WRITES, read_write_log
from identification.payload.file import PayloadDocument, read_payload
from identification.payload.verdict import PayloadResult
from rid_daq.operations.payload.payload_certificate import PayloadCertificateRequest
from rid_daq.operations.payload.session_states import SessionFile
from rid_daq.report.certificate import Certificate
from rid_daq.report.result import Result
from rid_daq.report.result_file import RESULT, read_result
from rid_daq.report.sections.payload import PayloadSection
from rid_daq.report.sections.runs import CellSection
from rid_daq.report_page.printed_page import print_pdf
from rid_daq.report_page.render import render_certificate
from rid_daq.runs import made_file
from rid_daq.runs.flange import FACT
from rid_daq.runs.origins import cell_of
from rid_daq.runs.output_file import refuse_output
from rid_daq.runs.run_data import CELL, READ, SESSION, note_output, require_own
from rid_daq.session.versions import program_version
from rid_daq.terminal.choices import CERTIFICATE, PAYLOAD
from rid_daq.terminal.job_events import SessionState

_LISTED: Final = (SESSION, PAYLOAD, RESULT, *READ, DRIVE_WRITES)


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
    certificate = certificate_of(folder, request.by)
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
    state = SessionFile.read(folder) if folder.file(SESSION).exists() else None
    _require_finished(folder, state)
    document = PayloadDocument.model_validate_json(folder.read(PAYLOAD))
    payload, result = read_payload(folder.file(PAYLOAD)), read_result(folder)
    section = _section_of(folder, payload, result)
    ids = payload.estimate.run_ids
    if state is None and folder.run_id not in ids:
        raise DataQualityError(
            f"{folder.path}: {PAYLOAD} is of other runs ({', '.join(ids)}): name one of those",
            code="RID-CERTIFICATE-NOT-READY",
        )
    steps = [("", name) for name in ids] if state is None else list(state.done.items())
    folders = [find_run_below(folder.path.parent, run_id) for _, run_id in steps]
    all_folders = folders if folder in folders else [folder, *folders]
    for each in all_folders:
        _require_ended(each)
        require_own(each)
    files = tuple(file for each in all_folders for file in _files(each))
    cells = [cell for each in all_folders if (cell := _cell(each)) is not None]
    made = {} if result.timing is None else result.timing.made or {}
    return Certificate(
        folder=folder.manifest(),
        is_session=state is not None,
        payload=payload,
        how=section.sentence,
        findings=(*section.findings, *(result.notes or ())),
        by=by,
        identified_utc=made.get("payload"),
        cell=CellSection.of(cells[0]) if cells else None,
        simulated=any(cell.simulated for cell in cells)
        or any(FACT in each.manifest().facts for each in all_folders),
        devices=_devices(payload.estimate.robot.name, cells, folders),
        runs=tuple((step, each.manifest()) for (step, _), each in zip(steps, folders, strict=True)),
        files=files,
        identified_with=document.software,
        written_with=f"rid-daq {program_version()}",
        empty=None if state is None else state.empty_flange,
    )


def _require_finished(folder: RunFolder, state: SessionFile | None) -> None:
    """Refuse a session that has not come to its payload.

    Raises:
        DataQualityError: It has not.
    """
    if state is None and PAYLOAD not in folder.manifest().files:
        raise DataQualityError(
            f"{folder.path}: has no {PAYLOAD} of its own, so there is nothing to certify:"
            f" `rid-daq payload identify --loaded {folder.run_id} ...` without -o writes it",
            code="RID-CERTIFICATE-NOT-READY",
        )
    if state is not None and state.state is not SessionState.DONE:
        done = ", ".join(state.done) or "nothing"
        raise DataQualityError(
            f"{folder.path}: the session is not finished (state: {state.state.value}; done: {done})"
            f" and has no verdict: go on with it: rid-daq payload {cell_of(folder, state.cell)}"
            f" --resume {folder.run_id}",
            code="RID-CERTIFICATE-NOT-READY",
        )


def _require_ended(folder: RunFolder) -> None:
    """Refuse a run whose recording has no SHA-256.

    Raises:
        DataQualityError: It was never finished.
    """
    manifest = folder.manifest()
    if manifest.status == RunStatus.UNFINISHED or manifest.finished_utc is None:
        raise DataQualityError(
            f"{folder.path}: was never finished, so its files cannot be certified: write what is"
            f" readable as a new run with `rid-daq recover {folder.path}`, and identify the payload"
            " from that",
            code="RID-RUN-UNFINISHED",
        )


def _section_of(folder: RunFolder, payload: PayloadResult, result: Result) -> PayloadSection:
    """Return a payload as the result of its folder has it.

    Raises:
        DataQualityError: Nothing was judged, or the result is of another payload.
    """
    if not payload.checks:
        raise DataQualityError(
            f"{folder.file(PAYLOAD)}: has no verdict: nothing was held against a limit; identify"
            " the payload again",
            code="RID-CERTIFICATE-NOT-READY",
        )
    section, values = result.payload, payload.estimate.reported.tolist()
    if section is None or not all(
        math.isnan(value) if said.value is None else math.isclose(said.value, value, rel_tol=1e-9)
        for said, value in zip(section.parameters, values, strict=True)
    ):
        raise DataQualityError(
            f"{folder.path}: {RESULT} and {PAYLOAD} are not of the same payload: identify it again,"
            " without -o",
            code="RID-CERTIFICATE-NOT-READY",
        )
    return section


def _files(folder: RunFolder) -> list[tuple[str, str, str]]:
    """Return a folder's files that matter, each compared with its entry in the manifest.

    Raises:
        RecordingError: One of them is not what was written.
    """
    found = []
    for name in _LISTED:
        entry = folder.manifest().files.get(name)
        if entry is None:
            continue
        if not folder.is_unchanged(name, entry):
            raise RecordingError(
                f"{folder.file(name)}: is not what was written (its SHA-256 differs): put the"
                " original back",
                code="RID-RUN-CHANGED",
            )
        found.append((folder.run_id, name, entry.sha256))
    return found


def _cell(folder: RunFolder) -> CellConfig | None:
    path = folder.file(CELL)
    return load_bundled_or_path(str(path), "cells", CellConfig) if path.exists() else None


def _devices(
    robot: str, cells: Sequence[CellConfig], folders: Sequence[RunFolder]
) -> tuple[tuple[str, str | None], ...]:
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
    drives = (
        (f"drive of {joint} (node {node})", ", ".join(serials.get(node, ())) or None)
        for node, joint in axes.items()
    )
    return ((f"robot {robot}", None), *drives)
