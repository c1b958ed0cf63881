"""What `rid-daq sensitivity` does, and says of it."""

from __future__ import annotations

from typing import Final

import numpy as np

from identification.choices import REPORTED
from identification.payload.body import REPORTED_UNITS
from identification.sensitivity.cases import DIFFERENCE, SensitivityRow
from identification.sensitivity.problem import SensitivityProblem
from rid_daq.blocks.formats import number
from rid_daq.jobs.sensitivity_job import (
    DrawnPayloads,
    SensitivityRequest,
    draw_payloads,
    sensitivity_table,
)
from rid_daq.terminal.console import Console

_NO_DECIMAL: Final = 100.0  # percent


def perform(request: SensitivityRequest, console: Console) -> None:
    """Compute the table and the draws, and say them."""
    table = sensitivity_table(request, console)
    problem = table.problem
    _print_rows(console, table.rows)
    if request.output is not None:
        console.say(f"Table: {request.output}")
    drawn = draw_payloads(request, problem, console) if request.draws else None
    if drawn is not None:
        _print_draws(console, drawn, problem)
    console.document(_document(problem, table.rows, drawn))


def _document(
    problem: SensitivityProblem, rows: list[SensitivityRow], drawn: DrawnPayloads | None
) -> dict[str, object]:

    document: dict[str, object] = {
        "robot": problem.robot.name,
        "parameters": list(REPORTED),
        "truth": problem.payload.reported.tolist(),
        "rows": [
            {
                "number": row.case.number,
                "case": row.case.words,
                "against": row.against,
                "percent": list(row.percent),
            }
            for row in rows
        ],
    }
    if drawn is not None:
        values = drawn.values
        document["monte_carlo"] = {
            "draws": len(values),
            "mean": values.mean(axis=0).tolist(),
            "std": values.std(axis=0, ddof=1).tolist(),
            "percentiles": {
                str(p): np.percentile(values, p, axis=0).tolist() for p in (2.5, 50, 97.5)
            },
        }
    return document


def _print_rows(console: Console, rows: list[SensitivityRow]) -> None:
    console.say(
        "Deviation of the estimate in percent of the true value, inertia about the centre of"
        " gravity. Taken off before it is estimated: a model of the unloaded robot, or a run"
        " without the payload."
    )
    console.table(
        ("", "wrong", "taken off", *REPORTED),
        [
            (
                str(row.case.number),
                row.case.words,
                "a run" if row.against == DIFFERENCE else "a model",
                *("–" if p is None else _percent(p) for p in row.percent),
            )
            for row in rows
        ],
        key=3,
    )


def _percent(value: float) -> str:
    """Return a deviation [%] with a decimal where that is worth reading."""
    return f"{round(value, 1) + 0.0:.1f}" if abs(value) < _NO_DECIMAL else f"{value:.0f}"


def _print_draws(console: Console, drawn: DrawnPayloads, problem: SensitivityProblem) -> None:
    console.say(f"{len(drawn.values)} draws of noise and doubts:")
    console.table(
        ("parameter", "true", "mean off by", "scatter (2σ)", "unit"),
        [
            (
                name,
                number(float(truth), 4),
                f"{percent:.2g} %",
                number(2.0 * float(spread), 2),
                unit,
            )
            for name, unit, truth, percent, spread in zip(
                REPORTED,
                REPORTED_UNITS,
                problem.payload.reported,
                drawn.off_percent,
                drawn.values.std(axis=0, ddof=1),
                strict=True,
            )
        ],
    )
