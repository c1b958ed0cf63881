"""`carry`, `carry_own`, `carry_bodies`, `without_payload`: models with and without a payload.

The parameters of the last link contain a payload that the robot always carries: its ten parameters
are added to those of the link (5.6). Known bodies are added to the link that carries them.
Therefore everything that uses an `Estimate` also works with a payload.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from config.errors import ConfigError, EstimationError
from dynamics.geometry.kinematics import flange_pose
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.estimation.estimate import Estimate
from identification.estimation.transformed import transform
from identification.model.known_loads import Bodies, values_of_bodies
from identification.payload.body import parameters_to_parent
from identification.payload.estimate import PayloadEstimate


def contains_payload(estimate: Estimate) -> bool:
    """Return True if an estimate has parameters of a payload in addition to those of the robot."""
    return estimate.options.payload


def without_payload(estimate: Estimate) -> Estimate:
    """Return an estimate of the robot alone, without the parameters of a payload."""
    return _without_columns(estimate, carries=False) if contains_payload(estimate) else estimate


def carry_own(estimate: Estimate) -> Estimate:
    """Return an estimate of the robot with the payload that was identified together with it.

    Raises:
        ConfigError: The estimate contains no payload.
    """
    if not contains_payload(estimate):
        raise ConfigError(
            "the model contains no payload, because it was identified without --loaded: give a"
            " payload file, or none",
            code="RID-PAYLOAD-UNSTATED",
        )
    return _without_columns(estimate, carries=True)


def carry(estimate: Estimate, payload: PayloadEstimate) -> Estimate:
    """Return an estimate of the robot with a payload that was identified separately.

    The errors of the two count as independent: the covariance of the payload is added. The runs of
    the payload count as runs of the result, so that the result is not validated with these runs.

    Args:
        estimate: The robot; a payload that was identified together with it is replaced.
        payload: The payload, in the tool frame of the robot file with which it was identified; the
            motion must have determined all ten parameters.

    Raises:
        EstimationError: A parameter of the payload is not determined.
    """
    estimate = without_payload(estimate)
    hidden = payload.is_parameter_determined.count(False)
    if hidden:
        raise EstimationError(
            f"the motion did not determine {hidden} of the payload's ten parameters: identify the"
            " payload with a motion that determines all",
            code="RID-MOTION-UNINFORMATIVE",
        )
    at_flange = parameters_to_parent(flange_pose(payload.robot))
    turned = estimate.base.combination[:, _last_link(estimate)] @ at_flange
    more = turned @ payload.covariance @ turned.T
    return replace(
        estimate.add_covariance(more),
        values=estimate.values + turned @ payload.values,
        run_ids=tuple(dict.fromkeys((*estimate.run_ids, *payload.run_ids))),
    )


def carry_bodies(estimate: Estimate, bodies: Bodies) -> Estimate:
    """Return an estimate of the robot with known bodies, which may be on any link.

    The covariance contains the uncertainty of each mass, but not that of centre and inertia.

    Args:
        estimate: The robot; a payload that was identified together with it is replaced.
        bodies: The bodies.
    """
    estimate = without_payload(estimate)
    values = values_of_bodies(estimate.model, estimate.base, bodies)
    more = np.zeros_like(estimate.covariance_residual)
    for name, body in bodies.items():
        heavier = body.model_copy(update={"mass_kg": body.mass_kg + body.mass_sigma_kg})
        changed = (
            values_of_bodies(estimate.model, estimate.base, {**bodies, name: heavier}) - values
        )
        more += np.outer(changed, changed)
    return replace(estimate.add_covariance(more), values=estimate.values + values)


def _without_columns(estimate: Estimate, *, carries: bool) -> Estimate:
    """Return an estimate without payload parameters.

    With `carries`, the payload's parameters are added to those of the last link.
    """
    options = replace(estimate.options, payload=False)
    new = options.build(estimate.robot).parameter_names
    names = estimate.model.parameter_names
    matrix = np.zeros((len(new), len(names)))
    for row, name in enumerate(new):
        matrix[row, names.index(name)] = 1.0
    if carries:
        matrix[_last_link(estimate), estimate.model.parameter_groups["payload"]] = np.eye(
            PARAMETERS_PER_LINK
        )
    return transform(estimate, estimate.robot, options, matrix)


def _last_link(estimate: Estimate) -> slice:
    """Return the position of the last link's ten parameters among the standard parameters."""
    end = estimate.model.parameter_groups["rigid_body"].stop
    return slice(end - PARAMETERS_PER_LINK, end)
