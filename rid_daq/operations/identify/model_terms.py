"""`ModelTerms`: terms of a robot's model, as a part of requests."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Final, Literal, get_args

from pydantic import AfterValidator, Field

from config.ranges import Coefficient, SmoothingRadS
from config.robot.friction_terms import FrictionTerm
from identification.choices import BandHz, StandstillRadS
from rid_daq.requests.option import Option
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from identification.model.options import ModelOptions

EQUATIONS: Final = "Equations"

Band = Annotated[
    BandHz,
    Field(
        description="Highest frequency of the data that is used. The default value is lowered if"
        " recorded positions have few digits."
    ),
    Option(group=EQUATIONS, flag="band", unit="Hz"),
]
Standstill = Annotated[
    StandstillRadS,
    Field(description="Lowest speed of samples that determine friction."),
    Option(group=EQUATIONS, flag="standstill", unit="rad/s"),
]


def _require_distinct(terms: tuple[FrictionTerm, ...] | None) -> tuple[FrictionTerm, ...] | None:
    if terms is not None and (not terms or len(set(terms)) != len(terms)):
        raise ValueError("must name at least one term, and each term once")
    return terms


class ModelTerms(Request):
    """Terms of a model. Programs can set every term; each command offers some as options."""

    kind: Annotated[
        Literal["internal", "external", "combined"],
        Field(
            description="Measured quantities to which the model is fitted: torques (internal), the"
            " wrench on a force plate (external), or both (combined)."
        ),
        Option(hidden=True),
    ] = "internal"
    rotors: Annotated[
        bool,
        Field(description="Include the inertia of the rotors and their coupling."),
        Option(group=EQUATIONS, negatable=True),
    ] = True
    friction: Annotated[bool, Field(description="Include friction."), Option(hidden=True)] = True
    spring: Annotated[
        bool,
        Field(description="Include the gravity spring of the robot file."),
        Option(hidden=True),
    ] = True
    sign_smoothing_rad_s: Annotated[
        SmoothingRadS,
        Field(description="Speed range in which Coulomb friction changes its sign."),
        Option(hidden=True),
    ] = 0.0
    friction_terms: Annotated[
        tuple[FrictionTerm, ...] | None,
        AfterValidator(_require_distinct),
        Field(
            description=f"Friction terms of every joint: {', '.join(get_args(FrictionTerm))}; those"
            " of the robot file if not set."
        ),
        Option(group=EQUATIONS, metavar="TERM,...", separator=","),
    ] = None
    payload: Annotated[
        bool, Field(description="Include an unknown payload on the last link."), Option(hidden=True)
    ] = False
    nonlinear: Annotated[
        tuple[Coefficient, ...] | None,
        Field(description="Values of the nonlinear parameters."),
        Option(hidden=True),
    ] = None

    def options(self) -> ModelOptions:
        """Return the terms as options of a model."""
        from identification.model.options import ModelOptions

        return ModelOptions(**self.model_dump())
