"""`RigidBodies`: the term of the links' masses, first moments and inertias."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray, IntArray
from config.errors import EstimationError
from dynamics.geometry.kinematics import Chain
from dynamics.kernels.gradients import pull_back, weights_of
from dynamics.kernels.rigid_body import RotorArrays, fill_rigid_body
from dynamics.kernels.threads import run_in_ranges
from dynamics.terms.motion import TermMotion

PARAMETERS_PER_LINK: Final = 10
SYMBOLS: Final = ("m", "sx", "sy", "sz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
UNITS: Final = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)
_NO_INDEX: Final[IntArray] = np.empty(0, dtype=np.int64)
_NO_ROTORS: Final = (_NO_INDEX, _NO_INDEX, np.empty((0, 3)), np.empty(0))
for _none in _NO_ROTORS:
    _none.setflags(write=False)  # read-only as in `Rotors`, so that one compiled kernel serves both


@dataclass(frozen=True, eq=False)
class RigidBodies:
    """Inertial and gravitational loads of the links (theory: section 2).

    Link i has, in frame i of `Chain`: mass `m{i}`, first moment `sx{i} sy{i} sz{i}` = m c, and the
    inertia about the frame's origin `Ixx{i} Ixy{i} Ixz{i} Iyy{i} Iyz{i} Izz{i}`. These are the
    elements of the inertia matrix, so that Ixy = -integral of x y dm.
    """

    chain: Chain

    through_gears = True
    inertial = True
    name = "rigid_body"

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the parameters: ten per link, link by link."""
        return tuple(f"{s}{link}" for link in range(1, self.chain.n + 1) for s in SYMBOLS)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the parameters, in the order of `parameter_names`."""
        return UNITS * self.chain.n

    def fill_torque(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the torque columns into `out`, (samples, n, 10 n)."""
        fill_links(self.chain, motion, 0, False, out)
        motion.to_actuators(out)

    def fill_base_wrench(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the base wrench columns into `out`, (samples, 6, 10 n)."""
        fill_links(self.chain, motion, 0, True, out)

    def torque_gradient(self, motion: TermMotion, weights: FloatArray) -> FloatArray:
        """Return the gradient of weighted sums of torque columns by the motion; see `Term`."""
        return links_gradient(self.chain, motion, 0, weights)


def fill_links(
    chain: Chain, motion: TermMotion, first_link: int, of_base: bool, out: FloatArray
) -> None:
    """Compute the columns of the links from `first_link` (from 0) on.

    Args:
        chain: The arm.
        first_link: The first link that has columns.
        of_base: True if the rows are the six components of the base wrench; False if they are the n
            joint torques.
        out: Shape (samples, 6 or n, 10 (n - first_link)). Every element is written, including
            zeros. The columns must be neighbours in memory.

    Raises:
        EstimationError: `out` has another shape, type or memory order, so that the kernel would
            write outside the array.
    """
    _, samples, n = motion.joint.shape
    expected = (samples, 6 if of_base else n, PARAMETERS_PER_LINK * (n - first_link))
    if out.shape != expected or out.dtype != np.float64 or not out[:1, :1].flags.c_contiguous:
        raise EstimationError(
            f"the links' columns need an array of floats of the shape {expected} whose last axis"
            f" is contiguous, got {out.shape} of {out.dtype} with strides {out.strides}",
            code="RID-API-ARGUMENT",
        )

    def fill(first: int, last: int) -> None:
        fill_rigid_body(chain.arrays, motion.joint, of_base, first_link, out, first, last)

    run_in_ranges(len(out), fill)


def links_gradient(
    chain: Chain, motion: TermMotion, first_link: int, weights: FloatArray
) -> FloatArray:
    """Return the gradient of weighted sums of the links' columns by the motion of the joints.

    Args:
        chain, motion, first_link: As for `fill_links`.
        weights: Shape (sums, samples, n, 10 (n - first_link)). Weights of the columns, with one row
            per actuator.

    Returns:
        Shape (sums, 3, samples, n). Derivatives of each sum by q, v and a of the joints.
    """
    out = np.zeros((len(weights), *motion.joint.shape))
    no_rotors: RotorArrays = (*_NO_ROTORS, np.eye(chain.n))
    weights = weights_of(motion.to_joints(weights))
    unweighted = np.broadcast_to(0.0, (*weights.shape[:3], 1))

    def pull(first: int, last: int) -> None:
        pull_back(
            chain.arrays,
            no_rotors,
            (motion.joint, motion.actuator),
            first_link,
            (weights, unweighted),
            (out, out),
            first,
            last,
        )

    run_in_ranges(motion.joint.shape[1], pull)
    return out
