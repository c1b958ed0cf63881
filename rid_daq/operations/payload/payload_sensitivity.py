"""`payload_sensitivity`: errors of a payload estimate by wrong assumptions and random draws."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from acquisition.motion.kinds.fourier import FourierMotion
from acquisition.motion.motion_file import load_motion
from config.arrays import FloatArray
from config.errors import ConfigError
from config.formats.whole_file import write_whole
from config.load import LoadedCell, load_cell
from dynamics.model.robot_model import RobotModel
from dynamics.model.true_parameters import true_parameters
from identification.choices import REPORTED
from identification.consistency.closest_robot import find_closest
from identification.payload.body import PayloadBody
from identification.payload.file import read_payload
from identification.sensitivity.cases import (
    Motion,
    SensitivityRow,
    sensitivity_row,
    thesis_cases,
    thesis_motion,
)
from identification.sensitivity.monte_carlo import (
    Draws,
    PriorUncertainty,
    join_batches,
    monte_carlo,
)
from identification.sensitivity.problem import (
    SampledMotion,
    SensitivityProblem,
    deviation_percent,
)
from rid_daq.operations.cell_files import read_estimate_for, rejection_notes
from rid_daq.operations.identify.sensitivity import SensitivityRequest
from rid_daq.operations.operation import Context
from rid_daq.runs import made_file
from rid_daq.runs.output_file import refuse_output


@dataclass(frozen=True, eq=False)
class DrawnPayloads:
    """Payload estimates with random noise and random errors of the robot's parameters.

    Attributes:
        values: Shape (draws, 10). The estimates.
        off_percent: Shape (10,). Errors of the mean estimate, relative to the true values [%].
    """

    values: FloatArray
    off_percent: FloatArray


@dataclass(frozen=True)
class Sensitivity:
    """Errors of a payload estimate.

    Attributes:
        problem: Robot with payload, and a motion of the wrist's axes or the requested motion.
        rows: Errors of the estimate, one row for each wrong assumption.
        drawn: Estimates of the random draws; None without draws.
    """

    problem: SensitivityProblem
    rows: list[SensitivityRow]
    drawn: DrawnPayloads | None


def payload_sensitivity(request: SensitivityRequest, context: Context) -> Sensitivity:
    """Estimate the payload with each wrong assumption and with random draws, and write the table.

    Raises:
        ConfigError: The robot's true parameters are unknown, a file is of another robot or exists
            already, an option is invalid, or the scheduler cannot be reached.
        EstimationError: The motion does not determine all ten parameters.
        RecordingError: The table cannot be written.
    """
    if request.draws == 1:
        raise ConfigError(
            "--draws 1: one draw has no scatter; give 0, or at least 2", code="RID-OPTION-RANGE"
        )
    refuse_output(request.output, request.overwrite, made_file.TABLE)
    problems = _sensitivity_problems(load_cell(request.cell), request, context)
    problem = problems["wrist"]
    share = request.share_percent / 100.0
    cases = thesis_cases(len(problem.robot.joints), share, request.bias_nm)
    rows: list[SensitivityRow] = []
    with context.progress("Sensitivity", float(len(cases)), "cases") as shown:
        for done, case in enumerate(cases, start=1):
            rows.append(sensitivity_row(case, problems, request.against))
            shown.update(float(done), case.words)
    if request.output is not None:
        write_whole(request.output, _csv_table(rows).encode())
    drawn = _draw_payloads(request, problem, context) if request.draws else None
    return Sensitivity(problem, rows, drawn)


def _draw_payloads(
    request: SensitivityRequest, problem: SensitivityProblem, context: Context
) -> DrawnPayloads:
    """Estimate the payload with random noise and random errors of the robot's parameters."""
    prior = PriorUncertainty(
        torque_constants=request.doubt_torque_percent / 100.0,
        links=request.doubt_links_percent / 100.0,
        rotors=request.doubt_rotors_percent / 100.0,
    )
    batches: list[Draws] = []
    stream = monte_carlo(
        problem,
        prior,
        request.against or "model",
        request.draws,
        seed=request.seed,
        scheduler=request.scheduler,
    )
    with context.progress("Monte Carlo", float(request.draws), "draws") as shown:
        done = 0
        for batch in stream:
            batches.append(batch)
            done += len(batch.values)
            shown.update(float(done), f"mass ± {2.0 * batch.values[:, 0].std():.2g} kg (2σ)")
    values = join_batches(batches)
    return DrawnPayloads(values, deviation_percent(problem, values.mean(axis=0)))


