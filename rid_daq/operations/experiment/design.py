"""`design`: design a motion, check it against the limits, write the motion file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal, NotRequired, TypedDict

from pydantic import AliasChoices, Field, ValidationInfo, model_validator

from config.errors import ConfigError
from config.ranges import (
    BudgetS,
    FrequencyHz,
    Harmonics,
    LimitFraction,
    PeriodS,
    Periods,
    Realisations,
    Seed,
    Starts,
    Tries,
)
from rid_daq.blocks.block import AnyBlock
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    CarriedPayloadOfModel,
    CellName,
    DespiteMisfit,
    Option,
    Overwrite,
    RunsFolder,
)
from rid_daq.requests.request import Request, shown_fields
from rid_daq.terminal.choices import Kind

if TYPE_CHECKING:
    from rid_daq.operations.experiment.motion_design import DesignedMotion

SEARCH: Final = "Search"
MULTISINES: Final = "Multisines"

_OF_PERIODS: Final = frozenset({"--period", "--periods"})
_OF_HEURISTIC: Final = frozenset({"--tries", "--limit-fraction"})
_OF_OPTIMAL: Final = frozenset(
    {"--criterion", "--starts", "--budget", "--scheduler", "--given", "--for"}
)
_METHOD_KEYS: Final = frozenset({"tries", "limit_fraction", "highest_harmonic"})
_OF_MULTISINES: Final = frozenset({"--band", "--grid", "--phases", "--realisations", "--slow"})
_OF_EXCITATIONS: Final = _OF_OPTIMAL | _OF_HEURISTIC | {"--method", "--harmonics"}

EXCITATION_PERIOD_S: Final = 10.0

Period = Annotated[
    PeriodS | None,
    Field(
        description="Period, a whole number of control cycles; about 10 if not set (about 8 for"
        " multisines)."
    ),
    Option(unit="s", flag="period"),
]
PeriodCount = Annotated[
    Periods,
    Field(description="Number of periods recorded for the estimate; 4 for multisines if not set."),
]
DrawSeed = Annotated[Seed, Field(description="Random seed."), Option(group=SEARCH)]


class Excitation(Request):
    """Options of an excitation trajectory and of the search for it."""

    method: Annotated[
        Literal["optimal", "two-harmonic"],
        Field(
            description="Search method. optimal: gradients from many random starts;"
            " two-harmonic: fast heuristic of Verdonck's thesis (equation 3.22)."
        ),
        Option(group=SEARCH),
    ] = "optimal"
    criterion: Annotated[
        Literal["condition", "d-optimal"],
        Field(
            description="Quantity to optimise: smallest condition number, or largest information."
        ),
        Option(group=SEARCH),
    ] = "d-optimal"
    period_s: Period = None
    periods: PeriodCount = 16
    harmonics: Annotated[
        Harmonics | None,
        Field(
            validation_alias=AliasChoices("harmonics", "highest_harmonic"),
            description="Highest harmonic; 5 if not set (8 for two-harmonic).",
        ),
    ] = None
    wanted: Annotated[
        tuple[str, ...],
        Field(
            description="Parameters to determine most accurately, instead of --criterion, such"
            " as sx3,Izz1; or torque."
        ),
        Option(group=SEARCH, flag="for", metavar="NAMES", separator=","),
    ] = ()
    starts: Annotated[
        Starts,
        Field(description="Number of random starts that are refined (optimal)."),
        Option(group=SEARCH),
    ] = 12
    budget_s: Annotated[
        BudgetS | None,
        Field(
            description="Time budget: the search ends with the first start that is completed"
            " after this time."
        ),
        Option(group=SEARCH, unit="s", flag="budget"),
    ] = None
    tries: Annotated[
        Tries,
        Field(description="Number of random motions that are compared (two-harmonic)."),
        Option(group=SEARCH),
    ] = 200
    limit_fraction: Annotated[
        LimitFraction,
        Field(description="Fraction of the limits that the motion can use (two-harmonic)."),
        Option(group=SEARCH),
    ] = 0.85
    seed: DrawSeed = 0

    @model_validator(mode="before")
    @classmethod
    def _with_method(cls, values: object, info: ValidationInfo) -> object:
        """Without a method in a program's request, choose two-harmonic if its options are set."""
        if info.mode != "json" or not isinstance(values, dict):
            return values
        is_heuristic = bool(values.keys() & _METHOD_KEYS)
        fields: dict[object, object] = {"method": "two-harmonic"} if is_heuristic else {}
        # After this function, pydantic no longer treats the values as JSON: lists must be tuples.
        for name, value in values.items():
            fields[name] = tuple(value) if isinstance(value, list) else value
        return fields


