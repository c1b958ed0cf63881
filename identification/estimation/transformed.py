"""`transform`: an estimate whose standard parameters are a linear map of another estimate's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.estimation.estimate import Estimate
from identification.model.options import ModelOptions


def transform(
    estimate: Estimate, robot: RobotDescription, options: ModelOptions, matrix: FloatArray
) -> Estimate:
    """Return an estimate with other terms, and with the covariances that follow.

    The new base parameters are beta' = K' M theta, where theta are the standard parameters with the
    torques of `estimate`, M is `matrix` and K' is the combination of the new model.

    Args:
        estimate: The identified estimate.
        robot: The robot with the new terms.
        options: Options of the new model.
        matrix: Shape (p', p). Matrix from the standard parameters of the old model to those of the
            new one.
    """
    base = options.base_parameters(robot, estimate.still)
    heads = np.eye(len(estimate.base.standard_names))[list(estimate.base.kept)].T
    turned = base.combination @ matrix @ heads

    def spread(covariance: FloatArray) -> FloatArray:
        return np.asarray(turned @ covariance @ turned.T)

    noise = estimate.covariance_noise
    return replace(
        estimate,
        robot=robot,
        options=options,
        base=base,
        values=turned @ estimate.values,
        covariance_noise=None if noise is None else spread(noise),
        covariance_residual=spread(estimate.covariance_residual),
        covariance_jackknife=spread(estimate.covariance_jackknife),
    )


def with_rotors_in_links(estimate: Estimate) -> Estimate:
    """Return an estimate with the base parameters of lossless gears.

    The inertias of separate rotors (`ModelOptions.separate_rotors`) are added to those of the
    links. The result is for comparisons of parameters, and not for torques: its gears would
    transmit the torques of these rotors.
    """
    options = replace(estimate.options, separate_rotors=())
    if options == estimate.options:
        return estimate
    return transform(estimate, estimate.robot, options, np.eye(len(estimate.base.standard_names)))
