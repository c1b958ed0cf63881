"""Guessed masses for links without mass: cylinders along the arm, for planning motions.

The density is that of castings, motors and air together; the radius is a fraction of the arm's
length.
"""

from __future__ import annotations

from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.robot.link_cad import LinkCad

DENSITY_KG_M3: Final = 2000.0
SLENDERNESS: Final = 25.0


def nominal_links(rows: FloatArray, tool_m: FloatArray) -> tuple[LinkCad, ...]:
    """Return a solid cylinder for each link, from the middle of its offset d to the next axis.

    Args:
        rows: Shape (n, 5). alpha [rad], beta [rad], theta [rad], a [m], d [m] of every joint,
            modified convention.
        tool_m: Shape (3,). Tool point in the last frame.

    """
    lengths = np.abs(rows[:, 3:5]).sum() + float(np.linalg.norm(tool_m))
    radius = max(lengths, 0.1) / SLENDERNESS
    ends = [np.array([a, 0.0, 0.0]) for a in rows[1:, 3]] + [tool_m]
    links: list[LinkCad] = []
    for d, end in zip(rows[:, 4], ends, strict=True):
        start = np.array([0.0, 0.0, -0.5 * d])
        along = end - start
        length = float(np.linalg.norm(along))
        axis = along / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
        length += 2.0 * radius
        mass = DENSITY_KG_M3 * np.pi * radius**2 * length
        spin, turn = mass * radius**2 / 2.0, mass * (radius**2 / 4.0 + length**2 / 12.0)
        inertia = turn * np.eye(3) + (spin - turn) * np.outer(axis, axis)
        x, y, z = (0.5 * (start + end)).tolist()
        xx, xy, xz, yy, yz, zz = inertia[np.triu_indices(3)].tolist()
        links.append(
            LinkCad(
                mass_kg=mass,
                centre_m=(x, y, z),
                inertia_kg_m2=(xx, xy, xz, yy, yz, zz),
                uncertainty=None,
            )
        )
    return tuple(links)