class Multisine(Request):
    """Options of a multisine."""

    band_hz: Annotated[
        tuple[FrequencyHz, FrequencyHz] | None,
        Field(description="Lowest and highest frequency; the cell file's if not set."),
        Option(group=MULTISINES, unit="Hz", flag="band", metavar="LOW:HIGH", separator=":"),
    ] = None
    period_s: Annotated[
        PeriodS | None,
        Field(description="Period, a whole number of control cycles; about 8 if not set."),
        Option(unit="s", flag="period"),
    ] = None
    periods: PeriodCount = 4
    realisations: Annotated[
        Realisations | None,
        Field(
            description="Number of realisations: motions that differ in their phases; 4 if not"
            " set (1 for schroeder)."
        ),
        Option(group=MULTISINES),
    ] = None
    grid: Annotated[
        Literal["odd", "random_odd", "full"],
        Field(
            description="Excited lines of the frequency band. odd: all odd lines; random_odd: odd"
            " lines, but one of every four, chosen at random, is empty and shows distortion; full:"
            " all lines."
        ),
        Option(group=MULTISINES),
    ] = "random_odd"
    phases: Annotated[
        Literal["random", "schroeder"],
        Field(
            description="Initial phases of the search for a low crest factor. random: drawn anew"
            " for each realisation; schroeder: always the same, for one realisation only."
        ),
        Option(group=MULTISINES),
    ] = "random"
    slow: Annotated[
        bool,
        Field(description="Add a slow sine, which prevents stiction."),
        Option(group=MULTISINES, negatable=True),
    ] = True
    seed: DrawSeed = 0


