"""`compare`: compare two estimates of the same robot."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from rid_daq.blocks.block import AnyBlock, Cells, Interval, Table, Text, note_blocks, table
from rid_daq.blocks.block import Verdict as VerdictBlock
from rid_daq.blocks.formats import number
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, CarriedPayload, Option, RunsFolder, Unfinished
from rid_daq.requests.request import Request

if TYPE_CHECKING:
    from rid_daq.operations.identify.compared_models import ComparedModels, RunPrediction
    from rid_daq.report.sections.verdict import VerdictSection


class CompareRequest(Request):
    """Compare two estimates of the same robot: parameters with intervals, and predicted torques.

    Differences are given in standard deviations. The exit code is 1 if a difference is larger than
    noise explains: the robot, its load or its surroundings have changed, or a model lacks an
    effect.
    """

    first: Annotated[
        str,
        Field(description="Run with an identified model, or a model file."),
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
    """Differences of two estimates.

    Attributes:
        compared: The differences, and the torque errors of both models.
    """

    compared: ComparedModels

    @property
    def exit_code(self) -> int:
        """Exit code 1 if the estimates differ by more than noise explains."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.DONE if self.compared.difference.agree else ExitCode.VERDICT_FAILED

    @property
    def verdict(self) -> VerdictSection:
        """Verdict on the largest difference and its limit."""
        from rid_daq.report.sections.verdict import VerdictCheck, VerdictSection

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
            "The estimates agree: noise explains every difference"
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
        compared, difference = self.compared, self.compared.difference
        return {
            "first": compared.names[0],
            "second": compared.names[1],
            "verdict": self.verdict,
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

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield notes, parameters side by side, torque errors on each run, and the verdict."""
        compared, verdict = self.compared, self.verdict
        yield from note_blocks(compared.notes)
        yield self._parameter_table()
        difference, (first, second) = compared.difference, compared.names
        for names, side in ((difference.only_first, first), (difference.only_second, second)):
            if names:
                yield Text(text=f"Only in {side}: {', '.join(names)}")
        for prediction in compared.predictions:
            yield Text(text=f"Torque errors on run {prediction.data.folder.manifest().label!r}:")
            yield _error_table(prediction, compared.names)
        yield Text(text=verdict.sentence)
        yield VerdictBlock(passed=difference.agree, text=verdict.headline)

    def _parameter_table(self) -> Table:
        difference, (first, second) = self.compared.difference, self.compared.names
        return table(
            range(len(difference.names)),
            Cells("parameter", lambda i: difference.names[i]),
            Cells(
                f"{first} ± 2σ",
                lambda i: Interval.of(float(difference.first[i]), float(difference.first_sigma[i])),
            ),
            Cells(
                f"{second} ± 2σ",
                lambda i: Interval.of(
                    float(difference.second[i]), float(difference.second_sigma[i])
                ),
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
    """Compare two estimates."""
    from rid_daq.operations.identify.compared_models import compare_models

    return CompareResult(compare_models(request))


OPERATION: Final = Operation(
    name="compare",
    label="Compare two estimates",
    request=CompareRequest,
    run=run,
    examples=("compare monday friday", "compare model.json latest --on validation --json"),
    module="rid_daq.operations.identify.compared_models",
)
