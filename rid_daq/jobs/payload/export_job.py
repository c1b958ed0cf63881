"""`rid-daq payload export`: a payload that passed, as a maker's controller wants it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from config.errors import EstimationError
from config.formats.whole_file import write_whole
from identification.payload.controllers.formats import LoadFormat, load_data
from identification.payload.estimate import PayloadEstimate
from identification.payload.file import read_payload


@dataclass(frozen=True)
class PayloadExportRequest:
    """What `rid-daq payload export` was asked for.

    Attributes
    ----------
    payload : Path
        A payload file.
    to : LoadFormat
        Whose controller it is for.
    output : Path
        The file to write.
    """

    payload: Path
    to: LoadFormat
    output: Path


@dataclass(frozen=True)
class PayloadExported:
    """The payload, and the text that was written."""

    estimate: PayloadEstimate
    text: str


def export_payload(request: PayloadExportRequest) -> PayloadExported:
    """Write a payload for a controller; what was written has been read back and compared.

    Raises
    ------
    EstimationError
        Its verdict is not passed: a controller with wrong load data stops without need, or does
        not stop when it should. Or no body can have these values.
    ConfigError, RecordingError
        The payload cannot be read, or the file not be written.
    """
    judged = read_payload(request.payload)
    if not judged.passed:
        failed = "; ".join(line.text for line in judged.checks if not line.passed)
        raise EstimationError(
            f"{request.payload}: the payload did not pass ({failed or 'nothing was checked'}), so"
            " no controller gets it: measure longer or with another motion, or state limits that"
            " you can answer for (payload identify --mass-limit, --centre-limit, --inertia-limit)"
        )
    estimate = judged.estimate
    text = load_data(estimate.body, request.to, _origin(estimate))
    write_whole(request.output, text.encode())
    return PayloadExported(estimate, text)


def _origin(estimate: PayloadEstimate) -> tuple[str, ...]:
    where = f", cell {estimate.cell_name}" if estimate.cell_name else ""
    mass, sigma = estimate.reported[0], estimate.sigma[0]
    return (
        f"Payload on {estimate.robot.name} from {', '.join(estimate.run_ids) or 'runs'}{where}.",
        f"Verdict passed. Measured {mass:.4g} kg, 2 sigma {2 * sigma:.2g} kg; written is the",
        "closest body that can exist.",
    )
