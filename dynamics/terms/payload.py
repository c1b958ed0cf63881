"""`Payload`: the term of an unknown payload on the last link."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray
from dynamics.geometry.kinematics import Chain
from dynamics.terms.motion import TermMotion
from dynamics.terms.rigid_body import SYMBOLS, UNITS, fill_links, links_gradient


@dataclass(frozen=True, eq=False)
class Payload:
    """Ten inertial parameters of a payload, in the frame of the last link (5.6).

    The parameters are the mass `mL`, the first moments `sxL`, `syL`, `szL`, and the inertia about
    the frame's origin, `IxxL` to `IzzL`. The payload acts only if `Conditions.payload` is True. The
    payload can be distinguished from the last link if there are runs with and without payload.
    """

    chain: Chain

    through_gears = True
    inertial = True
    name = "payload"

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Names of the ten parameters."""
        return tuple(f"{symbol}L" for symbol in SYMBOLS)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Units of the parameters, in the order of `parameter_names`."""
        return UNITS

    def fill_torque(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the torque columns into `out`, (samples, n, 10)."""
        if motion.conditions.payload:
            fill_links(self.chain, motion, self.chain.n - 1, False, out)
            motion.to_actuators(out)

    def fill_base_wrench(self, motion: TermMotion, out: FloatArray) -> None:
        """Compute the base wrench columns into `out`, (samples, 6, 10)."""
        if motion.conditions.payload:
            fill_links(self.chain, motion, self.chain.n - 1, True, out)

    def torque_gradient(self, motion: TermMotion, weights: FloatArray) -> FloatArray:
        """Return the gradient of weighted sums of torque columns by the motion; see `Term`."""
        if not motion.conditions.payload:
            return np.zeros((len(weights), *motion.joint.shape))
        return links_gradient(self.chain, motion, self.chain.n - 1, weights)
