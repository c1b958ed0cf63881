"""`identify`: estimate the robot's parameters from one or more runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Literal, NotRequired, TypedDict

from pydantic import Field

from config.errors import ConfigError
from identification.choices import (
    BAND_HZ,
    STANDSTILL_RAD_S,
    LoadMassKg,
    LoadMassSigmaKg,
)
from rid_daq.blocks.block import AnyBlock, Next, Text, Verdict
from rid_daq.operations.identify.model_terms import EQUATIONS, Band, ModelTerms, Standstill
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import (
    DEFAULT_RUNS,
    FILES,
    FurtherNumber,
    Option,
    Overwrite,
    RunNames,
    RunsFolder,
    Unfinished,
)
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from identification.calibration.drive_gains import DriveGains
    from rid_daq.operations.identify.identified_runs import IdentifiedRuns

LOAD: Final = "Known load"


class ModelOptions(ModelTerms):
    """Terms of the model."""

    kind: Annotated[
        Literal["internal", "external", "combined"],
        Field(
            description="Measured quantities to which the model is fitted: internal (torques),"
            " external (reaction on a force plate) or combined (both)."
        ),
        Option(group=EQUATIONS, flag="model"),
    ] = "internal"
    friction: Annotated[
        bool,
        Field(description="Include the friction terms of the robot file."),
        Option(group=EQUATIONS, negatable=True),
    ] = True
    spring: Annotated[
        bool,
        Field(description="Include the gravity spring."),
        Option(group=EQUATIONS, negatable=True),
    ] = True


class EstimationOptions(Request):
    """Model, and weights of its equations."""

    model: ModelOptions = Field(default_factory=ModelOptions)
    weighting: Annotated[
        Literal["ml", "ls", "huber"],
        Field(
            description="Weights of the equations: ml (by noise), ls (none) or huber (by noise,"
            " robust to outliers)."
        ),
        Option(group=EQUATIONS, flag="estimator"),
    ] = "ml"
    band_hz: Band = BAND_HZ
    standstill_rad_s: Standstill = STANDSTILL_RAD_S


class EstimationRequest(Request):
    """Estimation options and prior knowledge."""

    options: EstimationOptions = Field(default_factory=EstimationOptions)
    cad_prior: Annotated[
        bool,
        Field(description="Use the CAD data of the robot file as prior knowledge."),
        Option(group=EQUATIONS),
    ] = False


class IdentifyRequest(Request):
    """Estimate the robot's base parameters, with intervals, from one or more runs.

    Periodic runs are averaged and used at their harmonics; other runs are low-passed without phase
    shift and used in the time domain. The model file contains all data that other commands need.
    The fit fails if the model does not explain a joint's torque or the base wrench, or if the
    identified friction, the arm's weight or the moving mass of a prismatic joint is impossible. It
    also fails if recorded torques are clipped, or later or earlier than a bus explains, if one run
    contains a payload that is not stated, or if the model fits far better after the correction of a
    common mistake in wiring, units or files.

    In a terminal: exit code 6 if the fit fails.
    """

    names: RunNames
    runs: RunsFolder = DEFAULT_RUNS
    output: Annotated[
        Path | None,
        Field(description="Model file to write; model.json of the first run if not set."),
        Option(short="o", metavar="MODEL", group=FILES, file="output", endings=(".json",)),
    ] = None
    choose: Annotated[
        bool,
        Field(description="Choose the friction terms of each joint by cross-validation."),
        Option(negatable=True),
    ] = False
    how: EstimationRequest = Field(default_factory=EstimationRequest)
    gears: Annotated[
        Path | None,
        Field(
            description="Robot file with the stiffness, damping and motor inertia of the gears"
            " (default: that of the runs). If a stiffness is known, the model of periodic runs is"
            " fitted to the motion of the links."
        ),
        Option(group=EQUATIONS, metavar="ROBOT", file="input"),
    ] = None
    loaded: Annotated[
        tuple[str, ...],
        Field(description="Run among RUN... in which the robot carried an unknown payload."),
        Option(group=LOAD, metavar="RUN"),
    ] = ()
    load_mass_kg: Annotated[
        tuple[LoadMassKg, LoadMassSigmaKg] | None,
        Field(
            description="Weighed mass of the payload of --loaded, from which drive gains are"
            " estimated."
        ),
        Option(
            group=LOAD,
            flag="load-mass",
            unit="kg",
            needs="loaded",
            further=(
                FurtherNumber("load-mass-sigma", 0.01, "Standard deviation of the weighed mass"),
            ),
        ),
    ] = None
    loads: Annotated[
        Path | None,
        Field(
            description="File that lists known bodies, on any link, and the runs among RUN... in"
            " which the robot carried them."
        ),
        Option(group=LOAD, metavar="LOADS", file="input"),
    ] = None
    cross_check: Annotated[
        bool, Field(description="Estimate with three other methods too, and compare.")
    ] = False
    diagnose: Annotated[
        bool,
        Field(
            description="Search for common mistakes in wiring, units and files that would explain"
            " a misfit."
        ),
        Option(negatable=True),
    ] = True
    overwrite: Overwrite = False
    unfinished: Unfinished = False

    def refuse_contradictions(self) -> None:
        """Refuse options that exclude each other.

        --choose chooses the friction terms itself. The drive gains of --load-mass would also change
        the torques of known bodies.

        Raises:
            ConfigError: Such options are set.
        """
        if self.loads is not None and self.load_mass_kg is not None:
            raise ConfigError(
                "--loads and --load-mass exclude each other: leave one out",
                code="RID-OPTION-EXCLUSIVE",
            )
        terms = self.how.options.model
        if self.choose and (terms.friction_terms is not None or not terms.friction):
            raise ConfigError(
                "--choose selects the friction terms itself: leave the other friction option out",
                code="RID-OPTION-EXCLUSIVE",
            )


class IdentifyDocument(TypedDict):
    """A model and its quality."""

    model: str
    estimate: object
    drive_gains: NotRequired[object]
    plate: NotRequired[object]
    comparison: NotRequired[object]
    notes: Sequence[str]
    clocks: object
    report: str


@dataclass(frozen=True)
class IdentifyResult:
    """A model that was identified and written.

    Attributes:
        identified: The model and the paths of its files.
    """

    identified: IdentifiedRuns

    @property
    def exit_code(self) -> int:
        """Exit code 6 if there are objections to the model."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.DATA_QUALITY if self.identified.objections else ExitCode.DONE

    def document(self) -> IdentifyDocument:
        """Return the model and its quality as numbers."""
        found, result = self.identified, self.identified.result
        document: IdentifyDocument = {
            "model": str(found.model),
            "estimate": found.section,
            "notes": found.notes,
            "clocks": found.clocks,
            "report": str(found.report),
        }
        if found.gains is not None:
            document["drive_gains"] = _gain_document(found.gains)
        if result.plate is not None:
            document["plate"] = result.plate
        if result.comparison is not None:
            document["comparison"] = result.comparison
        return document

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the chosen terms, the parameters, the fit, findings, mistakes and the verdict."""
        from rid_daq.report.section_blocks.estimate import (
            finding_texts,
            fit_blocks,
            mistake_blocks,
            parameter_table,
        )
        from rid_daq.report.section_blocks.friction_choice import friction_choice_blocks
        from rid_daq.report.section_blocks.plate import plate_blocks

        found, result, section = self.identified, self.identified.result, self.identified.section
        if result.comparison is not None:
            yield from friction_choice_blocks(result.comparison)
        yield Text(text=section.sentence)
        yield parameter_table(section)
        yield from fit_blocks(section)
        if result.plate is not None:
            yield from plate_blocks(result.plate)
        if found.plate_unused:
            yield Text(
                text="The runs contain the reaction on a force plate too: --model combined uses"
                " it.",
                is_for_terminal=True,
            )
        yield from finding_texts(section)
        yield from mistake_blocks(section)
        yield from self._ending_blocks()

    def _ending_blocks(self) -> Iterator[AnyBlock]:
        from rid_daq.operations.estimation.wiring_findings import OTHER_ROBOT
        from rid_daq.report.section_blocks.estimate import fit_verdict

        found, bad = self.identified, self.identified.bad_joints
        yield Verdict(passed=not bad, text="The model was written")
        yield Text(text=f"Model: {found.model}", is_for_terminal=True)
        yield Text(text=f"Report: {found.report}", is_for_terminal=True)
        if bad:
            yield fit_verdict(found.section)
            if found.section.mistakes == ():
                yield Text(text=OTHER_ROBOT)
        else:
            yield Text(text="RUN: a run that was not used for this estimate.", is_for_terminal=True)
            yield Next(words=("validate", str(found.model), "RUN"))


def _gain_document(gains: DriveGains) -> dict[str, dict[str, float]]:
    return {
        name: {"value": float(value), "std": float(sigma)}
        for name, value, sigma in zip(gains.joint_names, gains.values, gains.sigma, strict=True)
    }


def run(request: IdentifyRequest, context: Context) -> IdentifyResult:
    """Identify the robot, and write the model and the report."""
    from rid_daq.operations.identify.identified_runs import identify_runs

    return IdentifyResult(identify_runs(request, context))


OPERATION: Final = Operation(
    name="identify",
    label="Identify a robot",
    request=IdentifyRequest,
    run=run,
    examples=(
        "identify latest --output model.json",
        "identify first second --choose --json",
        "identify empty loaded --loaded loaded --load-mass 5.02",
        "identify empty four eight --loads loads.yaml",
    ),
    module="rid_daq.operations.identify.identified_runs",
)
