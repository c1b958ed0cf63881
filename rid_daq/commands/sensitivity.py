"""`rid-daq sensitivity`: what wrong knowledge of a robot does to a payload's estimate."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.motion_file import load_motion
from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell
from dynamics.model.robot_model import RobotModel
from identification.consistency.closest_robot import consistent
from identification.estimation.file import read_estimate
from identification.payload.body import REPORTED, REPORTED_UNITS, PayloadBody
from identification.payload.file import read_payload
from identification.sensitivity.cases import (
    SensitivityRow,
    sensitivity_row,
    thesis_cases,
    thesis_motion,
)
from identification.sensitivity.monte_carlo import Draws, PriorUncertainty, collected, monte_carlo
from identification.sensitivity.problem import (
    Comparison,
    Excitation,
    SensitivityProblem,
    deviation_percent,
)
from rid_daq.jobs.truth import true_parameters
from rid_daq.report.formats import number
from rid_daq.terminal.console import AsJson, Console
from rid_daq.terminal.inapplicable_options import refuse_inapplicable
from rid_daq.terminal.output_file import Overwrite, refuse_output

PAYLOAD = "medium"


class Against(StrEnum):
    """How the robot is told from the payload."""

    MODEL = "model"
    DIFFERENCE = "difference"


def sensitivity(
    context: typer.Context,
    cell: Annotated[
        str, typer.Argument(metavar="CELL", help="A bundled cell, or a path to a cell file.")
    ] = "kr15",
    payload: Annotated[
        str,
        typer.Option(
            help="A payload of the simulated cell by name, or a file of payload identify."
        ),
    ] = PAYLOAD,
    against: Annotated[
        Against | None,
        typer.Option(
            help="Less a model of the unloaded robot, or less a run without the payload; torque"
            " constants by the latter and all else by the former if not given."
        ),
    ] = None,
    model: Annotated[
        Path | None,
        typer.Option(
            metavar="MODEL", help="A model file of identify: the robot, where it is not simulated."
        ),
    ] = None,
    motion: Annotated[
        str | None,
        typer.Option(
            metavar="MOTION", help="A periodic motion; harmonics 1 and 20 of 30 s if not given."
        ),
    ] = None,
    share_percent: Annotated[
        float, typer.Option("--share", min=0.001, max=90.0, help="How wrong beliefs are [%].")
    ] = 10.0,
    bias_nm: Annotated[
        float, typer.Option("--bias", help="Torque bias of axis 3 in the table [N m].")
    ] = -12.0,
    draws: Annotated[
        int,
        typer.Option(min=0, max=10_000_000, help="Monte Carlo over noise and doubts; 0 for none."),
    ] = 0,
    doubt_torque_percent: Annotated[
        float,
        typer.Option("--doubt-torque-constants", min=0.0, help="Each torque constant's 1 σ [%]."),
    ] = 0.0,
    doubt_links_percent: Annotated[
        float, typer.Option("--doubt-links", min=0.0, help="Each link parameter's 1 σ [%].")
    ] = 0.0,
    doubt_rotors_percent: Annotated[
        float, typer.Option("--doubt-rotors", min=0.0, help="Each rotor inertia's 1 σ [%].")
    ] = 0.0,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the draws.")] = 0,
    scheduler: Annotated[
        str | None,
        typer.Option(metavar="ADDRESS", help="A Dask scheduler to compute on, as tcp://host:8786."),
    ] = None,
    output: Annotated[
        Path | None, typer.Option("--output", "-o", metavar="CSV", help="The table as CSV.")
    ] = None,
    overwrite: Overwrite = False,
    as_json: AsJson = False,
) -> None:
    """Tell what wrong torque constants, links, rotors, coupling or gears do to a payload.

    Each row simulates the robot with one thing different from what is assumed, estimates the
    payload as if all were right, and gives the deviation in percent of the true value. With
    --draws, noise and doubts are drawn by chance, on all cores or on a Dask cluster.
    """
    console = Console(as_json)
    refuse_output(output, overwrite)
    if not draws:
        doubts = {"doubt_torque_percent", "doubt_links_percent", "doubt_rotors_percent"}
        refuse_inapplicable(context, doubts | {"seed", "scheduler"}, "without draws")
    problems = _problems(load_cell(cell), payload, model, motion)
    how: Comparison | None = None
    if against is not None:
        how = "model" if against is Against.MODEL else "difference"
    axes = len(problems["wrist"].robot.joints)
    cases = thesis_cases(axes, share_percent / 100.0, bias_nm)
    rows: list[SensitivityRow] = []
    with console.progress("Sensitivity", float(len(cases)), "cases") as shown:
        for done, case in enumerate(cases, start=1):
            rows.append(sensitivity_row(case, problems, how))
            shown.update(float(done), case.words)
    document: dict[str, object] = {
        "robot": problems["wrist"].robot.name,
        "parameters": list(REPORTED),
        "truth": [float(x) for x in problems["wrist"].payload.reported],
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
    _tell(console, rows)
    if output is not None:
        write_whole(output, _csv(rows).encode())
        console.say(f"Table: {output}")
    if draws:
        prior = PriorUncertainty(
            torque_constants=doubt_torque_percent / 100.0,
            links=doubt_links_percent / 100.0,
            rotors=doubt_rotors_percent / 100.0,
        )
        document["monte_carlo"] = _monte_carlo(
            console, problems["wrist"], prior, how or "model", draws, seed, scheduler
        )
    console.document(document)


def _problems(
    cell: LoadedCell, payload: str, model: Path | None, motion: str | None
) -> dict[Any, SensitivityProblem]:
    robot = cell.robot
    terms = RobotModel.from_description(robot)
    n = len(robot.joints)
    noise = np.ones(n)
    if model is not None:
        estimate = read_estimate(model)
        if estimate.model.parameter_names != terms.parameter_names:
            raise ConfigError(f"{model}: is of another robot than cell {cell.config.name}")
        parameters = consistent(estimate).standard_values
        noise = np.maximum(estimate.residual_nm, 1e-6)
    elif cell.plant is not None:
        parameters = true_parameters(terms, robot, cell.plant)
        noise = np.array([max(axis.torque_noise_nm, 1e-3) for axis in cell.plant.axes])
    else:
        raise ConfigError(
            f"cell {cell.config.name} is not simulated, so that its robot's true parameters are not"
            " known: give a model that was identified (--model)"
        )
    body = _body(cell, payload)
    wrist = list(range(2, n)) if n >= 6 else list(range(n))
    if motion is not None:
        given = _excitation(cell, motion)
        motions = {"wrist": given, "all": given}
    else:
        motions = {
            "wrist": thesis_motion(robot, wrist),
            "all": thesis_motion(robot, range(n)),
        }
    return {
        name: SensitivityProblem(robot, parameters, body, excitation, noise)
        for name, excitation in motions.items()
    }


def _body(cell: LoadedCell, payload: str) -> PayloadBody:
    known = {} if cell.plant is None else cell.plant.payloads
    if payload in known:
        body = known[payload]
        values = [body.mass_kg, *body.centre_m, *body.inertia_kg_m2]
        return PayloadBody.of_reported(np.array(values))
    if Path(payload).exists():
        return read_payload(Path(payload)).estimate.body
    names = ", ".join(known) or "none"
    raise ConfigError(
        f"--payload {payload}: neither a file nor a payload of cell {cell.config.name} ({names})"
    )


def _excitation(cell: LoadedCell, motion: str) -> Excitation:
    loaded = FourierMotion.require(
        load_motion(motion), f"--motion {motion}: sensitivity needs a periodic (fourier) motion"
    )
    trajectory = loaded.trajectory(cell.robot, cell.config.cycle_time_s)
    samples = trajectory.samples_per_period
    time_s: FloatArray = np.arange(samples, dtype=np.float64) * cell.config.cycle_time_s
    return Excitation(
        trajectory.position(time_s), trajectory.velocity(time_s), trajectory.acceleration(time_s)
    )


def _tell(console: Console, rows: list[SensitivityRow]) -> None:
    console.say(
        "Deviation in percent of the true value, inertia about the centre of gravity; less a model"
        " of the unloaded robot, or less a run (difference):"
    )
    console.table(
        ("", "wrong", "less", *REPORTED),
        [
            (
                str(row.case.number),
                row.case.words,
                row.against,
                *("–" if p is None else f"{round(p, 1) + 0.0:.1f}" for p in row.percent),
            )
            for row in rows
        ],
    )


def _csv(rows: list[SensitivityRow]) -> str:
    lines = [",".join(("row", "wrong", "less", *(f"{name}_percent" for name in REPORTED)))]
    for row in rows:
        cells = ("" if p is None else f"{p:.6g}" for p in row.percent)
        lines.append(",".join((str(row.case.number), f'"{row.case.words}"', row.against, *cells)))
    return "\n".join(lines) + "\n"


def _monte_carlo(
    console: Console,
    problem: SensitivityProblem,
    prior: PriorUncertainty,
    how: Comparison,
    draws: int,
    seed: int,
    scheduler: str | None,
) -> dict[str, object]:
    batches: list[Draws] = []
    with console.progress("Monte Carlo", float(draws), "draws") as shown:
        done = 0
        for batch in monte_carlo(problem, prior, how, draws, seed=seed, scheduler=scheduler):
            batches.append(batch)
            done += len(batch.values)
            shown.update(float(done), f"mass ± {2.0 * batch.values[:, 0].std():.2g} kg (2σ)")
    values = collected(batches)
    mean, sigma = values.mean(axis=0), values.std(axis=0, ddof=1)
    bias = deviation_percent(problem, mean)
    console.say(f"{draws} draws of noise and doubts:")
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
                REPORTED, REPORTED_UNITS, problem.payload.reported, bias, sigma, strict=True
            )
        ],
    )
    return {
        "draws": draws,
        "mean": [float(x) for x in mean],
        "std": [float(x) for x in sigma],
        "percentiles": {
            str(p): [float(x) for x in np.percentile(values, p, axis=0)] for p in (2.5, 50, 97.5)
        },
    }
