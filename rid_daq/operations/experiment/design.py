"""`design`: choose a motion, verify it against the limits, write the motion file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal

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
from rid_daq.requests.option import FILES, CellName, Option, Overwrite
from rid_daq.requests.request import Request, shown_fields
from rid_daq.terminal.choices import Kind

if TYPE_CHECKING:
    from rid_daq.operations.experiment.motion_design import Designed

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

Period = Annotated[
    PeriodS,
    Field(description="Period, a whole number of control cycles; multisines: 8 if not set."),
    Option(unit="s", flag="period"),
]
PeriodCount = Annotated[
    Periods,
    Field(description="Periods that are recorded for the estimate; multisines: 4 if not set."),
]
DrawSeed = Annotated[
    Seed, Field(description="Seed of everything that is drawn at random."), Option(group=SEARCH)
]


class Excitation(Request):
    """How an excitation is found: by gradients from many starts, or by the heuristic."""

    method: Annotated[
        Literal["optimal", "two-harmonic"],
        Field(
            description="optimal: by gradients from many starts; two-harmonic: the quick heuristic"
            " (3.22)."
        ),
        Option(group=SEARCH),
    ] = "optimal"
    criterion: Annotated[
        Literal["condition", "d-optimal"],
        Field(description="Smallest condition number, or largest information."),
        Option(group=SEARCH),
    ] = "d-optimal"
    period_s: Period = 10.0
    periods: PeriodCount = 16
    harmonics: Annotated[
        Harmonics | None,
        Field(
            validation_alias=AliasChoices("harmonics", "highest_harmonic"),
            description="Highest harmonic; 5 if not set, two-harmonic: 8.",
        ),
    ] = None
    wanted: Annotated[
        tuple[str, ...],
        Field(
            description="Parameters to know best in place of --criterion, such as sx3,Izz1; or"
            " torque."
        ),
        Option(group=SEARCH, flag="for", metavar="NAMES", separator=","),
    ] = ()
    starts: Annotated[
        Starts, Field(description="Number of starts to refine (optimal)."), Option(group=SEARCH)
    ] = 12
    budget_s: Annotated[
        BudgetS | None,
        Field(description="End after the start that is ready after this time."),
        Option(group=SEARCH, unit="s", flag="budget"),
    ] = None
    tries: Annotated[
        Tries,
        Field(description="Number of motions to compare (two-harmonic)."),
        Option(group=SEARCH),
    ] = 200
    limit_fraction: Annotated[
        LimitFraction,
        Field(description="Share of the limits that the motion may use (two-harmonic)."),
        Option(group=SEARCH),
    ] = 0.85
    seed: DrawSeed = 0

    @model_validator(mode="before")
    @classmethod
    def _with_method(cls, values: object, info: ValidationInfo) -> object:
        """Take the method from options that only it has, for programs that do not know `method`."""
        if info.mode != "json" or not isinstance(values, dict):
            return values
        own = values.keys() & _METHOD_KEYS
        found: dict[object, object] = {"method": "two-harmonic"} if own else {}
        for name, value in values.items():  # no longer JSON for pydantic: its lists are tuples
            found[name] = tuple(value) if isinstance(value, list) else value
        return found


class Multisine(Request):
    """What multisines are like."""

    band_hz: Annotated[
        tuple[FrequencyHz, FrequencyHz] | None,
        Field(description="Lowest and highest frequency; those of the cell file if not set."),
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
        Field(description="Draws of the phases; 4 if not set, schroeder: 1."),
        Option(group=MULTISINES),
    ] = None
    grid: Annotated[
        Literal["odd", "random_odd", "full"],
        Field(description="Lines of the band that are excited."),
        Option(group=MULTISINES),
    ] = "random_odd"
    phases: Annotated[
        Literal["random", "schroeder"],
        Field(description="Phases at which the search for low peaks starts."),
        Option(group=MULTISINES),
    ] = "random"
    slow: Annotated[
        bool,
        Field(description="Add a slow sine, which keeps friction from sticking."),
        Option(group=MULTISINES, negatable=True),
    ] = True
    seed: DrawSeed = 0


class DesignRequest(Request):
    """Choose an excitation and verify it densely.

    `optimal` refines random starts by exact gradients, on all cores, within the limits on position,
    speed, acceleration, torque, workspace and self-collision; the same seed and starts give the
    same file. `two-harmonic` takes the best of many draws of one low and one high harmonic for each
    axis. The motion has passed the check of every limit, ramps included. Ctrl-C ends the search
    with the best motion found so far (exit code 130).
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
            description="excitation: for a robot's parameters; constant-velocity, or reversed, an"
            " excitation there and back in time: for friction alone; multisine: for velocity loops."
        ),
    ] = Kind.EXCITATION
    excitation: Excitation = Field(default_factory=Excitation)
    model: Annotated[
        Path | None,
        Field(description="Model file for the torque limits."),
        Option(metavar="MODEL", file="input"),
    ] = None
    given: Annotated[
        tuple[Path, ...],
        Field(description="Model of an earlier run, whose information counts."),
        Option(metavar="MODEL", file="input"),
    ] = ()
    multisine: Multisine = Field(default_factory=Multisine)
    seed: DrawSeed = 0
    scheduler: Annotated[
        str | None,
        Field(description="Dask scheduler to compute on, such as tcp://host:8786."),
        Option(metavar="ADDRESS", group=FILES, owned=True),
    ] = None
    overwrite: Overwrite = False

    def refuse_useless(self) -> None:
        """Refuse options that have no effect on this kind of motion, or with this method.

        Raises:
            ConfigError: One is set (RID-OPTION-NO-EFFECT), or both --for and --criterion
                (RID-OPTION-EXCLUSIVE).
        """
        useless, because = self._useless
        for each in shown_fields(type(self)):
            holder = self if len(each.path) == 1 else getattr(self, each.path[0])
            if each.flag in useless and each.path[-1] in holder.model_fields_set:
                raise ConfigError(
                    f"{each.flag}: has no effect with {because}; leave it out",
                    code="RID-OPTION-NO-EFFECT",
                )
        if self.excitation.wanted and "criterion" in self.excitation.model_fields_set:
            raise ConfigError(
                "--for takes the place of --criterion: leave one of them out",
                code="RID-OPTION-EXCLUSIVE",
            )

    @property
    def _useless(self) -> tuple[frozenset[str], str]:
        """The options without effect, and the option that is the reason."""
        by = f"--kind {self.kind.value}"
        if self.kind is Kind.CONSTANT_VELOCITY:
            return _OF_PERIODS | _OF_MULTISINES | _OF_EXCITATIONS | {"--model"}, by
        if self.kind is Kind.MULTISINE:
            return _OF_EXCITATIONS, by
        if self.excitation.method == "two-harmonic":
            others = _OF_OPTIMAL | _OF_MULTISINES | {"--model"}
            return others, f"{by} --method two-harmonic"
        return _OF_MULTISINES | _OF_HEURISTIC, f"{by} --method optimal"


@dataclass(frozen=True)
class DesignResult:
    """A motion that was designed and written.

    Attributes:
        request: What was asked for.
        designed: The motion, and how it was found.
    """

    request: DesignRequest
    designed: Designed

    @property
    def exit_code(self) -> int:
        """130 or 143 if the search was interrupted."""
        return 0 if self.designed.found is None else int(self.designed.found.exit_code)

    def document(self) -> Mapping[str, object]:
        """Return the numbers of the motion."""
        from rid_daq.operations.experiment.shown_motion import motion_document

        return motion_document(self.designed, self.request.output)

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield what is in the motion file, how it was found, and the next commands."""
        from rid_daq.operations.experiment.shown_motion import designed_motion_blocks

        return designed_motion_blocks(self.designed, self.request)


def run(request: DesignRequest, context: Context) -> DesignResult:
    """Design the motion, and write it."""
    from rid_daq.operations.experiment.motion_design import design_motion

    request.refuse_useless()
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
