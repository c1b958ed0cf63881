"""`rid-daq compare`: two estimates, or the runs behind them, side by side."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from acquisition.runs.catalogue import find_run
from config.errors import ConfigError
from identification.estimation.estimate import Estimate
from identification.estimation.file import read_estimate
from identification.validation.estimate_difference import EstimateDifference, compare_estimates
from identification.validation.torque_prediction import validate
from rid_daq.report.formats import number
from rid_daq.report.sections.section import Section, finite
from rid_daq.report.sections.verdict import Check, Verdict
from rid_daq.runs.run_data import RunData, Unfinished, report_lacks
from rid_daq.session.session import DEFAULT_RUNS, RunsFolder
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.exit_codes import ExitCode

MODEL = "model.json"


class AxisPrediction(Section):
    """Relative torque errors [%] of an axis by both models; None where it did not move."""

    joint: str
    first_percent: float | None
    second_percent: float | None


class RunPrediction(Section):
    """Both models' torque errors on one run, and whether each was identified from it."""

    run: str
    label: str
    first_has_seen_it: bool
    second_has_seen_it: bool
    axes: tuple[AxisPrediction, ...]


class ParameterDifference(Section):
    """A parameter by both models with standard deviations, in `unit`, and how far they differ."""

    name: str
    unit: str
    first: float
    first_std: float
    second: float
    second_std: float
    sigmas: float


@dataclass(frozen=True)
class _Side:
    """One of the two: its name, its estimate, and its recording where a run was named."""

    name: str
    estimate: Estimate
    data: RunData | None


def compare(
    first: Annotated[
        str, typer.Argument(metavar="RUN|MODEL", help="A run that was identified, or a model file.")
    ],
    second: Annotated[str, typer.Argument(metavar="RUN|MODEL", help="The other one.")],
    on: Annotated[
        str | None,
        typer.Option(
            metavar="RUN",
            help="Predict this run's torques with both; if not given, the runs named.",
        ),
    ] = None,
    unfinished: Unfinished = False,
    runs: RunsFolder = DEFAULT_RUNS,
    as_json: AsJson = False,
) -> None:
    """Compare two estimates of one robot: parameters with intervals, and predicted torques.

    Differences are told in standard deviations. Exit code 1 where one is larger than noise
    explains: the robot, its load or its surroundings have changed, or a model lacks something.
    """
    console = Console(as_json)
    sides = [_side(each, runs, unfinished) for each in (first, second)]
    difference = compare_estimates(sides[0].estimate, sides[1].estimate)
    judged = [each.data for each in sides if each.data is not None]
    if on is not None:
        judged = [RunData.load(find_run(runs, on), unfinished=unfinished)]
    notes = report_lacks(console, judged)
    predictions = [_prediction(sides, data) for data in judged]
    worst = difference.worst
    line = Check.of(
        f"largest difference ({difference.names[worst]})",
        float(abs(difference.sigmas[worst])),
        "≤",
        difference.limit_sigmas,
        "sigmas",
    )
    headline = (
        "The two agree: noise explains every difference"
        if difference.agree
        else f"They differ: {difference.names[worst]} by {number(line.value, 3)} sigmas, noise"
        f" explains {number(difference.limit_sigmas, 3)}"
    )
    console.document(
        {
            "first": sides[0].name,
            "second": sides[1].name,
            "verdict": Verdict.of([line], headline, _sentence(difference)),
            "parameters": _parameters(difference),
            "only_first": list(difference.only_first),
            "only_second": list(difference.only_second),
            "shared_runs": list(difference.shared_runs),
            "predictions": predictions,
            "notes": notes,
        }
    )
    _print(console, sides, difference, predictions)
    console.verdict(difference.agree, headline)
    if not difference.agree:
        raise typer.Exit(ExitCode.VERDICT_FAILED)


