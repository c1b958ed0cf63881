"""`Known`: what is known of a payload otherwise, such as its mass from a scale."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from config.arrays import FloatArray
from config.errors import EstimationError
from config.plausible import Plausible
from config.ranges import KnownSigma, KnownValue, Ranged
from dynamics.terms.rigid_body import PARAMETERS_PER_LINK
from identification.choices import REPORTED
from identification.payload.body import PayloadBody, reported, reported_slopes

MASS: Final = Plausible(1e-3, 2.5e3, "kg")
CENTRE: Final = Plausible(0.0, 5.0, "m")
INERTIA: Final = Plausible(0.0, 5e3, "kg m²")
LARGEST_SHARE: Final = 0.5


@dataclass(frozen=True)
class Known(Ranged):
    """A quantity of the payload that was measured otherwise, such as on scales.

    Attributes:
        name: One of `REPORTED`: m, cx, cy, cz, or an inertia about the centre of gravity.
        value, sigma: Its value and standard deviation; 0 holds it, whatever the recordings say.
    """

    name: str
    value: KnownValue
    sigma: KnownSigma

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name not in REPORTED:
            raise EstimationError(
                f"{self.name!r} is no quantity of a payload: they are {', '.join(REPORTED)}",
                code="RID-OPTION-NAME",
            )
        if self.name == "m" and self.value <= 0.0:
            raise EstimationError("a known mass must be positive", code="RID-OPTION-RANGE")
        self._refuse_other_units()

    def _refuse_other_units(self) -> None:
        """Refuse sizes that no payload has, or of which its own uncertainty leaves nothing."""
        found = {"m": MASS, "c": CENTRE}.get(self.name[0], INERTIA)
        refusal = found.refusal(self.value)
        if refusal is None and self.name == "m":
            found = Plausible(0.0, LARGEST_SHARE * self.value, found.unit)
        refusal = refusal or _told("its standard deviation", found.refusal(self.sigma))
        if refusal is not None:
            raise EstimationError(f"{self.name}: {refusal}", code="RID-OPTION-RANGE")

    @property
    def held(self) -> bool:
        """Whether the estimate has exactly this value."""
        return self.sigma == 0.0


def _told(what: str, refusal: str | None) -> str | None:
    return None if refusal is None else f"{what}: {refusal}"


def require_once(known: Sequence[Known]) -> None:
    """Raise an `EstimationError` where a quantity is known twice."""
    names = [quantity.name for quantity in known]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise EstimationError(
            f"{twice[0]} is known twice: leave one of them out", code="RID-OPTION-EXCLUSIVE"
        )


def known_rows(known: Sequence[Known], values: FloatArray) -> FloatArray:
    """Return what is known as equations of the ten parameters near some values, (any, 11)."""
    slopes, at = reported_slopes(values), reported(values)
    rows = np.zeros((len(known), PARAMETERS_PER_LINK + 1))
    for row, quantity in zip(rows, known, strict=True):
        index = REPORTED.index(quantity.name)
        row[:-1] = slopes[index]
        row[-1] = quantity.value - at[index] + slopes[index] @ values
    return rows


def with_held(known: Sequence[Known], values: FloatArray) -> FloatArray:
    """Return ten parameters that differ from others in what is held alone, which is exact."""
    held = [quantity for quantity in known if quantity.held]
    if not held:
        return values
    body = reported(values)
    for quantity in held:
        body[REPORTED.index(quantity.name)] = quantity.value
    return PayloadBody.of_reported(body).parameters


def started(values: FloatArray, known: Sequence[Known]) -> FloatArray:
    """Return values that Gauss-Newton can begin at: with the known mass, or a positive one."""
    mass = next((q.value for q in known if q.name == "m"), max(float(values[0]), 0.1))
    return np.array([mass, *values[1:]])
