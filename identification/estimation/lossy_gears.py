"""`separate_rotors`: an estimate in which gear losses separate rotors from links.

A gear transmits the torque of the links, but not that which accelerates its own rotor. In the
torques of lossless gears, the inertia of a rotor and that of the links on the first joints of most
robots cannot be distinguished, because both accelerate with the joint. The loss of a gear depends
on the transmitted torque alone. Therefore, if the loss shows the rotor's inertia clearly, this
inertia is a base parameter of its own. Otherwise, the loss would follow the torque of links and
rotor, and Coulomb friction and loss would be wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, TypeVar

from config.arrays import FloatArray
from dynamics.model.robot_model import RobotModel
from identification.model.base_parameters import BaseParameters, base_parameters, rotor_names
from identification.model.options import ModelOptions
from identification.model.still_joints import StillJoint

DISTINCT_SIGMAS: Final = 5.0
"""A loss or an inertia is distinct if it is larger than this number of standard deviations."""

Fit = TypeVar("Fit")
Refit = Callable[[BaseParameters], tuple[Fit, FloatArray, FloatArray]]
"""Function that fits other base parameters, and returns the fit, their values, and their standard
deviations, each of shape (b,)."""


def separate_rotors(
    model: RobotModel,
    base: BaseParameters,
    nonlinear_sigma: FloatArray,
    refit: Refit[Fit],
    *,
    options: ModelOptions,
    still: Sequence[StillJoint],
) -> Fit | None:
    """Return the fit with separate rotors; None if no loss shows the inertia of its rotor.

    Args:
        model: The model with the fitted losses.
        base: The base parameters of lossless gears.
        nonlinear_sigma: Shape (s,). Standard deviations of `model.nonlinear_values`.
        refit: Function that fits other base parameters.
        options: The terms of the model. `separate_rotors` states the joints, if it is given.
        still: As for `base_parameters`.
    """
    stated = options.separate_rotors
    if stated is not None:
        separate = base_parameters(model, kind=options.kind, still=still, lossy=stated)
        return None if separate.names == base.names else refit(separate)[0]
    losses = model.transmission.losses
    sigmas = nonlinear_sigma[len(nonlinear_sigma) - len(losses) :]
    lossy = [
        loss.joint
        for loss, sigma in zip(losses, sigmas, strict=True)
        if loss.size > DISTINCT_SIGMAS * sigma
    ]
    while lossy:
        separate = base_parameters(model, kind=options.kind, still=still, lossy=lossy)
        new = [name for name in separate.names if name not in base.names]
        added = {
            j: separate.names.index(name) for j in lossy for name in new if name in rotor_names(j)
        }
        if not added:
            return None
        fit, values, sigma = refit(separate)
        distinct = [j for j, at in added.items() if values[at] > DISTINCT_SIGMAS * sigma[at]]
        if len(distinct) == len(added):
            return fit
        lossy = distinct
    return None
