"""`LinkCad`: mass, centre of gravity and inertia of a link from drawings."""

from __future__ import annotations

from typing import Annotated, Final, Self

import numpy as np
from pydantic import Field, model_validator

from config.plausible import Derived, Plausible, radius_of_gyration
from config.quantities import InertiaElements, NonNegative, Place

_STEEL_KG_M3: Final = 7850.0
_HOLLOW_KG_M3: Final = 100.0


class LinkCad(Derived):
    """Drawing data of a link, in its frame (modified convention, frame i on axis i).

    Attributes:
        mass_kg: Mass.
        centre_m: Centre of gravity.
        inertia_kg_m2: xx, xy, xz, yy, yz, zz about the centre of gravity, elements of the matrix.
            An inertia below that of a steel ball of the same mass counts as unknown, because it is
            zero or was rounded away.
        uncertainty: Standard deviation of every value, relative to its magnitude. Null marks a
            guess: it is used to plan motions, but not as a prior.
    """

    mass_kg: Annotated[NonNegative, Plausible(1e-4, 3e3, "kg")]
    centre_m: Place = (0.0, 0.0, 0.0)
    inertia_kg_m2: InertiaElements = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    uncertainty: Annotated[float, Field(gt=0.0), Plausible(1e-3, 2.0, "")] | None = 0.1

    @model_validator(mode="after")
    def _check_inertia(self) -> Self:
        xx, xy, xz, yy, yz, zz = self.inertia_kg_m2
        moments = np.linalg.eigvalsh([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        slack = 1e-6 * abs(moments[2])
        if moments[0] < -slack or moments[0] + moments[1] < moments[2] - slack:
            raise ValueError(
                f"inertia_kg_m2 has the principal moments {', '.join(f'{m:.4g}' for m in moments)}:"
                " none may be negative or larger than the sum of the other two; check the order"
                " xx, xy, xz, yy, yz, zz and the signs"
            )
        return self

    @property
    def unknown_inertia_kg_m2(self) -> float | None:
        """A typical moment of inertia for the mass if the stated one is unknown; else None.

        The stated inertia is unknown if it is below that of a steel ball: zero or rounded away.
        """
        xx, _, _, yy, _, zz = self.inertia_kg_m2
        if (xx + yy + zz) / 3.0 >= _ball_kg_m2(self.mass_kg, _STEEL_KG_M3):
            return None
        return _ball_kg_m2(self.mass_kg, _HOLLOW_KG_M3)

    def derived(self) -> dict[str, tuple[float, Plausible]]:
        """Return the radius of gyration."""
        xx, _, _, yy, _, zz = self.inertia_kg_m2
        return radius_of_gyration(self.mass_kg, (xx, yy, zz))


def _ball_kg_m2(mass_kg: float, density_kg_m3: float) -> float:
    """Return the moment of inertia of a ball about its centre [kg m²]."""
    radius_m = (3.0 * mass_kg / (4.0 * np.pi * density_kg_m3)) ** (1.0 / 3.0)
    return float(0.4 * mass_kg * radius_m**2)
