"""`demo`: demonstration of all steps on the bundled simulated cell, with a report; no hardware."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Final

from pydantic import Field

from config.ranges import Periods, Seed
from rid_daq.blocks.block import AnyBlock, Cells, Next, Table, Text, Verdict, table
from rid_daq.operations.operation import Context, Operation
from rid_daq.requests.option import DEFAULT_RUNS, Option, RunsFolder
from rid_daq.requests.request import Request
from rid_daq.terminal.choices import DEMO_PERIOD_S

if TYPE_CHECKING:
    from rid_daq.demo.demo import Demo
    from rid_daq.report.sections.validation import ValidationSection


class DemoRequest(Request):
    """Demonstrate all steps on the bundled simulated cell; no hardware is needed or moved.

    The demo designs an excitation, records it and a validation motion, averages, identifies and
    validates. This is done on two robots side by side. The first robot has effects that no model
    contains. The second has no such effects: at least 90 % of its true parameters must be inside
    their 95 % intervals. The first robot then measures its velocity loops and drives a circle and
    a path, without and with pre-compensation. It also drives a pick-and-place path, before and
    after it is retimed to the limits of the torques and of the reaction on the base. A third robot
    has elastic gears: a laser tracker measures the tool on a circle without and with correction of
    the deflection. One report contains all results.
    """

    seed: Annotated[
        Seed,
        Field(description="Random seed of motions and noise; it determines all numbers."),
    ] = 1
    periods: Annotated[
        Periods, Field(description=f"Number of periods of {DEMO_PERIOD_S:g} s to measure.")
    ] = 16
    points: Annotated[
        int,
        Field(ge=2, le=100_000, description="Number of random points of the validation motion."),
    ] = 20
    paths: Annotated[
        bool,
        Field(description="Drive paths, with and without compensation."),
        Option(negatable=True),
    ] = True
    runs: RunsFolder = DEFAULT_RUNS


@dataclass(frozen=True)
class DemoResult:
    """Result and report of the demo.

    Attributes:
        done: Result of the demo and its files.
    """

    done: Demo

    @property
    def exit_code(self) -> int:
        """Exit code 1 if a number is outside its limit."""
        from rid_daq.terminal.exit_codes import ExitCode

        return ExitCode.DONE if self.done.result.verdict.passed else ExitCode.VERDICT_FAILED

    def document(self) -> dict[str, object]:
        """Return the result, its folder and its report."""
        document = self.done.result.model_dump(mode="json", by_alias=True)
        folder, report = self.done.folder.path, self.done.report
        return {**document, "folder": str(folder), "report": str(report)}

    def blocks(self) -> Iterator[AnyBlock]:
        """Yield validation errors, a sentence per chapter, the verdict, and the report's path."""
        result, judged = self.done.result, self.done.result.verdict
        yield Text(text="")
        if result.validation is not None:
            yield _validation(result.validation)
        for case in result.truth or ():
            yield Text(text=case.sentence)
        for motion in () if result.tracking is None else result.tracking.motions:
            before = "–" if motion.before is None else f"{1e3 * motion.before.mean_m:.3f}"
            after = f"{1e3 * motion.after.mean_m:.3f}"
            yield Text(
                text=f"{motion.sentence} Mean distance {before} mm before, {after} mm after"
                " pre-compensation, at the motor encoders."
            )
        driven = None if result.retiming is None else result.retiming.driven
        if driven is not None:
            yield Text(text=driven.words)
        if result.elastic_path is not None:
            yield Text(text=result.elastic_path.words)
        if result.timing is not None and result.timing.elapsed_s is not None:
            yield Text(text=f"Duration: {result.timing.elapsed_s:.1f} s.")
        yield Verdict(passed=judged.passed, text=judged.headline)
        yield Text(text=f"Report: {self.done.report}", is_for_terminal=True)
        if judged.passed:
            yield Next(words=("docs", "first-hour"), lead="Next: the same steps one by one")


def _validation(section: ValidationSection) -> Table:
    return table(
        section.axes,
        Cells("axis", lambda axis: axis.joint),
        Cells("rms torque", lambda axis: f"{axis.rms_torque or 0.0:.2f} {axis.unit}"),
        Cells("error", lambda axis: f"{axis.rms_error or 0.0:.3f} {axis.unit}"),
        Cells("floor", lambda axis: f"{axis.floor or 0.0:.3f} {axis.unit}"),
        Cells("error/floor", lambda axis: f"{axis.error_over_floor or 0.0:.3f}"),
    )


def run(request: DemoRequest, context: Context) -> DemoResult:
    """Run the demo."""
    from rid_daq.demo.demo import run_demo

    done = run_demo(
        request.runs,
        context,
        seed=request.seed,
        periods=request.periods,
        points=request.points,
        paths=request.paths,
    )
    return DemoResult(done)


OPERATION: Final = Operation(
    name="demo",
    label="Demo",
    request=DemoRequest,
    run=run,
    examples=("demo --seed 7", "demo --no-paths --periods 8"),
    is_of_cells=True,
    module="rid_daq.demo.demo",
)
