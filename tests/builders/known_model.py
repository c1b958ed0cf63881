"""The true parameters of a simulated arm in the form of an estimate."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np

from compensation.loops.loop_file import write_loops
from compensation.loops.velocity_loop import VelocityLoop
from config.load import LoadedCell, load_cell
from config.robot.friction_terms import FrictionTerm
from dynamics.geometry.kinematics import flange_pose
from dynamics.model.true_parameters import true_parameters
from identification.design.model import design_model
from identification.estimation.estimate import Estimate
from identification.estimation.file import write_estimate
from identification.model.base_parameters import ModelKind, base_parameters
from identification.model.options import ModelOptions
from identification.payload.body import parameters_to_parent
from tests.builders.certified import MEDIUM, write_payload_file


def known_estimate(cell: LoadedCell, deviations: dict[str, float]) -> Estimate:
    """Return a simulated arm's true parameters as an estimate.

    `deviations` contains factors for the standard deviations of some parameters, by name.
    """
    assert cell.plant is not None
    model = design_model(cell.robot)
    base = base_parameters(model)
    values = base.from_standard(true_parameters(model, cell.robot, cell.plant))
    sigma = 0.01 * np.abs(values) + 1e-3
    for name, worse in deviations.items():
        sigma[base.names.index(name)] *= worse
    return Estimate(
        robot=cell.robot,
        options=ModelOptions(),
        base=base,
        values=values,
        covariance_noise=None,
        covariance_residual=np.diag(sigma**2),
        covariance_jackknife=np.diag(sigma**2),
        condition_number=30.0,
        equations=600,
        residual_nm=np.resize([6.0, 6.0, 3.0], len(cell.robot.joints)),
        noise_nm=None,
        left_out_fraction=np.zeros(len(cell.robot.joints)),
        method="smoothed",
        band_hz=10.0,
        standstill_rad_s=0.02,
    )


def estimate_with_terms(
    cell: LoadedCell, terms: tuple[FrictionTerm, ...], size: float, nonlinear: float | None = None
) -> Estimate:
    """Return the true parameters of an arm with other friction terms.

    Args:
        cell: Cell of the arm.
        terms: Friction terms of all joints.
        size: Value of each parameter that the simulated arm does not have.
        nonlinear: Value of all nonlinear parameters; None for the default values.
    """
    true = known_estimate(cell, {})
    joints = tuple(joint.model_copy(update={"friction": terms}) for joint in cell.robot.joints)
    robot = cell.robot.model_copy(update={"joints": joints})
    names = ModelOptions().build(robot).nonlinear_names
    values = None if nonlinear is None else (nonlinear,) * len(names)
    options = ModelOptions(nonlinear=values)
    base = base_parameters(options.build(robot))
    given = dict(zip(true.base.names, true.values, strict=True))
    found = np.array([given.get(name, size) for name in base.names])
    covariance = np.diag((0.01 * np.abs(found) + 1e-3) ** 2)
    return replace(
        true,
        robot=robot,
        options=options,
        base=base,
        values=found,
        covariance_residual=covariance,
        covariance_jackknife=covariance,
        nonlinear_covariance=np.diag(np.full(len(names), 1e-4)),
    )


def with_payload_columns(alone: Estimate, kind: ModelKind = "internal") -> Estimate:
    """Return an estimate with a payload's parameters, as `identify --loaded` makes it."""
    options = replace(alone.options, payload=True, kind=kind)
    base = base_parameters(options.build(alone.robot), kind=kind)
    standard = dict(zip(alone.model.parameter_names, alone.standard_values, strict=True))
    body = parameters_to_parent(flange_pose(alone.robot)) @ MEDIUM.parameters
    loads = [name for name in base.standard_names if name not in standard]
    standard |= dict(zip(loads, body, strict=True))
    draw = np.random.default_rng(3).normal(size=(len(base), len(base)))
    covariance = 1e-4 * draw @ draw.T
    return replace(
        alone,
        options=options,
        base=base,
        values=base.from_standard(np.array([standard[name] for name in base.standard_names])),
        covariance_noise=0.5 * covariance,
        covariance_residual=0.8 * covariance,
        covariance_jackknife=covariance,
    )


def joint_path(*poses: list[float]) -> str:
    """Return a motion file of `ir361`: a curve through poses [rad] with `speed_fraction` 0.3."""
    rows = "".join(f"- {pose}\n" for pose in poses)
    return f"kind: joint_path\nrobot: ir361\nspeed_fraction: 0.3\npoints:\n{rows}"


def write_path_files(folder: Path, path: str) -> None:
    """Write the files with which a path of `ir361` is compensated.

    `alone.json` and `both.json` are models without and with payload columns; the other files are
    `loops.json`, `path.yaml` (the text `path`) and `payload.json`.
    """
    cell = load_cell("ir361")
    alone = known_estimate(cell, {})
    write_estimate(folder / "alone.json", alone)
    write_estimate(folder / "both.json", with_payload_columns(alone))
    loops = [
        VelocityLoop(name, 900.0, 0.08, 0.0, 0.002, ("gain",), np.eye(1), 1.0, ())
        for name in cell.robot.joint_names
    ]
    write_loops(folder / "loops.json", loops, "ir361", "a run")
    (folder / "path.yaml").write_text(path)
    write_payload_file(folder / "payload.json", MEDIUM.parameters)
