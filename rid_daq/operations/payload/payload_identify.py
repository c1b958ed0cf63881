"""`payload identify`: identify a payload from recordings."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import BeforeValidator, Field, ValidationInfo, model_validator
from pydantic_core import PydanticCustomError

from config.errors import ConfigError, RidDaqError
from config.plausible import Plausible
from config.ranges import KnownSigma, KnownValue
from identification.choices import (
    BAND_HZ,
    REPORTED,
    STANDSTILL_RAD_S,
    InertiaLimitKgM2,
    MassLimitKg,
    Millimetres,
    PayloadLimits,
    ResidualLimitNm,
    Share,
    TorqueConstantSigma,
)
from rid_daq.operations.identify.model_terms import Band, ModelTerms, Standstill
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.payload.shared import IdentifiedPayload
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    DespiteMisfitOfModel,
    Option,
    Overwrite,
    RunsFolder,
    Unfinished,
)
from rid_daq.requests.request import Request
from rid_daq.terminal.choices import PAYLOAD

if TYPE_CHECKING:
    from identification.payload.known import KnownPayloadValue

PAYLOADS: Final = "Payload"
LIMITS: Final = "Limits of the verdict"


class KnownQuantity(Request):
    """A quantity of a payload that is known from another measurement, such as a weighed mass."""

    name: Annotated[str, Field(description=f"One of {', '.join(REPORTED)}.")]
    value: Annotated[KnownValue, Field(description="Value [kg, m or kg m²].")]
    sigma: Annotated[
        KnownSigma, Field(description="Standard deviation; 0 fixes the quantity at this value.")
    ]

    @model_validator(mode="before")
    @classmethod
    def _of_text(cls, values: object, info: ValidationInfo) -> object:
        """Parse a text of the command line, such as m=2.805+-0.005."""
        if info.mode == "json" or not isinstance(values, str):
            return values
        name, equals, rest = values.partition("=")
        value, _, sigma = rest.replace("±", "+-").partition("+-")
        if not equals:
            raise ValueError("must be NAME=VALUE or NAME=VALUE+-SIGMA, such as m=2.805+-0.005")
        return {"name": name.strip(), "value": value, "sigma": sigma or 0.0}

    def known(self) -> KnownPayloadValue:
        """Return the quantity as input of the estimators.

        Raises:
            ConfigError: There is no such quantity, or its value is impossible.
        """
        from identification.payload.known import KnownPayloadValue

        try:
            return KnownPayloadValue(**self.model_dump())
        except RidDaqError as error:
            raise ConfigError(f"--known {error}", code=error.refusal) from None


class VerdictLimits(Request):
    """Largest intervals (2σ) and residuals with which a payload passes.

    If a quantity has a relative and an absolute limit, one of the two must be met.
    """

    mass_percent: Annotated[
        Share,
        Field(description="Largest 2σ of the mass."),
        Option(group=LIMITS, flag="mass-limit", unit="%"),
    ] = PayloadLimits.mass_percent
    mass_kg: Annotated[
        MassLimitKg | None,
        Field(
            description="Absolute limit of the mass's 2σ; --mass-limit or this limit must be met."
        ),
        Option(group=LIMITS, flag="mass-limit-kg", unit="kg"),
    ] = PayloadLimits.mass_kg
    centre_mm: Annotated[
        Millimetres,
        Field(description="Largest 2σ of each coordinate of the centre of gravity."),
        Option(group=LIMITS, flag="centre-limit", unit="mm"),
    ] = PayloadLimits.centre_mm
    inertia_percent: Annotated[
        Share,
        Field(
            description="Largest 2σ of the inertia, relative to the largest moment about the"
            " flange."
        ),
        Option(group=LIMITS, flag="inertia-limit", unit="%"),
    ] = PayloadLimits.inertia_percent
    inertia_kg_m2: Annotated[
        InertiaLimitKgM2 | None,
        Field(
            description="Absolute limit of the inertia's 2σ; --inertia-limit or this limit must be"
            " met."
        ),
        Option(group=LIMITS, flag="inertia-limit-kg-m2", unit="kg m²"),
    ] = PayloadLimits.inertia_kg_m2
    residual_percent: Annotated[
        Share,
        Field(description="Largest residual of an axis, relative to its torque."),
        Option(group=LIMITS, flag="residual-limit", unit="%"),
    ] = PayloadLimits.residual_percent
    residual_nm: Annotated[
        ResidualLimitNm | None,
        Field(
            description="Absolute limit of an axis's residual; --residual-limit or this limit must"
            " be met."
        ),
        Option(group=LIMITS, flag="residual-limit-nm", unit="N m"),
    ] = PayloadLimits.residual_nm

    def limits(self) -> PayloadLimits:
        """Return the limits as input of the verdict."""
        return PayloadLimits(**self.model_dump())


def _of_percent(value: object, info: ValidationInfo) -> object:
    """Convert a percentage, which the command line gives as text, to a fraction."""
    if info.mode == "json" or not isinstance(value, str):
        return value
    try:
        percent = float(value)
    except ValueError:
        return value
    problem = Plausible(5e-2, 50.0, "%").refusal(percent)
    if problem is not None:
        raise PydanticCustomError("range", "{text}", {"text": problem})
    return 0.01 * percent


class PayloadIdentifyRequest(Request):
    """Identify a payload: mass, centre of gravity and inertia, from runs with and without it.

    Friction is estimated separately in every run. Parameters that the motion does not determine are
    named, with a motion that would determine them.

    In a terminal: exit code 6 if the torque of an axis is not explained, 1 if the payload fails its
    verdict for another reason.
    """

    loaded: Annotated[
        tuple[str, ...],
        Field(min_length=1, description="Run with the payload."),
        Option(group=PAYLOADS, metavar="RUN"),
    ]
    unloaded: Annotated[
        tuple[str, ...], Field(description="Run without the payload."), Option(metavar="RUN")
    ] = ()
    model: Annotated[
        Path | None,
        Field(
            description="Model file of `identify` for the robot without payload; the runs of"
            " --unloaded are compared with it."
        ),
        Option(metavar="MODEL", file="input"),
    ] = None
    despite_misfit: DespiteMisfitOfModel = False
    procedure: Annotated[
        Literal["together", "difference", "model", "apart"] | None,
        Field(
            description="Procedure. together: estimate robot and payload at once (default"
            " without --model); difference: subtract the torques of the same motion;"
            " model: subtract the torques of --model (default with --model); apart:"
            " estimate two robots and subtract them."
        ),
    ] = None
    known: Annotated[
        tuple[KnownQuantity, ...],
        Field(
            description="Quantity that is known from another measurement, with its standard"
            " deviation; without SIGMA the quantity is fixed at VALUE. Names:"
            f" {', '.join(REPORTED)} [kg, m, kg m² about the centre of gravity]."
        ),
        Option(group=PAYLOADS, metavar="NAME=VALUE[±SIGMA]"),
    ] = ()
    torque_constant_sigma: Annotated[
        TorqueConstantSigma | None,
        BeforeValidator(_of_percent),
        Field(
            description="Standard deviation of each torque constant, as a fraction of its value;"
            " PERCENT in percent. It widens the intervals. Default: 1 %; `apart` treats torque"
            " constants as exact."
        ),
        Option(group=PAYLOADS, metavar="PERCENT"),
    ] = None
    limits: VerdictLimits = Field(default_factory=VerdictLimits)
    band_hz: Band = BAND_HZ
    standstill_rad_s: Standstill = STANDSTILL_RAD_S
    options: ModelTerms = Field(default_factory=ModelTerms)
    unfinished: Unfinished = False
    output: Annotated[
        Path | None,
        Field(
            description=f"Payload file to write; {PAYLOAD} of the first run with the payload if not"
            " set."
        ),
        Option(short="o", metavar="FILE", group=FILES, file="output", endings=(".json",)),
    ] = None
    overwrite: Overwrite = False
    runs: RunsFolder = DEFAULT_RUNS


def run(request: PayloadIdentifyRequest, context: Context) -> IdentifiedPayload:
    """Identify the payload."""
    from rid_daq.operations.payload.payload_from_files import identify_payload_runs

    return identify_payload_runs(request, context)


OPERATION: Final = Operation(
    name="payload identify",
    label="Identify a payload",
    request=PayloadIdentifyRequest,
    run=run,
    examples=(
        "payload identify --loaded gripper --unloaded empty",
        "payload identify --loaded gripper --model model.json --known m=2.805+-0.005 --json",
    ),
    module="rid_daq.operations.payload.payload_from_files",
)
