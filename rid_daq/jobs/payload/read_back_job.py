"""`rid-daq payload read-back`: what a controller holds, against what was measured."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Final

from config.errors import ConfigError
from config.formats.bounded_file import read_file
from identification.payload.body import PayloadBody
from identification.payload.controllers.formats import LoadFormat, deviation, read_load_data
from identification.payload.file import read_payload
from rid_daq.report.formats import number
from rid_daq.report.sections.verdict import Check, Verdict

LARGEST_FILE_BYTES: Final = 1_000_000


@dataclass(frozen=True)
class ReadBackRequest:
    """What `rid-daq payload read-back` was asked for.

    Attributes
    ----------
    payload, file : Path
        A payload file, and load data as exported or saved from the robot.
    form : LoadFormat
        Whose controller they come from.
    tolerance_percent : float
        The largest difference [%].
    """

    payload: Path
    file: Path
    form: LoadFormat
    tolerance_percent: float = 0.1


@dataclass(frozen=True)
class ReadBack:
    """The payload as measured and as it was read, and whether they are the same."""

    measured: PayloadBody
    found: PayloadBody
    verdict: Verdict


def read_back_payload(request: ReadBackRequest) -> ReadBack:
    """Parse load data and compare them with a payload.

    Raises
    ------
    ConfigError
        A file cannot be read, or is none of this format.
    """
    file = request.file
    body = read_payload(request.payload).estimate.body
    try:
        text = read_file(file, LARGEST_FILE_BYTES).decode("utf-8", errors="replace")
    except OSError as error:
        raise ConfigError(f"{file}: cannot be read: {error.strerror}") from error
    try:
        found = read_load_data(text, request.form)
    except ConfigError as error:
        raise ConfigError(f"{file}: {error}") from None
    difference = 100.0 * deviation(body, found, request.form)
    line = Check.of("largest difference", difference, "≤", request.tolerance_percent, "%")
    headline = (
        f"Passed: {file} holds the payload"
        if line.passed
        else f"Failed: {file} differs from the payload by {number(difference, 3)} %"
    )
    return ReadBack(body, found, Verdict.of([line], headline, "Compared with what was measured."))
