"""A known model with temperature-dependent friction, with or without measured temperatures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from config.load import LoadedCell
from identification.equations.warming import Warming
from identification.estimation.estimate import Estimate
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions
from tests.builders.known_model import known_estimate

FALL = 0.002
"""Relative decrease of friction per kelvin, or per watt."""


def by_temperature(cell: LoadedCell, *, measured: bool) -> Estimate:
    """Return a simulated arm's true values; the friction of two axes decreases with temperature.

    Without measured temperatures, the time constant of warming is 60 s for axis 1 and 90 s for axis
    2.
    """
    estimate = known_estimate(cell, {})
    joints = tuple(
        joint.model_copy(update={"friction": (*joint.friction, "temperature")} if j < 2 else {})
        for j, joint in enumerate(cell.robot.joints)
    )
    robot = cell.robot.model_copy(update={"joints": joints})
    options = ModelOptions()
    base = base_parameters(options.build(robot))
    plain = dict(zip(estimate.base.names, estimate.values.tolist(), strict=True))
    falls = {
        name: -FALL * plain[name.replace("fcT", "fc").replace("fvT", "fv")]
        for name in base.names
        if name not in plain
    }
    values = np.array([(plain | falls)[name] for name in base.names])
    covariance = np.diag((0.01 * np.abs(values) + 1e-5) ** 2)
    coulomb = [plain[f"fc_{joint.name}"] for joint in joints]
    viscous = [plain[f"fv_{joint.name}"] for joint in joints]
    warms = np.array([True, True, False])
    warming = Warming(
        time_constant_s=np.array([60.0, 90.0, 0.0]),
        time_constant_sigma_s=np.array([5.0, 5.0, 0.0]),
        coulomb_nm=np.array(coulomb) * warms,
        viscous_nm_s=np.array(viscous) * warms,
    )
    return replace(
        estimate,
        robot=robot,
        options=options,
        base=base,
        values=values,
        covariance_residual=covariance,
        covariance_jackknife=covariance,
        warming=None if measured else warming,
    )
