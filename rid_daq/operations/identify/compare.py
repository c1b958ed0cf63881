"""`compare`: compare two runs or models of the same robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.errors import ConfigError
from rid_daq.blocks.block import (
    AnyBlock,
    Cells,
    Heading,
    Interval,
    Table,
    Text,
    note_blocks,
    table,
)
from rid_daq.blocks.block import Verdict as VerdictBlock
from rid_daq.blocks.formats import number
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, CarriedPayload, Option, RunsFolder, Unfinished
from rid_daq.requests.request import Request
from rid_daq.terminal.choices import MODEL

if TYPE_CHECKING:
    from rid_daq.operations.identify.compared_models import ComparedModels, RunPrediction
    from rid_daq.operations.identify.compared_runs import RunPair
    from rid_daq.report.sections.verdict import VerdictSection


class CompareRequest(Request):
    """Compare two runs or models of the same robot: parameters with intervals, predicted torques.

    Differences are given in standard deviations. A difference that is larger than noise explains
    shows that the robot, its load or its surroundings have changed, or that a model lacks an
    effect. Of two runs, their conditions, verdicts and residuals are compared too. If neither run
    has a model, only these are compared, and nothing is judged.

    In a terminal: exit code 1 after such a difference.
    """

    first: Annotated[
        str,
        Field(description="Run, or a model file."),
        Option(positional=True, metavar="FIRST", file="input"),
    ]
    second: Annotated[
        str,
        Field(description="Run or model file to compare with."),
        Option(positional=True, metavar="SECOND", file="input"),
    ]
    runs: RunsFolder = DEFAULT_RUNS
    on: Annotated[
        str | None,
        Field(description="Run whose torques both models predict; the named runs if not set."),
        Option(metavar="RUN"),
    ] = None
    payload: CarriedPayload = None
    unfinished: Unfinished = False


@dataclass(frozen=True)
class CompareResult:
    """Differences of two runs or models; at least one attribute is not None.

    Attributes:
        compared: Differences of the models, and their torque errors; None if neither run has a
            model.
        runs: Both runs side by side; None if a model file is compared.
    """

    compared: ComparedModels | None
    runs: RunPair | None = None

    @property
    def exit_code(self) -> int:
        """Exit code 1 if the estimates differ by more than noise explains."""
        from rid_daq.terminal.exit_codes import ExitCode

        compared = self.compared
        agree = compared is None or compared.difference.agree
        return ExitCode.DONE if agree else ExitCode.VERDICT_FAILED

    @property
    def verdict(self) -> VerdictSection:
        """Verdict on the largest difference and its limit."""
        from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection

        if self.compared is None:
            sentence = "Neither run has a model, so their parameters are not compared."
            return VerdictSection.of([], "Runs side by side, not judged", sentence)
        difference = self.compared.difference
        worst = difference.worst
        line = VerdictCheck.of(
            f"largest difference ({difference.names[worst]})",
            float(abs(difference.sigmas[worst])),
            "≤",
            difference.limit_sigmas,
            "sigmas",
        )
        headline = (
            "The estimates agree: noise can explain every difference"
            if difference.agree
            else f"The estimates differ: {difference.names[worst]} by {number(line.value, 3)}"
            f" sigmas; noise explains {number(difference.limit_sigmas, 3)}"
        )
        sentence = (
            f"{len(difference.names)} parameters compared; with so many, noise alone exceeds"
            f" {number(difference.limit_sigmas, 3)} sigmas in one of a hundred comparisons."
        )
        if difference.shared_runs:
            sentence += (
                " Both estimates use some of the same runs, so their errors are correlated and"
                " equal parameters prove nothing."
            )
        return VerdictSection.of([line], headline, sentence)

    def document(self) -> dict[str, object]:
        """Return the differences and torque errors as numbers."""
        found: dict[str, object] = {"verdict": self.verdict}
        if self.compared is not None:
            found |= _models_document(self.compared)
        if self.runs is not None:
            found |= {"first": self.runs.first.name, "second": self.runs.second.name}
            found |= {"runs": self.runs.document()}
        return found

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield the verdict, both runs side by side, parameters, and torque errors on each run."""
        verdict = self.verdict
        if self.compared is not None:
            yield from note_blocks(self.compared.notes)
        if self.runs is not None:
            yield from self.runs.blocks()
        if self.compared is not None:
            if self.runs is not None:
                yield Heading(text="Parameters of the models")
            yield from _model_blocks(self.compared)
        yield Text(text=verdict.sentence)
        yield VerdictBlock(passed=verdict.passed, text=verdict.headline)


