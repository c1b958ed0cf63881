"""The true parameters of a simulated arm as a model that somebody identified."""

from __future__ import annotations

import numpy as np

from config.load import LoadedCell
from identification.design.model import design_model
from identification.estimation.estimate import Estimate
from identification.model.base_parameters import base_parameters
from identification.model.options import ModelOptions
from rid_daq.jobs.truth import true_parameters


def known(cell: LoadedCell, deviations: dict[str, float]) -> Estimate:
    """Return a simulated arm's true values as an estimate, some known worse than by 1 %."""
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
        residual_nm=np.array([6.0, 6.0, 3.0]),
        noise_nm=None,
        left_out_fraction=np.zeros(3),
        method="smoothed",
        band_hz=10.0,
        standstill_rad_s=0.02,
    )
