"""Reader and writer of an `Estimate` as a self-contained JSON file.

The file contains the robot's description, the names, units and expressions of the parameters, the
covariances, the cell and the software version, so that it can be used without any other file.
"""

from __future__ import annotations

from dataclasses import fields
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field

from acquisition.processing.torque_channel import TorqueChannel
from config.errors import ConfigError, EstimationError
from config.formats.json_file import json_content, read_content
from config.formats.whole_file import write_whole
from config.model import ConfigModel
from config.robot.friction_terms import FrictionTerm
from config.robot.robot import RobotDescription
from config.sealed_model import SealedModel
from identification.equations.plate_fit import PlateFit
from identification.equations.warming import Warming
from identification.estimation.estimate import Estimate
from identification.estimation.file_checks import UNSOUND_MODEL, refuse_contradictions
from identification.estimation.options import Weighting
from identification.model.base_parameters import BaseParameters, ModelKind
from identification.model.options import ModelOptions
from identification.model.still_joints import StillJoint

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

LARGEST_FILE_BYTES = 50_000_000

_ELSEWHERE = (
    "options", "base", "values", "covariance_jackknife", "nonlinear_covariance", "cell_name",
    "run_ids",
)  # fmt: skip
"""Fields of an estimate that have other names in the file."""

Size = Annotated[float, Field(ge=0.0)]
Row = tuple[float, ...]
Sizes = tuple[Size, ...]
Matrix = tuple[Row, ...]


class _Options(ConfigModel):
    kind: ModelKind
    rotors: bool
    friction: bool
    spring: bool
    sign_smoothing_rad_s: float
    friction_terms: tuple[FrictionTerm, ...] | None
    payload: bool


class _Still(ConfigModel):
    joint: str
    positions: Annotated[Row, Field(min_length=1)]


class _Shape(ConfigModel):
    name: str
    unit: str
    value: float
    sigma: Size


class _Parameter(ConfigModel):
    name: str
    words: str
    unit: str
    value: float
    sigma: Size
    sigma_noise: Size | None
    sigma_residual: Size


class _Plate(ConfigModel):
    residual: Sizes
    noise: Sizes
    delay_s: Row
    delay_sigma_s: Sizes
    left_out: tuple[tuple[str, ...], ...]
    drift_n_s: Matrix
    wrench: Sizes


class _Channel(ConfigModel):
    delay_s: Row
    delay_sigma_s: Sizes
    lag_s: Sizes
    lag_sigma_s: Sizes
    width_s: Sizes
    width_sigma_s: Sizes
    order: Annotated[int, Field(ge=1)]


class _Warming(ConfigModel):
    time_constant_s: Sizes
    time_constant_sigma_s: Sizes
    coulomb_nm: Row
    viscous_nm_s: Row


class EstimateDocument(SealedModel):
    """Content of an estimate file; see `Estimate` for the meaning of the fields."""

    kind: Literal["rid-daq estimate"]
    format: Literal[5]
    software: str
    cell: str
    runs: tuple[str, ...]
    imported_row_hashes: tuple[Annotated[int, Field(ge=0)], ...]
    method: Literal["periodic", "smoothed"]
    band_hz: Annotated[float, Field(gt=0.0)]
    standstill_rad_s: Size
    weighting: Weighting
    periods: Annotated[int, Field(ge=0)]
    equations: Annotated[int, Field(ge=1)]
    condition_number: Size
    residual_nm: Sizes
    noise_nm: Sizes | None
    torque_nm: Sizes | None
    held_out_share: Sizes | None
    clusters: Annotated[int, Field(ge=1)] | None
    left_out_fraction: tuple[Annotated[float, Field(ge=0.0, le=1.0)], ...]
    parameters: tuple[_Parameter, ...]
    shape_parameters: tuple[_Shape, ...]
    unseen: tuple[str, ...]
    standard_parameters: tuple[str, ...]
    combination: Matrix
    covariance_noise: Matrix | None
    covariance_residual: Matrix
    covariance_honest: Matrix
    shape_covariance: Matrix
    plate: _Plate | None
    channel: _Channel | None
    warming: _Warming | None
    still: tuple[_Still, ...]
    position_range: Matrix | None
    gear_torque_nm: Sizes | None
    contradictions: tuple[str, ...]
    model: _Options
    robot: RobotDescription
    sha256: str


def write_estimate(path: Path, estimate: Estimate) -> None:
    """Write an estimate as JSON; equal estimates give equal bytes.

    Raises:
        RecordingError: The file cannot be written.
    """
    text = estimate_document(estimate).model_dump_json(indent=1) + "\n"
    write_whole(path, text.encode())


def read_estimate(path: Path) -> Estimate:
    """Read an estimate file that `write_estimate` wrote.

    Raises:
        ConfigError: The file cannot be read or is not an estimate.
    """
    return estimate_content(read_content(path, LARGEST_FILE_BYTES), path)


