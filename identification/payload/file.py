"""Reader and writer of a payload as a self-contained JSON file."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from config.errors import ConfigError, EstimationError
from config.formats.json_file import json_content, read_content
from config.formats.whole_file import write_whole
from config.model import ConfigModel
from config.robot.robot import RobotDescription
from config.sealed_model import SealedModel
from identification.payload.body import PARAMETERS
from identification.payload.equations import Procedure
from identification.payload.estimate import PayloadEstimate
from identification.payload.known import KnownPayloadValue
from identification.payload.verdict import PayloadCheck, PayloadResult

LARGEST_FILE_BYTES = 5_000_000

UNSOUND_PAYLOAD: Final = "RID-PAYLOAD-UNSOUND"

Size = Annotated[float, Field(ge=0.0)]
Row = tuple[float, ...]
Sizes = tuple[Size, ...]
Matrix = tuple[Row, ...]


class _Known(ConfigModel):
    name: str
    value: float
    sigma: Size


class _Check(ConfigModel):
    text: str
    value: float
    relation: Literal["≤", "≥"]
    limit: float
    unit: str
    passed: bool


class PayloadDocument(SealedModel):
    """Content of a payload file; see `PayloadEstimate` for the meaning of the fields.

    Mass, centre of gravity and inertia are only in `values`, in the order of `parameters`: moments
    about the flange. All other values that are shown follow from `values` and `covariance`.
    """

    kind: Literal["rid-daq payload"]
    format: Literal[3]
    software: str
    cell: str
    runs: tuple[str, ...]
    procedure: Procedure
    frame: Literal["flange: the tool frame of the robot below"]
    known: tuple[_Known, ...]
    contradictions: Row
    torque_constant_sigma: Size
    parameters: tuple[str, ...]
    values: Row
    covariance: Matrix
    covariance_noise: Matrix
    gain_slopes: Matrix
    unseen: Matrix
    condition_number: Size
    torque_nm: Sizes
    residual_nm: Sizes
    noise_nm: Sizes | None
    payload_nm: Sizes
    equations: Annotated[int, Field(ge=1)]
    checks: tuple[_Check, ...]
    robot: RobotDescription
    sha256: str


def write_payload(path: Path, payload: PayloadResult) -> None:
    """Write a payload as JSON; equal payloads give equal bytes.

    Raises:
        RecordingError: The file cannot be written.
    """
    estimate = payload.estimate
    document = PayloadDocument.from_attributes(
        estimate,
        kind="rid-daq payload",
        format=3,
        software=f"rid-daq {version('rid-daq')}",
        cell=estimate.cell_name,
        runs=estimate.run_ids,
        frame="flange: the tool frame of the robot below",
        known=tuple(_Known.from_attributes(known) for known in estimate.known),
        parameters=PARAMETERS,
        checks=tuple(_Check.from_attributes(line) for line in payload.checks),
        sha256="",
    ).with_digest()
    write_whole(path, (document.model_dump_json(indent=1) + "\n").encode())


def read_payload(path: Path) -> PayloadResult:
    """Read a payload file that `write_payload` wrote.

    Raises:
        ConfigError: The file cannot be read, is not a payload, was edited, or contradicts itself.
    """
    return payload_content(read_content(path, LARGEST_FILE_BYTES), path)


def payload_content(data: bytes, path: Path) -> PayloadResult:
    """Return the payload in the bytes of a payload file; errors as of `read_payload`."""
    what = "a payload file, as `rid-daq payload identify` writes it"
    document = json_content(data, path, PayloadDocument, what)
    try:
        document.refuse_edited(UNSOUND_PAYLOAD, "restore the file, or identify the payload again")
        estimate = document.to_dataclass(
            PayloadEstimate,
            unseen=np.array(document.unseen).reshape(
                len(PARAMETERS), len(document.unseen[0]) if document.unseen else 0
            ),
            known=tuple(known.to_dataclass(KnownPayloadValue) for known in document.known),
            cell_name=document.cell,
            run_ids=document.runs,
        )
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}", code=error.refusal) from None
    except (EstimationError, ValueError) as error:  # numpy raises ValueError for a ragged matrix
        words = f"{path}: the payload file contradicts itself: {error}"
        raise ConfigError(words, code=UNSOUND_PAYLOAD) from error
    return PayloadResult(
        estimate, tuple(line.to_dataclass(PayloadCheck) for line in document.checks)
    )


def refuse_failed(path: Path, judged: PayloadResult, why: str) -> None:
    """Refuse a payload that did not pass its verdict.

    Args:
        path: File of the payload.
        judged: The payload with its checks.
        why: Consequence of the refusal, for the message.

    Raises:
        EstimationError: The payload did not pass.
    """
    if not judged.passed:
        failed = "; ".join(line.text for line in judged.checks if not line.passed)
        raise EstimationError(
            f"{path}: the payload did not pass ({failed or 'nothing was checked'}), so {why}:"
            " measure longer or with another motion, or set limits that you can justify (payload"
            " identify --mass-limit, --inertia-limit, --residual-limit in %, --centre-limit in mm;"
            " or --mass-limit-kg, --inertia-limit-kg-m2, --residual-limit-nm; in Python"
            ' options={"limits": {"mass_percent": ...}})',
            code="RID-PAYLOAD-FAILED",
        )