def _models_document(compared: ComparedModels) -> dict[str, object]:
    difference = compared.difference
    return {
        "first": compared.names[0],
        "second": compared.names[1],
        "parameters": [
            {
                "name": name,
                "unit": difference.units[i],
                "first": float(difference.first[i]),
                "first_std": float(difference.first_sigma[i]),
                "second": float(difference.second[i]),
                "second_std": float(difference.second_sigma[i]),
                "sigmas": float(difference.sigmas[i]),
            }
            for i, name in enumerate(difference.names)
        ],
        "only_first": list(difference.only_first),
        "only_second": list(difference.only_second),
        "shared_runs": list(difference.shared_runs),
        "predictions": [_prediction_document(each) for each in compared.predictions],
        "notes": compared.notes,
    }


def _model_blocks(compared: ComparedModels) -> Iterator[AnyBlock]:
    """Yield parameters side by side, and torque errors on each run."""
    difference, (first, second) = compared.difference, compared.names
    yield _parameter_table(compared)
    for names, side in ((difference.only_first, first), (difference.only_second, second)):
        if names:
            yield Text(text=f"Only in {side}: {', '.join(names)}")
    for prediction in compared.predictions:
        yield Text(text=f"Torque errors on run {prediction.data.folder.manifest().label!r}:")
        yield _error_table(prediction, compared.names)


def _parameter_table(compared: ComparedModels) -> Table:
    difference, (first, second) = compared.difference, compared.names
    return table(
        range(len(difference.names)),
        Cells("parameter", lambda i: difference.names[i]),
        Cells(
            f"{first} ± 2σ",
            lambda i: Interval.of(float(difference.first[i]), float(difference.first_sigma[i])),
        ),
        Cells(
            f"{second} ± 2σ",
            lambda i: Interval.of(float(difference.second[i]), float(difference.second_sigma[i])),
        ),
        Cells("unit", lambda i: difference.units[i]),
        Cells(
            "difference [σ]",
            lambda i: f"{round(float(difference.sigmas[i]), 1) + 0.0:+.1f}",
        ),
        failed=lambda i: bool(abs(difference.sigmas[i]) > difference.limit_sigmas),
    )


def _error_table(prediction: RunPrediction, names: tuple[str, str]) -> Table:
    from rid_daq.report.sections.section import finite_or_none

    heads = [
        f"by {name}" + (" (identified from this run)" if is_fit else "")
        for name, is_fit in zip(names, prediction.identified_from, strict=True)
    ]
    joints = prediction.data.recording.joint_names
    percent = prediction.percent.tolist()

    def errors(by: int) -> Cells[int]:
        values = ["did not move" if finite_or_none(each) is None else each for each in percent[by]]
        return Cells(heads[by], values.__getitem__, "%", 3)

    return table(range(len(joints)), Cells("joint", lambda j: joints[j]), errors(0), errors(1))


def _prediction_document(prediction: RunPrediction) -> dict[str, object]:
    from rid_daq.report.sections.section import finite_or_none

    data, (first, second) = prediction.data, prediction.identified_from
    return {
        "run": data.folder.run_id,
        "label": data.folder.manifest().label,
        "first_has_seen_it": first,
        "second_has_seen_it": second,
        "axes": [
            {
                "joint": joint,
                "first_percent": finite_or_none(one),
                "second_percent": finite_or_none(other),
            }
            for joint, (one, other) in zip(
                data.recording.joint_names, prediction.percent.T, strict=True
            )
        ],
    }


def run(request: CompareRequest, _context: Context) -> CompareResult:
    """Compare two runs or models."""
    from rid_daq.operations.identify.compared_models import compare_models, named_runs
    from rid_daq.operations.identify.compared_runs import RunPair

    folders = named_runs(request)
    if folders is None:
        return CompareResult(compare_models(request))
    has_model = any(folder.file(MODEL).exists() for folder in folders)
    if not has_model and (request.on is not None or request.payload is not None):
        raise ConfigError(
            "--on and --payload need models, but neither run has one: identify both runs first, or"
            " leave the option out",
            code="RID-OPTION-NO-EFFECT",
        )
    compared = compare_models(request) if has_model else None
    return CompareResult(compared, RunPair.of(*folders))


OPERATION: Final = Operation(
    name="compare",
    label="Compare two runs or models",
    request=CompareRequest,
    run=run,
    examples=("compare monday friday", "compare model.json latest --on validation --json"),
    module="rid_daq.operations.identify.compared_models",
)
