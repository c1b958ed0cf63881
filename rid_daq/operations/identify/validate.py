"""`validate`: predict another run's torques and compare the error with the limits."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final, Self

from pydantic import Field, ValidationInfo, model_validator

from config.errors import ConfigError
from identification.choices import STANDSTILL_RAD_S, BandHz, BaseMassKg, StandstillRadS
from rid_daq.blocks.block import AnyBlock, Heading, Next, Text, Verdict, note_blocks
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, CarriedPayload, Option, RunsFolder, Unfinished
from rid_daq.requests.request import Request, refuse_unused

if TYPE_CHECKING:
    from rid_daq.operations.identify.model_validation import ValidatedModel

BASE: Final = "Reaction on the base"


class ValidateRequest(Request):
    """Predict a run's torques with a model, and compare the error of each axis with its limit.

    The model fails if an axis, or the reaction on the base, exceeds its limit. There is no verdict
    if the model was identified from the rows of the run, if a torque was not measured, or if the
    robot moves for less than 5 s in all runs together.

    In a terminal: exit code 1 if the model fails, 6 without a verdict.
    """

    model: Annotated[
        Path,
        Field(description="Model file of `identify`."),
        Option(positional=True, metavar="MODEL", file="input"),
    ]
    run: Annotated[
        str,
        Field(
            description="Run that was not used to identify the model; with --base-limits also a"
            " motion file, whose reaction is predicted."
        ),
        Option(positional=True, metavar="RUN"),
    ]
    further: Annotated[
        tuple[str, ...],
        Field(
            description="Further runs that are judged together with the first: the limits apply to"
            " the errors of all runs. Each run can then be short."
        ),
        Option(positional=True, metavar="[RUN...]"),
    ] = ()
    payload: CarriedPayload = None
    runs: RunsFolder = DEFAULT_RUNS
    limits: Annotated[
        str | None,
        Field(
            description="Largest allowed relative error: one percentage, or one per axis. If not"
            " set: the cell file's, or else 30 %, combined with the noise."
        ),
        Option(metavar="PERCENT,..."),
    ] = None
    band_hz: Annotated[
        BandHz | None,
        Field(description="Highest frequency of the comparison; the model's own band if not set."),
        Option(flag="band", unit="Hz"),
    ] = None
    standstill_rad_s: Annotated[
        StandstillRadS,
        Field(description="Lowest speed of samples that are compared."),
        Option(flag="standstill", unit="rad/s"),
    ] = STANDSTILL_RAD_S
    base: Annotated[
        bool,
        Field(description="Compare the reaction on the base with the limits of the cell."),
        Option(group=BASE, flag="base-limits"),
    ] = False
    mass_kg: Annotated[
        BaseMassKg | None,
        Field(description="Total mass that the base carries; the robot file's if not set."),
        Option(group=BASE, unit="kg", flag="mass", needs="base"),
    ] = None
    cell: Annotated[
        str | None,
        Field(description="Cell of a motion file: defines its limits and cycle time."),
        Option(group=BASE, metavar="CELL", owned=True),
    ] = None
    unfinished: Unfinished = False

    @property
    def is_motion_file(self) -> bool:
        """True if `run` names a motion file instead of a run."""
        return self._is_named_like_motion and Path(self.run).is_file()

    @property
    def _is_named_like_motion(self) -> bool:
        return Path(self.run).suffix in (".yaml", ".yml")

    @model_validator(mode="after")
    def _refuse_cell_of_run(self, info: ValidationInfo) -> Self:
        """Refuse a cell together with a run, except in JSON: there the service always sets a cell.

        Raises:
            ConfigError: The cell has no effect on a run (RID-OPTION-NO-EFFECT), or `run` names a
                motion file that does not exist (RID-FILE-READ).
        """
        if info.mode == "python" and not self.is_motion_file:
            if self.cell is not None and self._is_named_like_motion:
                raise ConfigError(
                    f"{self.run}: there is no such motion file; check its path and name",
                    code="RID-FILE-READ",
                )
            refuse_unused(self, ("cell",), "with a run, because a run contains its cell")
        return self


@dataclass(frozen=True)
class ValidateResult:
    """Verdict on a model.

    Attributes:
        validated: The prediction and the verdict.
    """

    request: ValidateRequest
    validated: ValidatedModel

    @property
    def exit_code(self) -> int:
        """Exit code 1 if a limit is exceeded."""
        from rid_daq.terminal.exit_codes import ExitCode

        failed = self.validated.verdict.passed is False
        return ExitCode.VERDICT_FAILED if failed else ExitCode.DONE

    def document(self) -> dict[str, object]:
        """Return the result as JSON values: errors, base reaction, verdict and notes."""
        found = self.validated
        parts = {
            "validation": found.validation,
            "runs": found.runs,
            "reaction": found.reaction,
            "base_load": found.base_load,
            "verdict": found.verdict,
            "notes": found.notes,
            "clocks": found.clocks,
            "report": None if found.report is None else str(found.report),
        }
        return {name: part for name, part in parts.items() if part is not None}

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, errors, reactions, the verdict, the report's path and the next command."""
        from rid_daq.report.section_blocks.plate import base_load_blocks, reaction_blocks
        from rid_daq.report.section_blocks.validation import run_errors_table, validation_blocks

        found, verdict = self.validated, self.validated.verdict
        yield from note_blocks(found.notes or ())
        if found.not_compared:
            yield Text(text=found.not_compared)
        if found.validation is not None:
            yield from validation_blocks(found.validation)
        if found.runs is not None:
            yield Heading(text="Each run alone")
            yield run_errors_table(found.runs)
        if found.reaction is not None:
            yield from reaction_blocks(found.reaction)
        if found.base_load is not None:
            yield from base_load_blocks(found.base_load)
        yield Verdict(passed=verdict.passed, text=verdict.headline)
        if found.report is not None:
            yield Text(text=f"Report: {found.report}", is_for_terminal=True)
        if verdict.passed is False:
            yield Next(words=("docs", "find-a-mistake"))
        elif found.validation is not None:
            words = ("export", str(self.request.model), "--to", "FORMAT", "-o", "FILE")
            yield Next(words=words)


def run(request: ValidateRequest, _context: Context) -> ValidateResult:
    """Validate the model with a run, or with a motion file."""
    from rid_daq.operations.identify.model_validation import predict_motion, validate_run

    judge = predict_motion if request.is_motion_file else validate_run
    return ValidateResult(request, judge(request))


OPERATION: Final = Operation(
    name="validate",
    label="Validate a model",
    request=ValidateRequest,
    run=run,
    examples=(
        "validate model.json validation",
        "validate model.json short-1 short-2 short-3",
        "validate model.json gripper --payload payload.json",
        "validate model.json fast.yaml --base-limits --cell ir361 --mass 120",
    ),
    module="rid_daq.operations.identify.model_validation",
)