def _side(what: str, runs: Path, unfinished: bool) -> _Side:
    """Return what is meant: a model file, or a run with the model identified from it."""
    path = Path(what)
    if path.is_file() or (path.suffix == ".json" and not path.is_dir()):
        return _Side(path.name, read_estimate(path), None)
    folder = find_run(runs, what)
    if not folder.file(MODEL).exists():
        raise ConfigError(
            f"run {what!r} has no {MODEL}: identify it first: rid-daq identify {folder.path}"
        )
    data = RunData.load(folder, unfinished=unfinished)
    folder.read(MODEL)  # as it was written there, or refused
    return _Side(folder.manifest().label, read_estimate(folder.file(MODEL)), data)


def _prediction(sides: list[_Side], data: RunData) -> RunPrediction:
    """Return both models' torque errors on one run."""
    found = [
        validate(side.estimate, data.recording, cutoff_hz=side.estimate.band_hz) for side in sides
    ]
    folder = data.folder
    seen = [folder.run_id in side.estimate.run_ids for side in sides]
    return RunPrediction(
        run=folder.run_id,
        label=folder.manifest().label,
        first_has_seen_it=seen[0],
        second_has_seen_it=seen[1],
        axes=tuple(
            AxisPrediction(
                joint=name,
                first_percent=finite(found[0].relative_percent[joint]),
                second_percent=finite(found[1].relative_percent[joint]),
            )
            for joint, name in enumerate(data.recording.joint_names)
        ),
    )


def _sentence(difference: EstimateDifference) -> str:
    said = (
        f"{len(difference.names)} parameters compared; among so many, noise alone exceeds"
        f" {number(difference.limit_sigmas, 3)} sigmas once in a hundred comparisons."
    )
    if difference.shared_runs:
        said += (
            " Both were identified from some of the same runs: they err alike, so that equal"
            " parameters prove nothing."
        )
    return said


def _parameters(difference: EstimateDifference) -> list[ParameterDifference]:
    return [
        ParameterDifference(
            name=name,
            unit=difference.units[i],
            first=float(difference.first[i]),
            first_std=float(difference.first_sigma[i]),
            second=float(difference.second[i]),
            second_std=float(difference.second_sigma[i]),
            sigmas=float(difference.sigmas[i]),
        )
        for i, name in enumerate(difference.names)
    ]


def _print(
    console: Console,
    sides: list[_Side],
    difference: EstimateDifference,
    predictions: list[RunPrediction],
) -> None:
    console.table(
        ("parameter", sides[0].name, "±2σ", sides[1].name, "±2σ", "unit", "difference [σ]"),
        [
            (
                name,
                number(float(difference.first[i]), 4),
                number(2.0 * float(difference.first_sigma[i]), 2),
                number(float(difference.second[i]), 4),
                number(2.0 * float(difference.second_sigma[i]), 2),
                difference.units[i],
                f"{difference.sigmas[i]:+.1f}",
            )
            for i, name in enumerate(difference.names)
        ],
        red=(np.abs(difference.sigmas) > difference.limit_sigmas).tolist(),
    )
    for names, side in ((difference.only_first, 0), (difference.only_second, 1)):
        if names:
            console.say(f"Only in {sides[side].name}: {', '.join(names)}")
    for prediction in predictions:
        console.say()
        console.say(f"Torque errors on run {prediction.label!r}:")
        console.table(
            ("axis", *(_head(sides, prediction, side) for side in (0, 1))),
            [
                (
                    axis.joint,
                    _percent(axis.first_percent),
                    _percent(axis.second_percent),
                )
                for axis in prediction.axes
            ],
        )
    console.say()
    console.say(_sentence(difference))


def _head(sides: list[_Side], prediction: RunPrediction, side: int) -> str:
    seen = prediction.second_has_seen_it if side else prediction.first_has_seen_it
    return f"by {sides[side].name} [%]" + (" (identified from it)" if seen else "")


def _percent(value: float | None) -> str:
    return "did not move" if value is None else number(value, 3)
