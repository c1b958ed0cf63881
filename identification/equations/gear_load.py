"""`with_gear_load`: the torque that each gear transmits, for load-dependent friction.

A gear transmits the torque of the links, and not that which accelerates its own rotor. The torques
of lossless gears do not separate the inertia of a rotor from that of the links on the first joints
of most robots: both accelerate with the joint. But the load-dependent friction of a joint depends
on the links' torque alone. Therefore the rotor's inertia is estimated from this friction.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

import numpy as np

from acquisition.processing.torque_channel import TorqueChannel
from config.arrays import FloatArray, IntArray
from identification.equations.block_grams import Grams, Terms, columns_of_terms
from identification.equations.candidate_equations import CandidateEquations, reaches_of
from identification.model.base_parameters import BaseParameters
from identification.regression.nested_choice import Gain

STEPS: Final = 20
"""Number of steps in which a rotor's inertia is tried, from none to all of the joint's inertia."""
DEPENDENT: Final = 1e-7
"""A column counts as dependent if it is smaller than this fraction of the largest one, both
relative to their lengths."""


def with_gear_load(
    equations: CandidateEquations,
    grams: Grams,
    terms: Sequence[Terms],
    channel: TorqueChannel,
    block_s: float,
) -> CandidateEquations:
    """Return the equations with the gears' load computed from a fit.

    Args:
        equations: The equations.
        grams: Their Gram matrices.
        terms: Friction terms of each joint in the fit. A rotor's inertia that is not identified
            otherwise is estimated for joints with load-dependent friction, and counts as zero for
            the others.
        channel: The torque channel.
        block_s: Length of a block of the held-out errors [s].
    """
    fit, base = grams.fit(terms), equations.base
    values = np.zeros(len(base))
    values[grams.rigid] = fit.values[: len(grams.rigid)]
    values[[_joint_of_rotor(name) is not None for name in base.names]] = 0.0
    equations = equations.with_gear_load(values)
    for j, combination in _merged_rotors(base):
        if "load" in terms[j]:
            inertia = _inertia(equations, values, (j, combination), terms[j], channel, block_s)
            values = values - inertia * combination
            equations = equations.with_gear_load(values)
    return equations


def _joint_of_rotor(name: str) -> int | None:
    """Return the joint, from 0, whose rotor a parameter describes; None for other parameters."""
    return int(name[2:]) - 1 if name.startswith(("Ia", "Im")) else None


def _merged_rotors(base: BaseParameters) -> Iterator[tuple[int, FloatArray]]:
    """Yield the joint of each rotor that lossless gears do not identify, and its combination.

    The combination, shape (b,), contains the base parameters of a unit of the rotor's inertia.
    """
    for name, combination in zip(base.standard_names, base.combination.T, strict=True):
        j = _joint_of_rotor(name)
        if j is not None and name not in base.names and np.any(combination):
            yield j, combination


def _inertia(
    equations: CandidateEquations,
    values: FloatArray,
    rotor: tuple[int, FloatArray],
    terms: Terms,
    channel: TorqueChannel,
    block_s: float,
) -> float:
    """Return the rotor inertia with which the load explains a joint's friction best.

    The result is zero if this inertia does not explain the joint's torque distinctly better.

    Args:
        equations: The equations, with the load of `values`.
        values: Shape (b,). Base parameters of the links; those of `rotor` are part of them.
        rotor: The rotor's joint, and its combination as of `_merged_rotors`.
    """
    j, combination = rotor
    head = int(np.argmax(np.abs(combination)))
    largest = max(float(values[head] / combination[head]), 0.0)
    responses = [channel.response(piece.frequency_hz)[:, j] for piece in equations.pieces]
    reach = reaches_of(channel)[j]
    others = [column for column in columns_of_terms(terms) if column != "load"]
    rows = equations.rows(j, [*others, "load"], responses, reach, block_s)
    basis = _basis(rows.columns[:, :-1])
    torque = _without(basis, rows.torque_nm)
    tried = np.linspace(0.0, largest, STEPS + 1)
    rests = []
    for inertia in tried:
        loaded = equations.with_gear_load(values - inertia * combination)
        load = loaded.rows(j, ("load",), responses, reach, block_s).columns[:, -1]
        load = _without(basis, load)
        size = float(load @ load)
        rests.append(torque - max(float(load @ torque), 0.0) / max(size, 1e-300) * load)
    best = int(np.argmin([float(rest @ rest) for rest in rests]))
    none, found = (_mean_squares(rests[k], rows.block) for k in (0, best))
    return float(tried[best]) if Gain.between(none, found).exceeds() else 0.0


def _basis(columns: FloatArray) -> FloatArray:
    """Return orthonormal columns that span the independent ones of `columns`."""
    size = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    left, singular, _ = np.linalg.svd(columns / size, full_matrices=False)
    return np.asarray(left[:, singular > DEPENDENT * singular[0]])


def _without(basis: FloatArray, rows: FloatArray) -> FloatArray:
    """Return rows without their projection on a basis."""
    return np.asarray(rows - basis @ (basis.T @ rows))


def _mean_squares(rows: FloatArray, block: IntArray) -> FloatArray:
    """Return the mean square of each block's rows; NaN for a block without rows."""
    count = np.bincount(block)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.bincount(block, rows**2) / count)
