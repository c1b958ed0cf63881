"""`rid-daq demo`: the whole story on the bundled simulated cell, with a report, no hardware."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

from rid_daq.terminal.choices import DEMO_PERIOD_S
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode
from rid_daq.terminal.options import DEFAULT_RUNS, AsJson, RunsFolder

if TYPE_CHECKING:
    from rid_daq.report.result import Result


def demo(
    seed: Annotated[
        int, typer.Option(min=0, help="Of motions and noise; the same seed, the same numbers.")
    ] = 1,
    periods: Annotated[
        int, typer.Option(min=2, help=f"Periods of {DEMO_PERIOD_S:g} s to measure.")
    ] = 16,
    points: Annotated[
        int, typer.Option(min=2, help="Random points of the validation motion.")
    ] = 20,
    paths: Annotated[
        bool,
        typer.Option(
            "--paths/--no-paths", help="Whether paths are driven, with and without compensation."
        ),
    ] = True,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Run the whole story on the bundled simulated cell; no hardware is needed or moved.

    Design an excitation, record it, record a validation motion, average, identify, validate and
    report. It is done twice side by side: on a robot with effects that no model has, and on one
    without, where the true parameters must lie inside their intervals. The first then measures its
    velocity loops and drives a circle and a path, before and after pre-compensation; and a
    pick-and-place path, before and after it is timed to what torques and base allow.
    """
    from rid_daq.demo.demo import DemoRequest, run_demo

    console = Console(as_json)
    done = run_demo(DemoRequest(runs, seed, periods, points, paths), console)
    judged = done.result.verdict
    document = done.result.model_dump(mode="json", by_alias=True)
    console.document({**document, "folder": str(done.folder.path), "report": str(done.report)})
    _print(console, done.result)
    console.verdict(judged.passed, judged.headline)
    console.say(f"Report: {done.report}")
    if not judged.passed:
        raise typer.Exit(ExitCode.VERDICT_FAILED)
    console.next_step("docs", "first-hour", lead="Next, the same step by step")


def _print(console: Console, result: Result) -> None:
    assert result.validation is not None
    console.say()
    console.table(
        ("axis", "rms torque", "error", "floor", "error/floor"),
        [
            (
                axis.joint,
                f"{axis.rms_torque or 0.0:.2f} {axis.unit}",
                f"{axis.rms_error or 0.0:.3f} {axis.unit}",
                f"{axis.floor or 0.0:.3f} {axis.unit}",
                f"{axis.error_over_floor or 0.0:.3f}",
            )
            for axis in result.validation.axes
        ],
    )
    for case in result.truth or ():
        console.say(case.sentence)
    for motion in () if result.tracking is None else result.tracking.motions:
        before = "–" if motion.before is None else f"{1e3 * motion.before.mean_m:.3f}"
        console.say(
            f"{motion.sentence} Mean distance {before} mm before,"
            f" {1e3 * motion.after.mean_m:.3f} mm after pre-compensation, at the motor encoders."
        )
    driven = None if result.retiming is None else result.retiming.driven
    if driven is not None:
        console.say(driven.words)
    if result.timing is not None and result.timing.elapsed_s is not None:
        console.say(f"Took {result.timing.elapsed_s:.1f} s.")
