"""What `rid-daq compare` does, and says of it."""

from __future__ import annotations

import numpy as np
import typer

from identification.validation.estimate_difference import EstimateDifference
from rid_daq.blocks.formats import measured, number
from rid_daq.jobs.compare_job import Compared, CompareRequest, RunPrediction, compare_models
from rid_daq.report.sections.section import finite
from rid_daq.report.sections.verdict import Check, Verdict
from rid_daq.terminal.console import Console
from rid_daq.terminal.exit_codes import ExitCode


def perform(request: CompareRequest, console: Console) -> None:
    """Compare, and say what differs; exit codes as the command has them."""
    compared = compare_models(request, console)
    _print(console, compared, _verdict(compared.difference))
    if not compared.difference.agree:
        raise typer.Exit(ExitCode.VERDICT_FAILED)


def _verdict(difference: EstimateDifference) -> Verdict:
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
    return Verdict.of([line], headline, _sentence(difference))


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


def _print(console: Console, compared: Compared, verdict: Verdict) -> None:
    difference = compared.difference
    parameters = [
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
    ]
    console.document(
        {
            "first": compared.names[0],
            "second": compared.names[1],
            "verdict": verdict,
            "parameters": parameters,
            "only_first": list(difference.only_first),
            "only_second": list(difference.only_second),
            "shared_runs": list(difference.shared_runs),
            "predictions": [_told(prediction) for prediction in compared.predictions],
            "notes": compared.notes,
        }
    )
    first, second = compared.names
    console.table(
        ("parameter", first, "±2σ", second, "±2σ", "unit", "difference [σ]"),
        [
            (
                name,
                *measured(float(difference.first[i]), 2.0 * float(difference.first_sigma[i])),
                *measured(float(difference.second[i]), 2.0 * float(difference.second_sigma[i])),
                difference.units[i],
                f"{round(float(difference.sigmas[i]), 1) + 0.0:+.1f}",
            )
            for i, name in enumerate(difference.names)
        ],
        red=(np.abs(difference.sigmas) > difference.limit_sigmas).tolist(),
    )
    for names, side in ((difference.only_first, first), (difference.only_second, second)):
        if names:
            console.say(f"Only in {side}: {', '.join(names)}")
    for prediction in compared.predictions:
        console.say()
        console.say(f"Torque errors on run {prediction.data.folder.manifest().label!r}:")
        heads = [
            f"by {name} [%]" + (" (identified from it)" if seen else "")
            for name, seen in zip(compared.names, prediction.seen, strict=True)
        ]
        joints = prediction.data.recording.joint_names
        console.table(
            ("axis", *heads),
            [
                (joint, *(_percent(finite(value)) for value in values))
                for joint, values in zip(joints, prediction.percent.T, strict=True)
            ],
        )
    console.say()
    console.say(verdict.sentence)
    console.verdict(difference.agree, verdict.headline)


def _told(prediction: RunPrediction) -> dict[str, object]:
    data, (first, second) = prediction.data, prediction.seen
    return {
        "run": data.folder.run_id,
        "label": data.folder.manifest().label,
        "first_has_seen_it": first,
        "second_has_seen_it": second,
        "axes": [
            {"joint": joint, "first_percent": finite(one), "second_percent": finite(other)}
            for joint, (one, other) in zip(
                data.recording.joint_names, prediction.percent.T, strict=True
            )
        ],
    }


def _percent(value: float | None) -> str:
    return "did not move" if value is None else number(value, 3)