def _sensitivity_problems(
    cell: LoadedCell, request: SensitivityRequest, context: Context
) -> dict[Motion, SensitivityProblem]:
    robot, model = cell.robot, request.model
    terms = RobotModel.from_description(robot)
    n = len(robot.joints)
    if model is not None:
        estimate = read_estimate_for(model, robot, despite_misfit=request.despite_misfit)
        for note in rejection_notes(model, estimate):
            context.say(f"note: {note}")
        model_terms = estimate.model
        if (model_terms.parameter_names, model_terms.nonlinear_names) != (
            terms.parameter_names,
            terms.nonlinear_names,
        ):
            raise ConfigError(
                f"{model}: the model has other terms than the robot file; identify again without"
                " options that change the terms",
                code="RID-MODEL-TERMS-DIFFER",
            )
        parameters = find_closest(estimate).standard_values
        noise = np.maximum(estimate.residual_nm, 1e-6)
    elif cell.plant is not None:
        parameters = true_parameters(terms, robot, cell.plant)
        noise = np.array([max(axis.torque_noise_nm, 1e-3) for axis in cell.plant.axes])
    else:
        raise ConfigError(
            f"cell {cell.config.name} is not simulated, so the true parameters of its robot are"
            " unknown: give an identified model (--model)",
            code="RID-CELL-NOT-SIMULATED",
        )
    body = _payload_body(cell, request.payload)
    if request.motion is not None:
        wrist = whole = _sampled_motion(cell, request.motion)
    else:
        wrist = thesis_motion(robot, range(2 if n >= 6 else 0, n))
        whole = thesis_motion(robot, range(n))
    return {
        "wrist": SensitivityProblem(robot, parameters, body, wrist, noise),
        "all": SensitivityProblem(robot, parameters, body, whole, noise),
    }


def _payload_body(cell: LoadedCell, payload: str) -> PayloadBody:
    known = {} if cell.plant is None else cell.plant.payloads
    if payload in known:
        body = known[payload]
        values = [body.mass_kg, *body.centre_m, *body.inertia_kg_m2]
        return PayloadBody.of_reported(np.array(values))
    if Path(payload).exists():
        return read_payload(Path(payload)).estimate.body
    names = ", ".join(known) or "none"
    raise ConfigError(
        f"--payload {payload}: this is neither a file nor a payload of cell {cell.config.name}"
        f" (its payloads: {names})",
        code="RID-OPTION-NAME",
    )


def _sampled_motion(cell: LoadedCell, motion: Path) -> SampledMotion:
    loaded = FourierMotion.require(
        load_motion(motion), f"--motion {motion}: sensitivity needs a periodic (fourier) motion"
    )
    trajectory = loaded.trajectory(cell.robot, cell.config.cycle_time_s)
    time_s = trajectory.sample_times_s
    return SampledMotion(
        trajectory.position(time_s), trajectory.velocity(time_s), trajectory.acceleration(time_s)
    )


def _csv_table(rows: list[SensitivityRow]) -> str:
    names = (*REPORTED, "torque")
    lines = [",".join(("row", "wrong", "less", *(f"{name}_percent" for name in names)))]
    for row in rows:
        percent = (*row.percent, row.worst_torque_percent)
        cells = ("" if p is None else f"{p:.6g}" for p in percent)
        lines.append(",".join((str(row.case.number), f'"{row.case.words}"', row.against, *cells)))
    return "\n".join(lines) + "\n"