def estimate_content(data: bytes, path: Path) -> Estimate:
    """Return the estimate in the bytes of an estimate file; errors as of `read_estimate`."""
    what = "an estimate file written by `rid-daq identify`"
    document = json_content(data, path, EstimateDocument, what)
    try:
        estimate = _to_estimate(document)
        refuse_contradictions(estimate, _deviations(document))
        document.refuse_edited(UNSOUND_MODEL, "restore the file, or identify the model again")
        return estimate
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}", code=error.refusal) from None
    except (EstimationError, ValueError) as error:  # numpy raises ValueError for a ragged matrix
        words = f"{path}: the estimate file contradicts itself: {error}"
        raise ConfigError(words, code=UNSOUND_MODEL) from error


def _require_room(kind: type[ConfigModel], source: DataclassInstance, *elsewhere: str) -> None:
    """Raise an error for a field of `source` that the file format cannot store."""
    names = {field.name for field in fields(source)} - set(elsewhere)
    lost = names - set(kind.model_fields)
    if lost:
        raise EstimationError(
            f"an estimate file cannot store {', '.join(sorted(lost))}: add the fields to"
            " identification/estimation/file.py",
            code="RID-MODEL-OPTION",
        )


def estimate_document(estimate: Estimate) -> EstimateDocument:
    """Return an estimate as the content of its file."""
    base, model, plate = estimate.base, estimate.model, estimate.plate
    _require_room(_Options, estimate.options, "nonlinear", "separate_rotors")
    _require_room(EstimateDocument, estimate, *_ELSEWHERE)
    noise = estimate.sigma_noise
    return EstimateDocument.from_attributes(
        estimate,
        kind="rid-daq estimate",
        format=5,
        software=f"rid-daq {version('rid-daq')}",
        cell=estimate.cell_name,
        runs=estimate.run_ids,
        parameters=_Parameter.for_each(
            name=base.names,
            words=base.expressions,
            unit=base.units,
            value=estimate.values,
            sigma=estimate.sigma,
            sigma_noise=[None] * len(base) if noise is None else noise,
            sigma_residual=estimate.sigma_residual,
        ),
        shape_parameters=_Shape.for_each(
            name=model.nonlinear_names,
            unit=model.nonlinear_units,
            value=model.nonlinear_values,
            sigma=estimate.nonlinear_sigma,
        ),
        unseen=base.unseen,
        standard_parameters=base.standard_names,
        combination=base.combination,
        covariance_honest=estimate.covariance_jackknife,
        shape_covariance=estimate.nonlinear_covariance,
        plate=None if plate is None else _Plate.from_attributes(plate),
        channel=None if estimate.channel is None else _Channel.from_attributes(estimate.channel),
        warming=None if estimate.warming is None else _Warming.from_attributes(estimate.warming),
        still=tuple(_Still.from_attributes(each) for each in estimate.still),
        model=_Options.from_attributes(estimate.options),
        sha256="",
    ).with_digest()


def _deviations(document: EstimateDocument) -> dict[str, list[float]]:
    """Return standard deviations, which the file contains in addition to the covariances."""
    rows = document.parameters
    noise = [row.sigma_noise for row in rows if row.sigma_noise is not None]
    return {
        "sigma": [row.sigma for row in rows],
        "sigma_residual": [row.sigma_residual for row in rows],
        "nonlinear_sigma": [row.sigma for row in document.shape_parameters],
        **({"sigma_noise": noise} if len(noise) == len(rows) else {}),
    }


def _to_estimate(document: EstimateDocument) -> Estimate:
    """Return the estimate of a file's content."""
    names = tuple(parameter.name for parameter in document.parameters)
    nonlinear = tuple(parameter.value for parameter in document.shape_parameters)
    options = ModelOptions(**document.model.model_dump(), nonlinear=nonlinear or None)
    model = options.build(document.robot)
    expected = model.parameter_names
    unknown = [name for name in names if name not in expected]
    if unknown or document.standard_parameters != expected:
        raise EstimationError(
            f"the parameters {', '.join(unknown or names)} are not those of the robot description"
            " in the file: was the file edited?",
            code="RID-MODEL-UNSOUND",
        )
    base = BaseParameters(
        names=names,
        expressions=tuple(parameter.words for parameter in document.parameters),
        units=tuple(parameter.unit for parameter in document.parameters),
        standard_names=expected,
        kept=tuple(expected.index(name) for name in names),
        combination=np.array(document.combination),
        unseen=document.unseen,
    )
    return document.to_dataclass(
        Estimate,
        options=options.fitted(model, base),
        base=base,
        values=[parameter.value for parameter in document.parameters],
        covariance_jackknife=np.array(document.covariance_honest),
        nonlinear_covariance=np.array(document.shape_covariance).reshape(
            len(nonlinear), len(nonlinear)
        ),
        plate=None if document.plate is None else document.plate.to_dataclass(PlateFit),
        channel=None if document.channel is None else document.channel.to_dataclass(TorqueChannel),
        warming=None if document.warming is None else document.warming.to_dataclass(Warming),
        still=tuple(each.to_dataclass(StillJoint) for each in document.still),
        cell_name=document.cell,
        run_ids=document.runs,
    )
