"""`RigidBodies`: the term of the links' masses, first moments and inertias."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from dynamics.kernels import fill_rigid_body
from dynamics.kinematics import Chain, FloatArray
from dynamics.motion import Motion

PARAMETERS_PER_LINK: Final = 10
SYMBOLS: Final = ("m", "sx", "sy", "sz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
UNITS: Final = ("kg", *("kg m",) * 3, *("kg m^2",) * 6)


@dataclass(frozen=True, eq=False)
class RigidBodies:
    """Inertial and gravitational loads of the links (physics: section 2).

    Link i has, in frame i of `Chain`: mass `m{i}`, first moment `sx{i} sy{i} sz{i}` = m c, and the
    inertia about the frame's origin `Ixx{i} Ixy{i} Ixz{i} Iyy{i} Iyz{i} Izz{i}`, elements of the
    inertia matrix (so Ixy = -integral of x y dm).
    """

    chain: Chain

    through_gears = True
    name = "rigid_body"

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Ten names a link, link by link."""
        return tuple(f"{s}{link}" for link in range(1, self.chain.n + 1) for s in SYMBOLS)

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """The units, in the order of the names."""
        return UNITS * self.chain.n

    def fill_torque(self, motion: Motion, out: FloatArray) -> None:
        """Fill `out`, (samples, n, 10 n)."""
        self._fill(motion, False, out)
        motion.to_actuators(out)

    def fill_base_wrench(self, motion: Motion, out: FloatArray) -> None:
        """Fill `out`, (samples, 6, 10 n)."""
        self._fill(motion, True, out)

    def _fill(self, motion: Motion, of_base: bool, out: FloatArray) -> None:
        c = self.chain
        fill_rigid_body(
            c.rows, c.fixed_rotations, c.prismatic, c.gravity_m_s2, motion.joint, of_base, out
        )