class DesignRequest(Request):
    """Design a motion for an experiment, and check it against the limits at closely spaced times.

    For an excitation, `optimal` refines random starts by exact gradients, on all cores, within the
    limits on position, speed, acceleration, workspace and self-collision, and on torque if --model
    is given or the robot file has `cad`. Without --budget, the same seed and number of starts give
    the same file. `two-harmonic` generates many random motions with one low and one high harmonic
    per axis, and takes the best; it does not check torques. The written motion keeps the limits on
    position, speed and acceleration also in its ramps. If the search of `optimal` is ended early,
    the result is the best motion found so far.

    In a terminal: Ctrl-C ends the search (exit code 130).
    """

    cell: CellName
    output: Annotated[
        Path,
        Field(description="Motion file to write."),
        Option(short="o", metavar="MOTION", group=FILES, file="output", endings=(".yaml",)),
    ]
    kind: Annotated[
        Kind,
        Field(
            description="Kind of motion. excitation: for the robot's parameters;"
            " constant-velocity: for friction only; reversed: an excitation forward"
            " and backward in time, for friction only; multisine: for velocity"
            " loops."
        ),
    ] = Kind.EXCITATION
    excitation: Excitation = Field(default_factory=Excitation)
    model: Annotated[
        Path | None,
        Field(description="Model file for the torque limits; the robot file's `cad` if not set."),
        Option(metavar="MODEL", file="input"),
    ] = None
    despite_misfit: DespiteMisfit = False
    payload: CarriedPayloadOfModel = None
    given: Annotated[
        tuple[Path, ...],
        Field(
            description="Model of an earlier run, whose information is added to that of the new"
            " motion."
        ),
        Option(metavar="MODEL", file="input"),
    ] = ()
    multisine: Multisine = Field(default_factory=Multisine)
    seed: DrawSeed = 0
    scheduler: Annotated[
        str | None,
        Field(
            description="Address of a Dask scheduler that performs the search, such as"
            " tcp://host:8786 (default: this computer)."
        ),
        Option(metavar="ADDRESS", group=FILES, owned=True),
    ] = None
    overwrite: Overwrite = False
    runs: RunsFolder = DEFAULT_RUNS

    def refuse_options_without_effect(self) -> None:
        """Refuse options that have no effect on this kind of motion, or with this method.

        Raises:
            ConfigError: Such an option is set (RID-OPTION-NO-EFFECT), or both --for and --criterion
                are set (RID-OPTION-EXCLUSIVE).
        """
        without_effect, because = self._options_without_effect
        for each in shown_fields(type(self)):
            holder = self if len(each.path) == 1 else getattr(self, each.path[0])
            if each.flag in without_effect and each.path[-1] in holder.model_fields_set:
                raise ConfigError(
                    f"{each.flag}: has no effect with {because}; leave it out",
                    code="RID-OPTION-NO-EFFECT",
                )
        if self.excitation.wanted and "criterion" in self.excitation.model_fields_set:
            raise ConfigError(
                "--for replaces --criterion: leave one of the two out",
                code="RID-OPTION-EXCLUSIVE",
            )

    @property
    def _options_without_effect(self) -> tuple[frozenset[str], str]:
        """Options without effect, and the option that causes this."""
        by = f"--kind {self.kind.value}"
        if self.kind is Kind.CONSTANT_VELOCITY:
            return _OF_PERIODS | _OF_MULTISINES | _OF_EXCITATIONS | {"--model", "--payload"}, by
        if self.kind is Kind.MULTISINE:
            return _OF_EXCITATIONS, by
        if self.excitation.method == "two-harmonic":
            others = _OF_OPTIMAL | _OF_MULTISINES | {"--model", "--payload"}
            return others, f"{by} --method two-harmonic"
        return _OF_MULTISINES | _OF_HEURISTIC, f"{by} --method optimal"


class MotionDocument(TypedDict):
    """Properties of a motion; those after the notes depend on its kind."""

    motion: str
    duration_s: float
    notes: list[str]
    kind: NotRequired[str]
    condition_number: NotRequired[float | None]
    band_hz: NotRequired[list[float]]
    axes: NotRequired[list[dict[str, object]]]
    limits: NotRequired[list[dict[str, object]]]
    trials: NotRequired[list[dict[str, object]]]
    interrupted: NotRequired[bool]


@dataclass(frozen=True)
class DesignResult:
    """A motion that was designed and written.

    Attributes:
        request: The request.
        designed: The motion, and the result of the search for it.
    """

    request: DesignRequest
    designed: DesignedMotion

    @property
    def exit_code(self) -> int:
        """Exit code 130 or 143 if a signal interrupted the search."""
        return 0 if self.designed.found is None else int(self.designed.found.exit_code)

    def document(self) -> MotionDocument:
        """Return the properties of the motion as numbers."""
        from rid_daq.operations.experiment.shown_motion import motion_document

        return motion_document(self.designed, self.request.output)

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the content of the motion file, the course of the search, and the next commands."""
        from rid_daq.operations.experiment.shown_motion import designed_motion_blocks

        return designed_motion_blocks(self.designed, self.request)


def run(request: DesignRequest, context: Context) -> DesignResult:
    """Design the motion and write it."""
    from rid_daq.operations.experiment.motion_design import design_motion

    request.refuse_options_without_effect()
    return DesignResult(request, design_motion(request, context))


OPERATION: Final = Operation(
    name="design",
    label="Design a motion",
    request=DesignRequest,
    run=run,
    examples=(
        "design ir361 --output excitation.yaml",
        "design ir361 --kind multisine --band 0.5:20 --output multisine.yaml --overwrite",
    ),
    module="rid_daq.operations.experiment.motion_design",
)
