"""`KnownPayloadValue`: payload quantity known from another source, such as a mass from scales."""

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
class KnownPayloadValue(Ranged):
    """A quantity of the payload that was measured separately, such as on scales.

    Attributes:
        name: One of `REPORTED`: m, cx, cy, cz, or an inertia about the centre of gravity.
        value, sigma: Value and standard deviation; a standard deviation of 0 fixes the value,
            whatever the recordings show.
    """

    name: str
    value: KnownValue
    sigma: KnownSigma

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.name not in REPORTED:
            raise EstimationError(
                f"{self.name!r} is not a payload quantity: use one of {', '.join(REPORTED)}",
                code="RID-OPTION-NAME",
            )
        if self.name == "m" and self.value <= 0.0:
            raise EstimationError("a known mass must be positive", code="RID-OPTION-RANGE")
        self._refuse_other_units()

    def _refuse_other_units(self) -> None:
        """Refuse implausible values, and standard deviations that are too large for the value."""
        found = {"m": MASS, "c": CENTRE}.get(self.name[0], INERTIA)
        refusal = found.refusal(self.value)
        if refusal is None and self.name == "m":
            found = Plausible(0.0, LARGEST_SHARE * self.value, found.unit)
        refusal = refusal or _prefix_refusal("its standard deviation", found.refusal(self.sigma))
        if refusal is not None:
            raise EstimationError(f"{self.name}: {refusal}", code="RID-OPTION-RANGE")

    @property
    def is_exact(self) -> bool:
        """True if the estimate is fixed to exactly this value."""
        return self.sigma == 0.0


def _prefix_refusal(what: str, refusal: str | None) -> str | None:
    return None if refusal is None else f"{what}: {refusal}"


def refuse_duplicates(known: Sequence[KnownPayloadValue]) -> None:
    """Raise an `EstimationError` if a quantity is given twice."""
    names = [quantity.name for quantity in known]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise EstimationError(
            f"the quantity {twice[0]} is given twice: remove one of the two",
            code="RID-OPTION-EXCLUSIVE",
        )


def known_rows(known: Sequence[KnownPayloadValue], values: FloatArray) -> FloatArray:
    """Return known quantities as equations of the ten parameters near some values, (any, 11)."""
    slopes, at = reported_slopes(values), reported(values)
    rows = np.zeros((len(known), PARAMETERS_PER_LINK + 1))
    for row, quantity in zip(rows, known, strict=True):
        index = REPORTED.index(quantity.name)
        row[:-1] = slopes[index]
        row[-1] = quantity.value - at[index] + slopes[index] @ values
    return rows


def with_fixed_values(known: Sequence[KnownPayloadValue], values: FloatArray) -> FloatArray:
    """Return ten parameters in which fixed quantities have exactly their known values."""
    held = [quantity for quantity in known if quantity.is_exact]
    if not held:
        return values
    body = reported(values)
    for quantity in held:
        body[REPORTED.index(quantity.name)] = quantity.value
    return PayloadBody.of_reported(body).parameters


def start_values(values: FloatArray, known: Sequence[KnownPayloadValue]) -> FloatArray:
    """Return start values for Gauss-Newton, with the known mass or at least 0.1 kg."""
    mass = next((q.value for q in known if q.name == "m"), max(float(values[0]), 0.1))
    return np.array([mass, *values[1:]])
