"""`LinkBody`: a link by mass, centre of gravity and inertia, as simulators describe it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.arrays import FloatArray


@dataclass(frozen=True, eq=False)
class LinkBody:
    """A link's mass, centre of gravity and inertia about this centre, in the link's frame."""

    mass_kg: float
    centre_m: FloatArray
    inertia_kg_m2: FloatArray

    @classmethod
    def of(cls, parameters: FloatArray) -> LinkBody:
        """Return the body of a link's ten parameters about its origin (parallel-axis theorem)."""
        mass, centre = float(parameters[0]), parameters[1:4] / parameters[0]
        inertia = np.zeros((3, 3))
        inertia[np.triu_indices(3)] = parameters[4:]
        inertia = inertia + np.triu(inertia, 1).T
        steiner = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        return cls(mass, centre, inertia - steiner)

    @property
    def principal_moments_kg_m2(self) -> FloatArray:
        """The principal moments of inertia, ascending, shape (3,)."""
        return np.array(np.linalg.eigvalsh(self.inertia_kg_m2), dtype=float)

    @property
    def is_consistent(self) -> bool:
        """True if the link is physically consistent (Traversaro 2016).

        Some distribution of positive mass must have these values.
        """
        if self.mass_kg <= 0.0:
            return False
        moments = self.principal_moments_kg_m2
        return bool(moments[0] > 0.0 and moments[0] + moments[1] > moments[2])
