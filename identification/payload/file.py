"""A payload as a JSON file that is complete in itself: `write_payload`, `read_payload`."""

from __future__ import annotations

from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Final, Literal

import numpy as np
from pydantic import Field

from config.errors import ConfigError, EstimationError
from config.formats.json_file import read_json_file
from config.formats.whole_file import write_whole
from config.model import ConfigModel
from config.robot.robot import RobotDescription
from identification.choices import REPORTED
from identification.estimation.file_checks import covariance_problems
from identification.payload.body import PARAMETERS, REPORTED_UNITS
from identification.payload.equations import Procedure
from identification.payload.estimate import PayloadEstimate
from identification.payload.known import Known
from identification.payload.verdict import PayloadCheck, PayloadResult

LARGEST_FILE_BYTES = 5_000_000

UNSOUND_PAYLOAD: Final = "RID-PAYLOAD-UNSOUND"

Size = Annotated[float, Field(ge=0.0)]
Row = tuple[float, ...]
Sizes = tuple[Size, ...]
Matrix = tuple[Row, ...]


class _Quantity(ConfigModel):
    name: str
    unit: str
    value: float | None
    sigma: Size | None


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


class PayloadDocument(ConfigModel):
    """What stands in the file; see `PayloadEstimate` for the meaning."""

    kind: Literal["rid-daq payload"]
    format: Literal[2]
    software: str
    cell: str
    runs: tuple[str, ...]
    procedure: Procedure
    frame: Literal["flange: the tool frame of the robot below"]
    about_centre_of_gravity: tuple[_Quantity, ...]
    principal_moments_kg_m2: Row | None
    principal_axes: Matrix | None
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
    passed: bool
    checks: tuple[_Check, ...]
    robot: RobotDescription


def write_payload(path: Path, payload: PayloadResult) -> None:
    """Write a payload as JSON; the same payload gives the same bytes.

    Raises:
        RecordingError: The file cannot be written.
    """
    write_whole(path, (payload_document(payload).model_dump_json(indent=1) + "\n").encode())


def read_payload(path: Path) -> PayloadResult:
    """Read what `write_payload` wrote.

    Raises:
        ConfigError: The file cannot be read or is not a payload.
    """
    what = "a payload as `rid-daq payload identify` writes it"
    document = read_json_file(path, PayloadDocument, LARGEST_FILE_BYTES, what)
    try:
        return _to_payload(document)
    except (EstimationError, ValueError) as error:  # numpy says ValueError of a ragged matrix
        words = f"{path}: not a payload that fits itself: {error}"
        raise ConfigError(words, code=UNSOUND_PAYLOAD) from error


def refuse_failed(path: Path, judged: PayloadResult, why: str) -> None:
    """Refuse a payload that did not pass its verdict.

    Args:
        path: Its file.
        judged: The payload.
        why: What is not done with it.

    Raises:
        EstimationError: It did not pass.
    """
    if not judged.passed:
        failed = "; ".join(line.text for line in judged.checks if not line.passed)
        raise EstimationError(
            f"{path}: the payload did not pass ({failed or 'nothing was checked'}), so {why}:"
            " measure longer or with another motion, or state limits that you can answer for"
            " (payload identify --mass-limit, --centre-limit, --inertia-limit, --residual-limit)",
            code="RID-PAYLOAD-FAILED",
        )


def payload_document(payload: PayloadResult) -> PayloadDocument:
    """Return a payload as what stands in its file."""
    estimate = payload.estimate
    whole = estimate.rank == len(PARAMETERS)
    moments, axes = estimate.body.principal if whole else (None, None)
    return PayloadDocument.from_attributes(
        estimate,
        kind="rid-daq payload",
        format=2,
        software=f"rid-daq {version('rid-daq')}",
        cell=estimate.cell_name,
        runs=estimate.run_ids,
        frame="flange: the tool frame of the robot below",
        about_centre_of_gravity=_Quantity.for_each(
            name=REPORTED,
            unit=REPORTED_UNITS,
            value=_where(estimate.reported, estimate.seen),
            sigma=_where(estimate.sigma, estimate.seen),
        ),
        principal_moments_kg_m2=moments,
        principal_axes=axes,
        known=tuple(_Known.from_attributes(known) for known in estimate.known),
        parameters=PARAMETERS,
        passed=payload.passed,
        checks=tuple(_Check.from_attributes(line) for line in payload.checks),
    )


def _to_payload(document: PayloadDocument) -> PayloadResult:
    """Return the payload that stands in a file."""
    if document.parameters != PARAMETERS:
        raise EstimationError(
            f"the parameters must be {', '.join(PARAMETERS)}", code="RID-PAYLOAD-UNSOUND"
        )
    estimate = document.to_dataclass(
        PayloadEstimate,
        unseen=np.array(document.unseen).reshape(
            len(PARAMETERS), len(document.unseen[0]) if document.unseen else 0
        ),
        known=tuple(known.to_dataclass(Known) for known in document.known),
        cell_name=document.cell,
        run_ids=document.runs,
    )
    lines = tuple(line.to_dataclass(PayloadCheck) for line in document.checks)
    payload = PayloadResult(estimate, lines)
    if payload.passed is not document.passed:
        raise EstimationError(
            "the verdict does not follow from its checks: was the file edited?",
            code="RID-PAYLOAD-UNSOUND",
        )
    for name in ("covariance", "covariance_noise"):
        for problem in covariance_problems(name, getattr(estimate, name)):
            raise EstimationError(f"{problem}: was the file edited?", code="RID-PAYLOAD-UNSOUND")
    if tuple(quantity.name for quantity in document.about_centre_of_gravity) != REPORTED:
        raise EstimationError(
            f"about_centre_of_gravity must be {', '.join(REPORTED)}", code="RID-PAYLOAD-UNSOUND"
        )
    for quantity, sigma in zip(document.about_centre_of_gravity, estimate.sigma, strict=True):
        if quantity.sigma is not None and not np.isclose(quantity.sigma, sigma, rtol=1e-6):
            raise EstimationError(
                f"the sigma of {quantity.name} does not follow from the covariance: was the file"
                " edited?",
                code="RID-PAYLOAD-UNSOUND",
            )
    for quantity, value in zip(document.about_centre_of_gravity, estimate.reported, strict=True):
        if quantity.value is not None and abs(quantity.value - value) > 1e-9 * (1.0 + abs(value)):
            raise EstimationError(
                f"{quantity.name} does not follow from the parameters: was the file edited?",
                code="RID-PAYLOAD-UNSOUND",
            )
    return payload


def _where(values: np.ndarray, seen: tuple[bool, ...]) -> list[float | None]:
    return [x if shown else None for x, shown in zip(values.tolist(), seen, strict=True)]
