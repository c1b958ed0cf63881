"""`rid-daq sensitivity`: from a cell, a payload and a motion to the thesis's table and to draws."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.motion_file import load_motion
from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell
from dynamics.model.robot_model import RobotModel
from identification.choices import REPORTED
from identification.consistency.closest_robot import consistent
from identification.payload.body import PayloadBody
from identification.payload.file import read_payload
from identification.sensitivity.cases import (
    Motion,
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
from rid_daq.jobs.cell_files import estimate_for
from rid_daq.jobs.truth import true_parameters
from rid_daq.terminal.console import Console


@dataclass(frozen=True)
class SensitivityRequest:
    """What `rid-daq sensitivity` was asked for.

    Attributes
    ----------
    cell, payload : str
        A bundled name or a cell file; a payload of it by name, or a payload file.
    against : "model", "difference" or None
        How the robot is told from the payload; as each row says if None.
    model : Path or None
        The robot, where it is not simulated.
    motion : str or None
        A periodic motion; those of the thesis if None.
    share : float
        How wrong beliefs are.
    bias_nm : float
        Torque bias of axis 3 [N m].
    draws, seed : int
        Monte Carlo draws, and where they come from.
    prior : PriorUncertainty
        What is in doubt in them.
    scheduler : str or None
        Address of a Dask scheduler to compute on.
    output : Path or None
        Where the table is written as CSV.
    """

    cell: str
    payload: str
    against: Comparison | None = None
    model: Path | None = None
    motion: str | None = None
    share: float = 0.1
    bias_nm: float = -12.0
    draws: int = 0
    seed: int = 0
    prior: PriorUncertainty = field(default_factory=PriorUncertainty)
    scheduler: str | None = None
    output: Path | None = None


@dataclass(frozen=True)
class SensitivityTable:
    """The rows, and the robot that carries its payload with the axes of the wrist's side."""

    problem: SensitivityProblem
    rows: list[SensitivityRow]


@dataclass(frozen=True, eq=False)
class DrawnPayloads:
    """Estimates with noise and doubts: values (draws, 10), and off in the mean by (10,) [%]."""

    values: FloatArray
    off_percent: FloatArray


def sensitivity_table(request: SensitivityRequest, console: Console) -> SensitivityTable:
    """Estimate the payload with one thing after the other assumed wrongly, and write the table.

    Raises
    ------
    ConfigError
        The robot's true parameters are not known, or a file is of another robot.
    EstimationError
        The motion does not show all ten parameters.
    RecordingError
        The table cannot be written.
    """
    problems = _problems(load_cell(request.cell), request)
    problem = problems["wrist"]
    cases = thesis_cases(len(problem.robot.joints), request.share, request.bias_nm)
    rows: list[SensitivityRow] = []
    with console.progress("Sensitivity", float(len(cases)), "cases") as shown:
        for done, case in enumerate(cases, start=1):
            rows.append(sensitivity_row(case, problems, request.against))
            shown.update(float(done), case.words)
    if request.output is not None:
        write_whole(request.output, _csv(rows).encode())
    return SensitivityTable(problem, rows)


def draw_payloads(
    request: SensitivityRequest, problem: SensitivityProblem, console: Console
) -> DrawnPayloads:
    """Estimate the payload with noise and doubts drawn by chance.

    Raises
    ------
    ConfigError
        The scheduler cannot be reached, or Dask is not installed.
    """
    batches: list[Draws] = []
    stream = monte_carlo(
        problem,
        request.prior,
        request.against or "model",
        request.draws,
        seed=request.seed,
        scheduler=request.scheduler,
    )
    with console.progress("Monte Carlo", float(request.draws), "draws") as shown:
        done = 0
        for batch in stream:
            batches.append(batch)
            done += len(batch.values)
            shown.update(float(done), f"mass ± {2.0 * batch.values[:, 0].std():.2g} kg (2σ)")
    values = collected(batches)
    return DrawnPayloads(values, deviation_percent(problem, values.mean(axis=0)))


def _problems(cell: LoadedCell, request: SensitivityRequest) -> dict[Motion, SensitivityProblem]:
    robot, model = cell.robot, request.model
    terms = RobotModel.from_description(robot)
    n = len(robot.joints)
    if model is not None:
        estimate = estimate_for(model, robot)
        own = estimate.model
        if (own.parameter_names, own.nonlinear_names) != (
            terms.parameter_names,
            terms.nonlinear_names,
        ):
            raise ConfigError(
                f"{model}: has other terms than robot.yaml states; identify again without options"
                " that choose terms",
                code="RID-MODEL-TERMS-DIFFER",
            )
        parameters = consistent(estimate).standard_values
        noise = np.maximum(estimate.residual_nm, 1e-6)
    elif cell.plant is not None:
        parameters = true_parameters(terms, robot, cell.plant)
        noise = np.array([max(axis.torque_noise_nm, 1e-3) for axis in cell.plant.axes])
    else:
        raise ConfigError(
            f"cell {cell.config.name} is not simulated, so that its robot's true parameters are not"
            " known: give a model that was identified (--model)",
            code="RID-CELL-NOT-SIMULATED",
        )
    body = _body(cell, request.payload)
    if request.motion is not None:
        wrist = whole = _excitation(cell, request.motion)
    else:
        wrist = thesis_motion(robot, range(2 if n >= 6 else 0, n))
        whole = thesis_motion(robot, range(n))
    return {
        "wrist": SensitivityProblem(robot, parameters, body, wrist, noise),
        "all": SensitivityProblem(robot, parameters, body, whole, noise),
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
        f"--payload {payload}: neither a file nor a payload of cell {cell.config.name} ({names})",
        code="RID-OPTION-NAME",
    )


def _excitation(cell: LoadedCell, motion: str) -> Excitation:
    loaded = FourierMotion.require(
        load_motion(motion), f"--motion {motion}: sensitivity needs a periodic (fourier) motion"
    )
    trajectory = loaded.trajectory(cell.robot, cell.config.cycle_time_s)
    time_s = trajectory.sample_times_s
    return Excitation(
        trajectory.position(time_s), trajectory.velocity(time_s), trajectory.acceleration(time_s)
    )


def _csv(rows: list[SensitivityRow]) -> str:
    lines = [",".join(("row", "wrong", "less", *(f"{name}_percent" for name in REPORTED)))]
    for row in rows:
        cells = ("" if p is None else f"{p:.6g}" for p in row.percent)
        lines.append(",".join((str(row.case.number), f'"{row.case.words}"', row.against, *cells)))
    return "\n".join(lines) + "\n"
