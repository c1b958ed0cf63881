"""`first_gears`: parameters from which the fit of elastic gears starts.

The base parameters are those of the arm with rigid gears. Stiffness and motor inertia are found by
a scan, axis by axis, because the fit of resonances has many minima.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from acquisition.processing.periods import PeriodAverage
from config.arrays import FloatArray
from config.robot.robot import RobotDescription
from identification.elasticity.elastic_arm import ElasticArm
from identification.elasticity.elastic_problem import LOSS_S, ElasticProblem
from identification.elasticity.elastic_runs import ExcitationBins, MultisineBins
from identification.elasticity.link_motion import Gears
from identification.estimation.fitted_periods import fit_periodic
from identification.estimation.options import EstimationOptions

RESONANCES_HZ: Final = np.geomspace(3.0, 200.0, 45)
ROTOR_SHARES: Final = np.linspace(0.03, 0.93, 31)
ROTOR_FACTORS: Final = (0.6, 0.8, 0.9, 1.0, 1.1, 1.25, 1.6)
SWEEPS: Final = 2


def first_gears(
    robot: RobotDescription,
    arm: ElasticArm,
    averages: Sequence[PeriodAverage],
    excitations: Sequence[ExcitationBins],
    multisines: Sequence[MultisineBins],
) -> Gears:
    """Return parameters that are close enough to the solution to start the fit.

    Raises:
        EstimationError: The excitation runs do not determine the arm with rigid gears.
    """
    fitted = fit_periodic(robot, averages, EstimationOptions())
    values, base = fitted.fit.solution.values[fitted.fit.of_base], fitted.base
    names = base.standard_names
    inertia = [f"Im{j + 1}" if f"Im{j + 1}" in names else f"Ia{j + 1}" for j in range(arm.n)]

    def split(rotor: FloatArray) -> FloatArray:
        """Return the parameters of the links if the motors have the inertias `rotor`."""
        columns = [(j, names.index(name)) for j, name in enumerate(inertia) if name in names]
        rest = values - sum(base.combination[:, column] * rotor[j] for j, column in columns)
        standard = base.to_standard(rest)
        return arm.base.from_standard(
            np.array([standard[names.index(name)] for name in arm.base.standard_names])
        )

    total = _inertias(arm, multisines, split(np.zeros(arm.n)))
    known = np.array(
        [values[base.names.index(name)] if name in base.names else 0.0 for name in inertia]
    )
    rotor = np.where(known > 0.0, known, 0.2 * total / arm.reflected)
    choices = [
        [own * factor for factor in ROTOR_FACTORS]
        if own > 0.0
        else [share * total[j] / arm.reflected[j] for share in ROTOR_SHARES]
        for j, own in enumerate(known.tolist())
    ]
    link = np.maximum(_inertias(arm, multisines, split(rotor)), 0.05 * total)
    stiffness = link * (2.0 * math.pi * RESONANCES_HZ[len(RESONANCES_HZ) // 2]) ** 2
    guess = Gears(stiffness, LOSS_S * stiffness, rotor, split(rotor))
    problem = ElasticProblem.of(arm, excitations, multisines, guess)
    for _ in range(SWEEPS):
        for j in range(arm.n):
            best = (math.inf, stiffness[j], rotor[j])
            for inertia_j in choices[j]:
                tried = rotor.copy()
                tried[j] = inertia_j
                body = split(tried)
                own = max(float(_inertias(arm, multisines, body)[j]), 0.05 * float(total[j]))
                tries = own * (2.0 * math.pi * RESONANCES_HZ) ** 2
                gears = Gears(stiffness, LOSS_S * stiffness, tried, body)
                mismatch = problem.multisine_mismatch(gears, j, tries)
                at = int(np.argmin(mismatch))
                best = min(best, (float(mismatch[at]), float(tries[at]), float(inertia_j)))
            _, stiffness[j], rotor[j] = best
    return Gears(stiffness, LOSS_S * stiffness, rotor, split(rotor))


def _inertias(arm: ElasticArm, multisines: Sequence[MultisineBins], body: FloatArray) -> FloatArray:
    """Return the links' inertia about each joint at the multisines' poses, (n,)."""
    return np.asarray(np.mean([np.diagonal(run.small.mass @ body) for run in multisines], axis=0))
