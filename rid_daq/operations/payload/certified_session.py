"""`write_certificate`: check the session or run of a payload, and write its certificate."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Final

from acquisition.runs.catalogue import find_run, find_run_below
from acquisition.runs.folder import RunFolder
from acquisition.runs.manifest import RunStatus
from config.errors import ConfigError, DataQualityError, RecordingError
from config.formats.whole_file import write_whole
from drivers.settings.write_log import DRIVE_WRITES
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
from rid_daq.runs.devices import cell_of_run, drives_with_serials
from rid_daq.runs.flange import FACT
from rid_daq.runs.origins import cell_argument
from rid_daq.runs.output_file import refuse_output, register_output
from rid_daq.runs.run_data import READ, SESSION, require_own
from rid_daq.session.versions import program_version
from rid_daq.terminal.choices import CERTIFICATE, PAYLOAD
from rid_daq.terminal.job_events import SessionState

_LISTED: Final = (SESSION, PAYLOAD, RESULT, *READ, DRIVE_WRITES)


def write_certificate(request: PayloadCertificateRequest) -> tuple[Certificate, Path]:
    """Write a payload's certificate; return its contents and its path.

    Raises:
        ConfigError: There is no such run, or the output is not allowed or exists already.
        DataQualityError: The session or run is unfinished, or has no payload with a verdict.
        RecordingError: A file was changed, cannot be read, or cannot be written.
    """
    if request.output is not None and request.output.suffix not in (".html", ".pdf"):
        raise ConfigError(
            f"{request.output}: the name of a certificate must end in .html or .pdf",
            code="RID-OUTPUT-ENDING",
        )
    made = made_file.REPORT if request.is_page else made_file.CERTIFICATE
    refuse_output(request.output, request.overwrite, made)
    folder = find_run(request.runs, request.session, having=(SESSION, PAYLOAD))
    output = request.output or folder.file(CERTIFICATE)
    certificate = certificate_of(folder, request.by)
    page = output.with_suffix(".html")
    if page != output:
        refuse_output(request.output and page, request.overwrite, made_file.REPORT)
    write_whole(page, render_certificate(certificate).encode())
    register_output(folder, page)
    if page != output:
        print_pdf(page, output)
        register_output(folder, output)
    return certificate, output


def certificate_of(folder: RunFolder, by: str | None) -> Certificate:
    """Return the contents of a payload's certificate.

    All listed files are compared with the manifest.

    Args:
        folder: A payload session, or a run that contains a payload of `payload identify`.
        by: Person responsible for the certificate.

    Raises:
        DataQualityError, RecordingError, ConfigError: As raised by `write_certificate`.
    """
    state = SessionFile.read(folder) if folder.file(SESSION).exists() else None
    _require_finished(folder, state)
    document = PayloadDocument.model_validate_json(folder.read(PAYLOAD))
    payload, result = read_payload(folder.file(PAYLOAD)), read_result(folder)
    section = _payload_section(folder, payload, result)
    ids = payload.estimate.run_ids
    if state is None and folder.run_id not in ids:
        raise DataQualityError(
            f"{folder.path}: {PAYLOAD} was identified from other runs ({', '.join(ids)}): give"
            " one of these runs",
            code="RID-CERTIFICATE-NOT-READY",
        )
    steps = [("", name) for name in ids] if state is None else list(state.done.items())
    folders = [find_run_below(folder.path.parent, run_id) for _, run_id in steps]
    all_folders = folders if folder in folders else [folder, *folders]
    for each in all_folders:
        _require_ended(each)
        require_own(each)
    files = tuple(file for each in all_folders for file in _listed_files(each))
    cells = [cell for each in all_folders if (cell := cell_of_run(each)) is not None]
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
        devices=(
            (f"robot {payload.estimate.robot.name}", None),
            *drives_with_serials(cells, folders),
        ),
        runs=tuple((step, each.manifest()) for (step, _), each in zip(steps, folders, strict=True)),
        files=files,
        identified_with=document.software,
        written_with=f"rid-daq {program_version()}",
        empty=None if state is None else state.empty_flange,
    )


def _require_finished(folder: RunFolder, state: SessionFile | None) -> None:
    """Refuse a session or run without an identified payload.

    Raises:
        DataQualityError: The payload is not identified yet.
    """
    if state is None and PAYLOAD not in folder.manifest().files:
        raise DataQualityError(
            f"{folder.path}: the run has no {PAYLOAD}, so there is nothing to certify: write one"
            f" with `rid-daq payload identify --loaded {folder.run_id} ...` without -o",
            code="RID-CERTIFICATE-NOT-READY",
        )
    if state is not None and state.state is not SessionState.DONE:
        done = ", ".join(state.done) or "nothing"
        raise DataQualityError(
            f"{folder.path}: the session is not finished (state: {state.state.value}; done:"
            f" {done}) and has no verdict: continue it with `rid-daq payload"
            f" {cell_argument(folder, state.cell)} --resume {folder.run_id}`",
            code="RID-CERTIFICATE-NOT-READY",
        )


def _require_ended(folder: RunFolder) -> None:
    """Refuse an unfinished run, because its recording has no SHA-256.

    Raises:
        DataQualityError: The run was never finished.
    """
    manifest = folder.manifest()
    if manifest.status == RunStatus.UNFINISHED or manifest.finished_utc is None:
        raise DataQualityError(
            f"{folder.path}: the run was never finished, so its files cannot be certified: write"
            f" its readable part as a new run with `rid-daq recover {folder.path}`, and identify"
            " the payload from the new run",
            code="RID-RUN-UNFINISHED",
        )


def _payload_section(folder: RunFolder, payload: PayloadResult, result: Result) -> PayloadSection:
    """Return the payload's section in the result of its folder.

    Raises:
        DataQualityError: The payload has no verdict, or the result is of another payload.
    """
    if not payload.checks:
        raise DataQualityError(
            f"{folder.file(PAYLOAD)} has no verdict, because no limit was checked; identify the"
            " payload again",
            code="RID-CERTIFICATE-NOT-READY",
        )
    section, values = result.payload, payload.estimate.reported.tolist()
    if section is None or not all(
        math.isnan(value)
        if reported.value is None
        else math.isclose(reported.value, value, rel_tol=1e-9)
        for reported, value in zip(section.parameters, values, strict=True)
    ):
        raise DataQualityError(
            f"{folder.path}: {RESULT} and {PAYLOAD} describe different payloads: identify the"
            " payload again, without -o",
            code="RID-CERTIFICATE-NOT-READY",
        )
    return section


def _listed_files(folder: RunFolder) -> list[tuple[str, str, str]]:
    """Return the files of a folder that the certificate lists, compared with the manifest.

    Raises:
        RecordingError: A file was changed.
    """
    found = []
    for name in _LISTED:
        entry = folder.manifest().files.get(name)
        if entry is None:
            continue
        if not folder.is_unchanged(name, entry):
            raise RecordingError(
                f"{folder.file(name)}: its SHA-256 differs from the manifest: restore the"
                " original file",
                code="RID-RUN-CHANGED",
            )
        found.append((folder.run_id, name, entry.sha256))
    return found
