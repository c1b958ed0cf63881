"""Load data of a robot controller: write them for a payload, and compare them with it."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from config.errors import ConfigError, system_errors
from config.formats.bounded_file import read_file
from config.formats.whole_file import write_whole
from identification.choices import LoadFormat
from identification.payload.controllers.formats import (
    LARGEST_TEXT,
    deviation,
    load_data,
    read_load_data,
    rounding,
)
from identification.payload.estimate import PayloadEstimate
from identification.payload.file import read_payload, refuse_failed
from identification.payload.verdict import PayloadResult
from rid_daq.blocks.formats import format_measured, number
from rid_daq.operations.payload.payload_export import PayloadExportRequest, PayloadExportResult
from rid_daq.operations.payload.payload_read_back import (
    PayloadReadBackRequest,
    PayloadReadBackResult,
)
from rid_daq.operations.stated_payload import payload_file
from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output

ALONG_Z: Final = frozenset(LoadFormat) - {LoadFormat.URDF}
"""Formats whose flange frame has Z pointing out of the flange; a URDF has no such convention."""


def export_payload(request: PayloadExportRequest) -> PayloadExportResult:
    """Write a payload as load data for a controller; the text is parsed again and compared first.

    Raises:
        EstimationError: The payload has not passed its verdict, or no body can have these values. A
            controller with wrong load data stops unnecessarily, or does not stop when it should.
        ConfigError, RecordingError: The payload cannot be read, or the file cannot be written.
    """
    refuse_output(request.output, request.overwrite, made_file.LOAD_DATA)
    path = payload_file(request.runs, str(request.payload))
    judged = read_payload(path)
    text, notes = load_text(path, judged, request.to)
    write_whole(request.output, text.encode())
    return PayloadExportResult(request, judged.estimate, text, notes)


def load_text(path: Path, judged: PayloadResult, form: LoadFormat) -> tuple[str, tuple[str, ...]]:
    """Return load data of a payload as text, parsed again and compared, and notes to check.

    Args:
        path: Path of the payload file, for messages.
        judged: The payload with its verdict.
        form: Format of the controller's manufacturer.

    Raises:
        EstimationError: The payload has not passed its verdict, or no body can have these values.
    """
    refuse_failed(path, judged, "it is not exported")
    estimate = judged.estimate
    notes = _notes_on_centre(estimate) if form in ALONG_Z else ()
    words = (*_origin_lines(estimate), *notes)
    return load_data(estimate.body, form, words, rounding(estimate.body, estimate.sigma)), notes


def read_back_payload(request: PayloadReadBackRequest) -> PayloadReadBackResult:
    """Parse load data and compare them with a payload.

    Raises:
        ConfigError: A file cannot be read or is not of this format; or file and text are both
            given, or neither.
        RecordingError: The run of the payload cannot be read.
    """
    file, text = _source_name(request), request.text
    body = read_payload(payload_file(request.runs, str(request.payload))).estimate.body
    if request.file is not None:
        with system_errors(ConfigError, f"{file}: the file cannot be read", code="RID-FILE-READ"):
            text = read_file(request.file, LARGEST_TEXT).decode("utf-8", errors="replace")
    try:
        found = read_load_data(text, request.form)
    except ConfigError as error:
        raise ConfigError(f"{file}: {error}", code=error.refusal) from None
    difference = 100.0 * deviation(body, found, request.form)
    line = VerdictCheck.of("largest difference", difference, "≤", request.tolerance_percent, "%")
    headline = (
        f"Passed: {file} agrees with the payload"
        if line.passed
        else f"Failed: {file} differs from the payload by {number(difference, 3)} %"
    )
    verdict = VerdictSection.of(
        [line], headline, "The load data are compared with the measured payload."
    )
    return PayloadReadBackResult(request, file, body, found, verdict)


def _source_name(request: PayloadReadBackRequest) -> str:
    """Return the name of the source of the load data: the file, or the text."""
    if (request.file is None) == (not request.text.strip()):
        code = "RID-OPTION-NEEDS" if request.file is None else "RID-OPTION-EXCLUSIVE"
        raise ConfigError("give the load data either as a file or as text", code=code)
    if len(request.text.encode()) > LARGEST_TEXT:
        raise ConfigError(
            f"the load data are longer than {LARGEST_TEXT} bytes", code="RID-FILE-SIZE"
        )
    return "the given text" if request.file is None else str(request.file)


def _notes_on_centre(estimate: PayloadEstimate) -> tuple[str, ...]:
    """Return a note if the centre of gravity is on the arm's side of the flange."""
    z_m, reach_m = float(estimate.reported[3]), 2.0 * float(estimate.sigma[3])
    if z_m + reach_m >= 0.0:
        return ()
    return (
        f"The centre of gravity is {-1e3 * z_m:.0f} mm behind the flange (inside the arm), if Z",
        "points out of the flange as the manufacturer defines it: check tool_rpy_rad of the"
        " robot file.",
    )


def _origin_lines(estimate: PayloadEstimate) -> tuple[str, ...]:
    where = f", cell {estimate.cell_name}" if estimate.cell_name else ""
    mass, reach = format_measured(float(estimate.reported[0]), 2.0 * float(estimate.sigma[0]))
    return (
        f"Payload on {estimate.robot.name} from {', '.join(estimate.run_ids) or 'runs'}{where},"
        " written by rid-daq.",
        f"Verdict passed. Measured {mass} kg, 2 sigma {reach} kg; the values are those of the",
        "closest physically consistent body.",
    )
