"""`payload identify`: identify a payload from recordings alone."""

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
    Millimetres,
    PayloadLimits,
    Share,
    TorqueConstantSigma,
)
from rid_daq.operations.identify.model_terms import Band, ModelTerms, Standstill
from rid_daq.operations.operation import Context, Operation
from rid_daq.operations.payload.shared import IdentifiedPayload
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    Option,
    Overwrite,
    RunsFolder,
    Unfinished,
)
from rid_daq.requests.request import Request
from rid_daq.terminal.choices import PAYLOAD

if TYPE_CHECKING:
    from identification.payload.known import Known

PAYLOADS: Final = "Payload"
LIMITS: Final = "Limits of the verdict"


class KnownQuantity(Request):
    """A quantity of a payload that was measured otherwise, such as its mass on scales."""

    name: Annotated[str, Field(description=f"One of {', '.join(REPORTED)}.")]
    value: Annotated[KnownValue, Field(description="Its value [kg, m or kg m²].")]
    sigma: Annotated[
        KnownSigma, Field(description="Its standard deviation; 0 holds it at the value.")
    ]

    @model_validator(mode="before")
    @classmethod
    def _of_text(cls, values: object, info: ValidationInfo) -> object:
        """Read a text of the command line, such as m=2.805+-0.005."""
        if info.mode == "json" or not isinstance(values, str):
            return values
        name, equals, rest = values.partition("=")
        value, _, sigma = rest.replace("±", "+-").partition("+-")
        if not equals:
            raise ValueError("must be NAME=VALUE or NAME=VALUE+-SIGMA, such as m=2.805+-0.005")
        return {"name": name.strip(), "value": value, "sigma": sigma or 0.0}

    def known(self) -> Known:
        """Return it as the estimators take it.

        Raises:
            ConfigError: There is no such quantity, or its value is not possible.
        """
        from identification.payload.known import Known

        try:
            return Known(**self.model_dump())
        except RidDaqError as error:
            raise ConfigError(f"--known {error}", code=error.refusal) from None


class VerdictLimits(Request):
    """The largest intervals (2σ) with which a payload passes."""

    mass_percent: Annotated[
        Share,
        Field(description="2σ of the mass."),
        Option(group=LIMITS, flag="mass-limit", unit="%"),
    ] = PayloadLimits.mass_percent
    centre_mm: Annotated[
        Millimetres,
        Field(description="2σ of each coordinate of the centre of gravity."),
        Option(group=LIMITS, flag="centre-limit", unit="mm"),
    ] = PayloadLimits.centre_mm
    inertia_percent: Annotated[
        Share,
        Field(description="2σ of the inertia, of the largest moment about the flange."),
        Option(group=LIMITS, flag="inertia-limit", unit="%"),
    ] = PayloadLimits.inertia_percent
    residual_percent: Annotated[
        Share,
        Field(description="Residual of the torque of an axis."),
        Option(group=LIMITS, flag="residual-limit", unit="%"),
    ] = PayloadLimits.residual_percent

    def limits(self) -> PayloadLimits:
        """Return them as the verdict takes them."""
        return PayloadLimits(**self.model_dump())


def _of_percent(value: object, info: ValidationInfo) -> object:
    """Return a share; the command line gives percent as text."""
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

    Friction is free in every run. The exit code is 1 if an interval is larger than its limit, and 6
    if the torque of an axis is not explained. What the motion does not show is named, with a motion
    that would show it.
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
            description="Model file of `identify`: the robot without payload, with which the runs"
            " of --unloaded are compared."
        ),
        Option(metavar="MODEL", file="input"),
    ] = None
    procedure: Annotated[
        Literal["together", "difference", "model", "apart"] | None,
        Field(
            description="together: robot and payload at once (if not set); difference: torques of"
            " one motion, subtracted; model: less the robot of --model (if that is set); apart: two"
            " robots, subtracted."
        ),
    ] = None
    known: Annotated[
        tuple[KnownQuantity, ...],
        Field(
            description="Quantity that was measured otherwise, with its standard deviation; held at"
            f" the value without one: {', '.join(REPORTED)} [kg, m, kg m² about the centre of"
            " gravity]."
        ),
        Option(group=PAYLOADS, metavar="NAME=VALUE[±SIGMA]"),
    ] = ()
    torque_constant_sigma: Annotated[
        TorqueConstantSigma | None,
        BeforeValidator(_of_percent),
        Field(
            description="Standard deviation of each torque constant, as a share (in percent on the"
            " command line): widens the intervals; 1 % if not set, `apart` counts them as exact."
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
        Field(description=f"Payload file to write; {PAYLOAD} of the run if not set."),
        Option(short="o", metavar="FILE", group=FILES, file="output", endings=(".json",)),
    ] = None
    overwrite: Overwrite = False
    runs: RunsFolder = DEFAULT_RUNS


def run(request: PayloadIdentifyRequest, _context: Context) -> IdentifiedPayload:
    """Identify the payload."""
    from rid_daq.operations.payload.payload_from_files import identify_payload_runs

    return identify_payload_runs(request)


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
